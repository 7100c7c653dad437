"""The USB bus: every error of pyusb becomes one sentence on what happened and one on what to do."""

import errno
from types import SimpleNamespace

import pytest
import usb.core

from instrument.devices.digitizer import DigitizerError
from instrument.devices.usb_bus import find_matching, usb_errors_of


@pytest.mark.parametrize(
    ("error", "what", "remedy"),
    [
        (NotImplementedError(), "does not allow it", "driver"),
        (usb.core.USBError("x", None, errno.EACCES), "no permission", "driver"),
        (usb.core.USBError("x", None, errno.EBUSY), "in use by another program", "close the other program"),
        (usb.core.USBError("x", None, errno.ENODEV), "unplugged", "plug it in again"),
        (usb.core.USBTimeoutError("x", None, None), "does not answer", "unplug it, plug it in again"),
        (usb.core.USBError("pipe error", None, errno.EPIPE), "pipe error", "unplug it, plug it in again"),
    ],
)
def test_an_error_of_the_bus_says_what_happened_to_which_device_and_then_what_to_do(
    error: Exception, what: str, remedy: str
) -> None:
    """The window shows both apart: the first as the fault, the second as the way out of it."""
    with pytest.raises(DigitizerError) as refusal, usb_errors_of("the Rigol"):
        raise error
    assert "the Rigol" in refusal.value.what and what in refusal.value.what
    assert "the Rigol" not in refusal.value.remedy
    if remedy == "driver":  # a rule for udev, or a driver; the words depend on the system
        assert "driver" in refusal.value.remedy or "udev rule" in refusal.value.remedy
    else:
        assert remedy in refusal.value.remedy


def test_devices_come_in_the_order_of_the_bus_and_of_their_address_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever order the library lists them in: the first of a kind is the same at every start."""
    places = [(2, 1), (1, 9), (None, 4), (1, 3)]
    devices = [SimpleNamespace(bus=bus, address=address) for bus, address in places]
    monkeypatch.setattr(usb.core, "find", lambda **_given: iter(devices))
    found = find_matching(lambda _device: True, backend="theirs")
    assert [(one.bus, one.address) for one in found] == [(None, 4), (1, 3), (1, 9), (2, 1)]

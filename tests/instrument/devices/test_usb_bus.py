"""The USB bus: every error of pyusb becomes one sentence on what happened and one on what to do."""

import errno
from collections.abc import Callable
from types import SimpleNamespace

import pytest
import usb.core
import usb.util

from instrument.devices import usb_bus
from instrument.devices.digitizer import DigitizerError
from instrument.devices.usb_bus import claim, find_devices, find_matching, is_permitted, release, usb_errors_of


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
    places = [(2, 1), (1, 9), (None, 4), (1, 3), (1, None), (0, 3)]
    devices = [SimpleNamespace(bus=bus, address=address) for bus, address in places]
    monkeypatch.setattr(usb.core, "find", lambda **_given: iter(devices))
    found = find_matching(lambda _device: True, backend="theirs")
    assert [(one.bus, one.address) for one in found] == [(0, 3), (None, 4), (1, None), (1, 3), (1, 9), (2, 1)]


class Device:
    """A pyusb device that notes what is asked of it."""

    def __init__(self, asked: list[object], configuration: Exception | None = None, driver: object = False) -> None:
        self.asked, self.configuration, self.driver = asked, configuration, driver

    def get_active_configuration(self) -> None:
        self.asked.append("configuration?")
        if self.configuration is not None:
            raise self.configuration

    def set_configuration(self) -> None:
        self.asked.append("configure")

    def is_kernel_driver_active(self, interface: int) -> object:
        if isinstance(self.driver, Exception):
            raise self.driver
        return self.driver

    def detach_kernel_driver(self, interface: int) -> None:
        self.asked.append(("detach", interface))


@pytest.mark.parametrize(
    ("configuration", "driver", "asked"),
    [
        (None, False, [("claim", 3)]),
        (usb.core.USBError("not configured", None, errno.EIO), False, ["configure", ("claim", 3)]),
        (None, True, [("detach", 3), ("claim", 3)]),
        (None, NotImplementedError(), [("claim", 3)]),  # where a system has no such drivers
        (usb.core.USBError("x", None, errno.EACCES), False, "no permission to open scope"),
        (usb.core.USBError("x", None, errno.EPERM), False, "no permission to open scope"),
    ],
)
def test_a_device_is_configured_and_taken_from_the_kernel_where_it_must_be(
    configuration: Exception | None, driver: object, asked: list[object] | str, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[object] = []
    monkeypatch.setattr(usb.util, "claim_interface", lambda device, interface: done.append(("claim", interface)))
    device = Device(done, configuration, driver)
    if isinstance(asked, str):
        with pytest.raises(DigitizerError, match=asked):
            claim(device, 3, "scope")
        assert done == ["configuration?"]
    else:
        claim(device, 3, "scope")
        assert done == ["configuration?", *asked]


@pytest.mark.parametrize(
    ("error", "permitted"),
    [
        (None, True),
        (usb.core.USBError("x", None, errno.EACCES), False),
        (usb.core.USBError("x", None, errno.EPERM), False),
        (usb.core.USBError("x", None, errno.EIO), True),  # it may be opened, whatever else is wrong
        (NotImplementedError(), True),
    ],
)
def test_whether_this_user_may_open_a_device_is_asked_anew_and_leaves_it_closed(
    error: Exception | None, permitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[object] = []
    monkeypatch.setattr(usb.util, "dispose_resources", lambda device: done.append("close"))
    assert is_permitted(Device(done, error)) is permitted
    assert done == ["close", "configuration?", "close"]


def test_a_device_that_is_gone_is_released_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(_device: object) -> None:
        raise usb.core.USBError("gone", None, errno.ENODEV)

    monkeypatch.setattr(usb.util, "dispose_resources", gone)
    release("device")
    monkeypatch.setattr(usb.core, "find", lambda **_given: gone(None))
    with pytest.raises(DigitizerError, match="the USB bus was unplugged"):
        find_matching(lambda _device: True, backend="theirs")


def test_devices_are_found_by_vendor_and_product_together(monkeypatch: pytest.MonkeyPatch) -> None:
    plugged = [SimpleNamespace(idVendor=v, idProduct=p, bus=1, address=a) for a, (v, p) in enumerate([(1, 2), (2, 1)])]
    asked: list[object] = []

    def find(*, find_all: bool, backend: object, custom_match: Callable[[object], bool]) -> list[object]:
        asked.append((find_all, backend))
        return [device for device in plugged if custom_match(device)]

    monkeypatch.setattr(usb.core, "find", find)
    monkeypatch.setattr(usb_bus, "find_backend", lambda: "own")
    assert find_devices([(1, 2), (3, 1)]) == plugged[:1] and find_devices([(2, 2)], "theirs") == []
    assert asked == [(True, "own"), (True, "theirs")]
    assert usb_bus.identity(SimpleNamespace(idVendor=0x1AB1, idProduct=0xCE)) == "1ab1:00ce"

"""Access the USB bus through pyusb: find and claim devices, and convert pyusb's errors to DigitizerError."""

import errno
import importlib
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import usb.backend.libusb1
import usb.core
import usb.util

from instrument.devices.digitizer import DigitizerError

PERMISSION_REMEDY = (
    "install the udev rule (levimass doctor shows how), then unplug the device and plug it in again"
    if sys.platform.startswith("linux")
    else "give the device the WinUSB driver with Zadig (Windows), or close the program that holds it"
)
LIBRARY_REMEDY = "install it (Debian: apt install libusb-1.0-0; elsewhere: pip install 'levimass[usb]')"

_GONE = {errno.ENODEV, errno.ENOENT, errno.ESHUTDOWN, errno.ENXIO}


class Unplugged(DigitizerError):
    """The device is no longer on the bus."""


def find_backend() -> Any:
    """Return pyusb's libusb 1.0 backend.  Raises DigitizerError if the library is missing."""
    backend = usb.backend.libusb1.get_backend()
    if backend is None:
        try:
            backend = importlib.import_module("libusb_package").get_libusb1_backend()
        except ImportError:
            backend = None
    if backend is None:
        raise DigitizerError("the USB library libusb-1.0 was not found", LIBRARY_REMEDY)
    return backend


def identity(device: Any) -> str:
    """Return vendor and product of a device, as "1ab1:04ce"."""
    return f"{device.idVendor:04x}:{device.idProduct:04x}"


def find_devices(ids: Iterable[tuple[int, int]], backend: Any = None) -> list[Any]:
    """Return the pyusb devices with one of the (vendor, product) pairs, in bus order.  Raises DigitizerError."""
    wanted = frozenset(ids)
    return find_matching(lambda device: (device.idVendor, device.idProduct) in wanted, backend)


def find_matching(matches: Any, backend: Any = None) -> list[Any]:
    """Return the pyusb devices for which ``matches(device)`` is True, in bus order.  Raises DigitizerError."""
    backend = backend if backend is not None else find_backend()
    try:
        found = list(usb.core.find(find_all=True, backend=backend, custom_match=matches))
    except usb.core.USBError as error:
        raise digitizer_error(error, "the USB bus") from error
    return sorted(found, key=lambda device: (device.bus or 0, device.address or 0))


def is_permitted(device: Any) -> bool:
    """Return whether this user may open the device; True if this is unknown without opening it."""
    try:
        usb.util.dispose_resources(device)
        device.get_active_configuration()
        return True
    except usb.core.USBError as error:
        return error.errno not in (errno.EACCES, errno.EPERM)
    except NotImplementedError:
        return True
    finally:
        usb.util.dispose_resources(device)


def digitizer_error(error: Exception, name: str) -> DigitizerError:
    """Return a pyusb error as a DigitizerError with a remedy."""
    number = getattr(error, "errno", None)
    if isinstance(error, NotImplementedError):
        return DigitizerError(f"{name} cannot be opened: its USB driver does not allow it", PERMISSION_REMEDY)
    if number in (errno.EACCES, errno.EPERM):
        return DigitizerError(f"no permission to open {name}", PERMISSION_REMEDY)
    if number == errno.EBUSY:
        return DigitizerError(f"{name} is in use by another program", "close the other program")
    if number in _GONE:
        return Unplugged(f"{name} was unplugged", "plug it in again and re-arm")
    if number == errno.ETIMEDOUT or isinstance(error, usb.core.USBTimeoutError):
        return DigitizerError(f"{name} does not answer", "unplug it, plug it in again and re-arm")
    return DigitizerError(f"{name}: USB error: {error}", "unplug it, plug it in again and re-arm")


@contextmanager
def usb_errors_of(name: str) -> Iterator[None]:
    """Convert pyusb's errors inside the with block to DigitizerError."""
    try:
        yield
    except (usb.core.USBError, NotImplementedError) as error:
        raise digitizer_error(error, name) from error


def claim(device: Any, interface: int, name: str) -> None:
    """Claim ``interface`` of the device for this program, detaching a kernel driver that uses it."""
    with usb_errors_of(name):
        try:
            device.get_active_configuration()
        except usb.core.USBError as error:
            if error.errno in (errno.EACCES, errno.EPERM):
                raise
            device.set_configuration()
        try:
            in_use = device.is_kernel_driver_active(interface)
        except NotImplementedError:
            in_use = False
        if in_use:
            device.detach_kernel_driver(interface)
        usb.util.claim_interface(device, interface)


def release(device: Any) -> None:
    """Release the device; harmless if it was unplugged."""
    try:
        usb.util.dispose_resources(device)
    except usb.core.USBError:
        return

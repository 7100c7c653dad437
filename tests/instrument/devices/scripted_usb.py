"""A USB bus for pyusb that follows a script: the exact requests in their order, each with its answer."""

import errno
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import usb.backend
import usb.core


@dataclass(frozen=True)
class Out:
    """A control write that must come next; ``answer`` may be an exception."""

    request: int
    value: int
    content: bytes
    answer: Any = None
    request_type: int = 0x40
    index: int = 0


@dataclass(frozen=True)
class In:
    """A control read that must come next, and its bytes or exception."""

    request: int
    value: int
    length: int
    answer: Any
    request_type: int = 0xC0
    index: int = 0


@dataclass(frozen=True)
class BulkOut:
    """A bulk write that must come next."""

    endpoint: int
    content: bytes
    answer: Any = None


@dataclass(frozen=True)
class BulkIn:
    """A bulk read that must come next, and its bytes or exception."""

    endpoint: int
    length: int
    answer: Any


@dataclass(frozen=True)
class ClearHalt:
    """A clearing of an endpoint's halt that must come next."""

    endpoint: int


@dataclass
class Plugged:
    """A device on the scripted bus."""

    vendor: int
    product: int
    release: int = 0x0210
    address: int = 1
    serial: int = 0
    endpoints: tuple[tuple[int, int], ...] = ((0x86, 2),)  # (address, attributes)
    interface_class: tuple[int, int, int] = (0xFF, 0, 0)
    forbidden: bool = False
    busy: bool = False


@dataclass
class ScriptedUsb(usb.backend.IBackend):
    """pyusb's backend; ``finish`` fails when something of the script was not asked for."""

    devices: list[Plugged]
    script: list[Any] = field(default_factory=list)
    opened: int = 0
    claimed: list[int] = field(default_factory=list)
    timeouts_ms: list[int] = field(default_factory=list)

    def finish(self) -> None:
        assert self.script == [], f"never asked for: {self.script}"

    def _next(self, kind: type, **seen: Any) -> Any:
        assert self.script, f"nothing more was expected, but came {kind.__name__} {seen}"
        step = self.script.pop(0)
        if callable(step):
            step()
            return self._next(kind, **seen)
        assert isinstance(step, kind), f"expected {step}, came {kind.__name__} {seen}"
        expected = {name: getattr(step, name) for name in seen}
        assert seen == expected
        answer = getattr(step, "answer", None)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def enumerate_devices(self) -> Any:
        return list(self.devices)

    def get_parent(self, device: Plugged) -> None:
        return None

    def get_device_descriptor(self, device: Plugged) -> Any:
        return SimpleNamespace(
            bLength=18, bDescriptorType=1, bcdUSB=0x200, bDeviceClass=0xFF, bDeviceSubClass=0, bDeviceProtocol=0,
            bMaxPacketSize0=64, idVendor=device.vendor, idProduct=device.product, bcdDevice=device.release,
            iManufacturer=0, iProduct=0, iSerialNumber=0, bNumConfigurations=1, address=device.address, bus=1,
            port_number=1, port_numbers=(1,), speed=3,
        )  # fmt: skip

    def get_configuration_descriptor(self, device: Plugged, index: int) -> Any:
        if index:
            raise IndexError(index)
        return SimpleNamespace(
            bLength=9, bDescriptorType=2, wTotalLength=25, bNumInterfaces=1, bConfigurationValue=1, iConfiguration=0,
            bmAttributes=0x80, bMaxPower=50, extra_descriptors=[],
        )  # fmt: skip

    def get_interface_descriptor(self, device: Plugged, interface: int, alternate: int, config: int) -> Any:
        if interface or alternate or config:
            raise IndexError(interface)
        kind = device.interface_class
        return SimpleNamespace(
            bLength=9, bDescriptorType=4, bInterfaceNumber=0, bAlternateSetting=0, bNumEndpoints=len(device.endpoints),
            bInterfaceClass=kind[0], bInterfaceSubClass=kind[1], bInterfaceProtocol=kind[2], iInterface=0,
            extra_descriptors=[],
        )  # fmt: skip

    def get_endpoint_descriptor(self, device: Plugged, index: int, interface: int, alternate: int, config: int) -> Any:
        address, attributes = device.endpoints[index]
        return SimpleNamespace(
            bLength=7, bDescriptorType=5, bEndpointAddress=address, bmAttributes=attributes, wMaxPacketSize=512,
            bInterval=0, bRefresh=0, bSynchAddress=0, extra_descriptors=[],
        )  # fmt: skip

    def open_device(self, device: Plugged) -> Plugged:
        if device.forbidden:
            raise usb.core.USBError("Access denied", -3, errno.EACCES)
        self.opened += 1
        return device

    def close_device(self, handle: Plugged) -> None:
        self.opened -= 1

    def get_configuration(self, handle: Plugged) -> int:
        return 1

    def set_configuration(self, handle: Plugged, value: int) -> None:
        pass

    def claim_interface(self, handle: Plugged, interface: int) -> None:
        if handle.busy:
            raise usb.core.USBError("Resource busy", -6, errno.EBUSY)
        self.claimed.append(interface)

    def release_interface(self, handle: Plugged, interface: int) -> None:
        self.claimed.remove(interface)

    def is_kernel_driver_active(self, handle: Plugged, interface: int) -> bool:
        return False

    def clear_halt(self, handle: Plugged, endpoint: int) -> None:
        self._next(ClearHalt, endpoint=endpoint)

    def ctrl_transfer(
        self, handle: Plugged, request_type: int, request: int, value: int, index: int, data: Any, timeout: int
    ) -> int:
        self.timeouts_ms.append(timeout)
        if request_type & 0x80:
            answer = self._next(
                In, request_type=request_type, request=request, value=value, index=index, length=len(data)
            )
            data[: len(answer)] = type(data)("B", answer)
            return len(answer)
        content = bytes(data)
        answer = self._next(Out, request_type=request_type, request=request, value=value, index=index, content=content)
        return len(content) if answer is None else int(answer)

    def bulk_write(self, handle: Plugged, endpoint: int, interface: int, data: Any, timeout: int) -> int:
        self.timeouts_ms.append(timeout)
        content = bytes(data)
        answer = self._next(BulkOut, endpoint=endpoint, content=content)
        return len(content) if answer is None else int(answer)

    def bulk_read(self, handle: Plugged, endpoint: int, interface: int, buffer: Any, timeout: int) -> int:
        self.timeouts_ms.append(timeout)
        answer = self._next(BulkIn, endpoint=endpoint, length=len(buffer))
        buffer[: len(answer)] = type(buffer)("B", answer)
        return len(answer)

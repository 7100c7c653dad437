"""SCPI over USB: message framing of the USB Test and Measurement Class (USBTMC 1.0, tables 1-9) over pyusb.

REN_CONTROL is never sent: oscilloscopes do not need it and some (Rigol, Siglent) hang on it.
"""

import math
import struct
import time
from collections.abc import Callable
from typing import Any

import usb.core

from instrument.devices import usb_bus
from instrument.devices.digitizer import DigitizerError
from instrument.devices.scpi_links import (
    ANSWER_S,
    BLOCK_S,
    MAX_LINE_BYTES,
    Cancelled,
    Deadline,
    Stalled,
    block_start,
    never,
)

VENDORS = {0x1AB1: "Rigol", 0xF4EC: "Siglent", 0xF4ED: "Siglent", 0x0957: "Keysight", 0x2A8D: "Keysight"}
CLASS = (0xFE, 0x03)
MAX_REQUEST_BYTES = (1 << 20) - 12

_OUT, _IN = 1, 2
_INITIATE_ABORT_BULK_IN, _CHECK_ABORT_BULK_IN = 3, 4
_PENDING = 2
_HEADER = struct.Struct("<BBBxIBBxx")


def test_and_measurement_interface(device: Any) -> Any:
    """Return the USBTMC interface of a pyusb device, or None."""
    try:
        for configuration in device:
            for interface in configuration:
                if (interface.bInterfaceClass, interface.bInterfaceSubClass) == CLASS:
                    return interface
    except (usb.core.USBError, NotImplementedError):
        return None
    return None


def find_instruments(backend: Any = None) -> list[Any]:
    """Return the pyusb devices of the known makers that speak USBTMC.  Raises DigitizerError."""
    found = usb_bus.find_matching(lambda device: device.idVendor in VENDORS, backend)
    return [device for device in found if test_and_measurement_interface(device) is not None]


class UsbtmcTransport:
    """A link to a USBTMC instrument, claimed exclusively for this program."""

    def __init__(self, device: Any) -> None:
        self.name = f"{VENDORS.get(device.idVendor, 'USB')} oscilloscope ({usb_bus.identity(device)})"
        interface = test_and_measurement_interface(device)
        if interface is None:
            raise DigitizerError(f"{self.name} does not speak USBTMC", "switch its USB device port to USBTMC")
        self._device = device
        self._interface = interface.bInterfaceNumber
        bulk = [e.bEndpointAddress for e in interface if e.bmAttributes & 3 == 2]
        self._in = next((e for e in bulk if e & 0x80), 0)
        self._out = next((e for e in bulk if not e & 0x80), 0)
        if not (self._in and self._out):
            raise DigitizerError(f"{self.name} has no bulk endpoints", "re-plug it")
        self._tag = 0
        usb_bus.claim(device, self._interface, self.name)

    def write(self, command: str) -> None:
        """Send a command as one message."""
        content = command.encode("ascii") + b"\n"
        message = self._head(_OUT, len(content), 1) + content
        message += bytes(-len(message) % 4)
        with usb_bus.usb_errors_of(self.name):
            self._device.write(self._out, message, timeout=3000)

    def query(self, command: str, timeout_s: float = ANSWER_S) -> str:
        deadline = Deadline(timeout_s)
        self.write(command)
        answer = bytearray()
        ended = False
        while not ended:
            content, ended = self._request(MAX_LINE_BYTES, deadline.check(self.name, command))
            answer += content
            if len(answer) > MAX_LINE_BYTES:
                raise DigitizerError(f"{self.name} answered {command} without an end", "re-arm")
        return answer.decode("ascii", "replace").strip()

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = BLOCK_S
    ) -> bytes:
        """Send a command and return the bytes of the block in its answer, fetched by requests of at most 1 MiB."""
        deadline = Deadline(timeout_s)
        self.write(command)
        received = bytearray()
        start: tuple[int, int] | None = None
        ended = False
        while not ended:
            if cancelled():
                self._abort()
                raise Cancelled
            rest = max_bytes if start is None else start[0] + start[1] - len(received)
            try:
                pause_s = min(timeout_s, deadline.check(self.name, command))
                content, ended = self._request(min(MAX_REQUEST_BYTES, max(rest, 0) + 64), pause_s)
            except DigitizerError as error:
                raise Stalled(error.what, error.remedy, bytes(received[start[0] :]) if start else b"") from error
            received += content
            if start is None:
                start = block_start(received, self.name, max_bytes)
                if start is not None:
                    deadline.allow_for(start[1])
            if len(received) > max_bytes + 128:
                self._abort()
                raise DigitizerError(f"{self.name} sends more than was requested", "re-arm")
        if start is None or len(received) < start[0] + start[1]:
            block = bytes(received[start[0] :]) if start else b""
            raise Stalled(f"{self.name} ended its answer to {command} early", "re-arm", block)
        return bytes(memoryview(received)[start[0] : start[0] + start[1]])

    def close(self) -> None:
        usb_bus.release(self._device)

    def _head(self, kind: int, size: int, attributes: int) -> bytes:
        self._tag = self._tag % 255 + 1
        return _HEADER.pack(kind, self._tag, self._tag ^ 0xFF, size, attributes, 0)

    def _request(self, size: int, timeout_s: float) -> tuple[bytes, bool]:
        """Request up to ``size`` bytes of the answer; return them and whether the message ended."""
        try:
            with usb_bus.usb_errors_of(self.name):
                self._device.write(self._out, self._head(_IN, size, 0), timeout=3000)
                answer = self._read(size, timeout_s) or self._read(size, timeout_s)  # some send an empty packet first
        except usb_bus.Unplugged:
            raise
        except DigitizerError:
            self._abort()
            raise
        if len(answer) < _HEADER.size:
            self._abort()
            raise DigitizerError(f"{self.name} sent {len(answer)} bytes where a message head is due", "re-arm")
        kind, tag, inverse, length, attributes, _ = _HEADER.unpack_from(answer)
        if (kind, tag, inverse) != (_IN, self._tag, self._tag ^ 0xFF):
            self._abort()
            raise DigitizerError(f"{self.name} sent a message head that answers no request", "re-arm")
        content = answer[_HEADER.size : _HEADER.size + length]
        if len(content) < length:
            self._abort()
            raise DigitizerError(f"{self.name} announced {length} bytes and sent {len(content)}", "re-arm")
        return content, bool(attributes & 1)

    def _read(self, size: int, timeout_s: float) -> bytes:
        padded = (_HEADER.size + size + 3) // 4 * 4
        return bytes(self._device.read(self._in, padded, timeout=math.ceil(1e3 * timeout_s)))  # 0 would mean no timeout

    def _abort(self) -> None:
        """Abort the current answer, so that the next command is understood (USBTMC 1.0, 4.2.1.4)."""
        try:
            status = self._class_request(_INITIATE_ABORT_BULK_IN, self._tag, 2)
            end = time.monotonic() + 1.0
            while status and time.monotonic() < end:
                if status[0] not in (1, _PENDING):
                    return
                status = self._class_request(_CHECK_ABORT_BULK_IN, 0, 8)
                if status and status[0] == 1:
                    break
                if status and len(status) > 1 and status[1] & 1:  # remaining bytes must be read first
                    self._device.read(self._in, 1 << 16, timeout=200)
            self._device.clear_halt(self._in)
        except (usb.core.USBError, NotImplementedError):
            return  # the original error is the one reported

    def _class_request(self, request: int, value: int, length: int) -> bytes:
        return bytes(self._device.ctrl_transfer(0xA2, request, value, self._in, length, timeout=500))

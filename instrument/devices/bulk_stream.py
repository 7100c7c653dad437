"""Read a USB bulk endpoint without gaps: several transfers are queued with the kernel at any time.

pyusb has no asynchronous bulk transfers, and calling its ``read`` in a loop leaves gaps that a 2 KiB device FIFO cannot
bridge.  The transfers therefore use libusb's asynchronous calls with pyusb's library and device handle.  The structure
they need is fixed by libusb's public ABI.  pyusb's internal names for library, context and handle are checked in
``_libusb_of``, and pyusb's version is bounded in pyproject.toml.
"""

import ctypes
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from instrument.background import start_thread
from instrument.devices.digitizer import DigitizerError

IN_FLIGHT_BYTES = 12 << 20  # Linux allows 16 MiB in total for all programs
MAX_TRANSFER_BYTES = 1 << 20
MIN_TRANSFER_BYTES = 8 << 10
MAX_TRANSFERS = 32
WAITING_BYTES = 64 << 20  # received but unread bytes above which no transfer is queued
_RETRIES = 3

_COMPLETED, _ERROR, _TIMED_OUT, _CANCELLED, _STALL, _NO_DEVICE, _OVERFLOW = range(7)
_LIBUSB_NO_DEVICE = -4
_BULK = 2


class _Transfer(ctypes.Structure):
    """``struct libusb_transfer`` of libusb.h, without its isochronous tail."""


_Callback = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Transfer))
_Transfer._fields_ = [
    ("dev_handle", ctypes.c_void_p),
    ("flags", ctypes.c_uint8),
    ("endpoint", ctypes.c_ubyte),
    ("type", ctypes.c_ubyte),
    ("timeout", ctypes.c_uint),
    ("status", ctypes.c_int),
    ("length", ctypes.c_int),
    ("actual_length", ctypes.c_int),
    ("callback", _Callback),
    ("user_data", ctypes.c_void_p),
    ("buffer", ctypes.c_void_p),
    ("num_iso_packets", ctypes.c_int),
]


class _Timeval(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_usec", ctypes.c_long))


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes of one finished transfer (uint8, shape (n,)); ``lost_before``: no transfer was queued before this one."""

    codes: NDArray[np.uint8]
    received_s: float  # time.monotonic() when the transfer finished
    lost_before: bool = False


def transfer_size(bytes_per_s: float) -> int:
    """Return the bytes per transfer (a power of two): about 20 ms of data."""
    size = MIN_TRANSFER_BYTES
    while size < MAX_TRANSFER_BYTES and size < bytes_per_s * 0.02:
        size *= 2
    return size


def _libusb_of(device: Any) -> tuple[Any, Any, Any]:
    """Return (library, context, handle) of an opened pyusb device.  Raises DigitizerError if there is no libusb."""
    try:
        backend = device._ctx.backend
        return backend.lib, backend.ctx, device._ctx.handle.handle
    except AttributeError as error:
        raise DigitizerError("streaming needs libusb 1.0 and pyusb 1.2 or 1.3", "reinstall Levimass") from error


class _Slot:
    """A transfer and the buffer that it fills."""

    def __init__(self, pointer: Any, size: int) -> None:
        self.pointer = pointer
        self.size = size
        self.codes = np.empty(size, np.uint8)


class BulkStream:
    """Reads ``endpoint`` of a claimed pyusb device through a queue of asynchronous transfers and one event thread."""

    def __init__(self, device: Any, endpoint: int, bytes_per_s: float, name: str) -> None:
        self._lib, self._context, self._handle = _libusb_of(device)
        self._device = device  # keeps the handle alive
        self._endpoint = endpoint
        self._name = name
        self._size = transfer_size(bytes_per_s)
        self._count = max(2, min(MAX_TRANSFERS, IN_FLIGHT_BYTES // self._size))
        self._slots: dict[int, _Slot] = {}
        self._parked: list[_Slot] = []
        self._failed: list[_Slot] = []
        self._in_flight = 0
        self._chunks: deque[Chunk] = deque()
        self._waiting_bytes = 0
        self._ready = threading.Condition()
        self._woken = False
        self._stopping = False
        self._lost = False
        self._retries = 0
        self._error: DigitizerError | None = None
        self._thread: threading.Thread | None = None
        self._callback = _Callback(self._finished)  # must outlive every transfer
        self._lib.libusb_alloc_transfer.restype = ctypes.POINTER(_Transfer)
        self._lib.libusb_alloc_transfer.argtypes = [ctypes.c_int]
        for function in ("libusb_submit_transfer", "libusb_cancel_transfer", "libusb_free_transfer"):
            getattr(self._lib, function).argtypes = [ctypes.c_void_p]

    def start(self) -> None:
        """Queue the transfers.  Raises DigitizerError if none is accepted."""
        for _ in range(self._count):
            pointer = self._lib.libusb_alloc_transfer(0)
            if not pointer:
                break
            slot = _Slot(pointer, self._size)
            self._slots[ctypes.addressof(pointer.contents)] = slot
            transfer = pointer.contents
            transfer.dev_handle = self._handle
            transfer.flags = 0
            transfer.endpoint = self._endpoint
            transfer.type = _BULK
            transfer.timeout = 0
            transfer.callback = self._callback
        with self._ready:
            for slot in self._slots.values():  # the system may accept fewer than requested
                self._submit(slot)
            if not self._in_flight:
                error = self._error or DigitizerError(f"{self._name}: no USB transfer could be queued", "re-plug it")
                self._free()
                raise error
        self._thread = start_thread(f"usb {self._name}", self._serve)

    def take(self, timeout_s: float) -> Chunk | None:
        """Return the oldest chunk, None after ``timeout_s``; raise a fault after all received chunks are taken."""
        with self._ready:
            self._ready.wait_for(lambda: self._chunks or self._error or self._woken, timeout_s)
            self._woken = False
            if self._chunks:
                chunk = self._chunks.popleft()
                self._waiting_bytes -= chunk.codes.nbytes
                if self._parked and self._waiting_bytes < WAITING_BYTES // 2:
                    parked, self._parked = self._parked, []
                    for slot in parked:
                        self._submit(slot)
                return chunk
            if self._error:
                raise self._error
            return None

    def wake(self) -> None:
        """Make a ``take`` in progress return soon; may be called from any thread."""
        with self._ready:
            self._woken = True
            self._ready.notify_all()

    def stop(self) -> None:
        """Cancel the queued transfers and wait for their end; harmless if not started."""
        with self._ready:
            self._stopping = True
        if self._thread is not None:
            self._thread.join(timeout=5.0)
            if self._thread.is_alive():  # the kernel still uses the buffers, which must not be freed
                _LEAKED.append(self)
                self._thread = None
                return
            self._thread = None
        self._free()

    def _free(self) -> None:
        for slot in self._slots.values():
            self._lib.libusb_free_transfer(slot.pointer)
        self._slots.clear()

    def _submit(self, slot: _Slot) -> None:
        transfer = slot.pointer.contents
        transfer.buffer = slot.codes.ctypes.data
        transfer.length = slot.size
        code = self._lib.libusb_submit_transfer(slot.pointer)
        if code == 0:
            self._in_flight += 1
        elif code == _LIBUSB_NO_DEVICE:
            self._fail(DigitizerError(f"{self._name} was unplugged", "plug it in again and re-arm"))
        elif not self._in_flight:
            self._fail(DigitizerError(f"{self._name}: a USB transfer was refused (libusb {code})", "re-plug it"))

    def _fail(self, error: DigitizerError) -> None:
        if self._error is None:
            self._error = error
        self._ready.notify_all()

    def _finished(self, pointer: Any) -> None:
        """Take a transfer's bytes and queue it again; called by libusb in the event thread."""
        now = time.monotonic()
        transfer = pointer.contents
        with self._ready:
            slot = self._slots[ctypes.addressof(transfer)]
            self._in_flight -= 1
            status = transfer.status
            if transfer.actual_length > 0:
                self._chunks.append(Chunk(slot.codes[: transfer.actual_length], now, self._lost))
                self._waiting_bytes += transfer.actual_length
                self._lost = False
                if status == _COMPLETED:
                    self._retries = 0
                slot.codes = np.empty(slot.size, np.uint8)
            if self._stopping or self._error:
                pass
            elif status == _NO_DEVICE:
                self._fail(DigitizerError(f"{self._name} was unplugged", "plug it in again and re-arm"))
            elif status in (_COMPLETED, _TIMED_OUT) and not self._failed:
                if self._waiting_bytes > WAITING_BYTES:
                    self._parked.append(slot)
                    self._lost = self._lost or self._in_flight == 0
                else:
                    self._submit(slot)
            else:
                self._failed.append(slot)
            self._ready.notify_all()

    def _serve(self) -> None:
        tick = _Timeval(0, 50_000)
        while True:
            with self._ready:
                ending = self._stopping or self._error is not None
                if ending and not self._in_flight:
                    return
                recovering = bool(self._failed) and not ending
                pointers = [slot.pointer for slot in self._slots.values()] if ending or recovering else []
            for pointer in pointers:  # a transfer that is not queued, or already cancelled, is unaffected
                self._lib.libusb_cancel_transfer(pointer)
            if recovering and not self._in_flight:
                self._recover()
                continue
            if self._in_flight:
                self._lib.libusb_handle_events_timeout_completed(self._context, ctypes.byref(tick), None)
            else:  # all transfers are parked until the reader takes a chunk
                with self._ready:
                    self._ready.wait(0.02)

    def _recover(self) -> None:
        """Clear the endpoint's halt and queue the failed transfers again; the loss meanwhile is flagged."""
        self._retries += 1
        if self._retries > _RETRIES:
            with self._ready:
                self._fail(DigitizerError(f"{self._name} keeps refusing to send (endpoint stalled)", "re-plug it"))
            return
        code = self._lib.libusb_clear_halt(self._handle, ctypes.c_ubyte(self._endpoint))
        with self._ready:
            if code == _LIBUSB_NO_DEVICE:
                self._fail(DigitizerError(f"{self._name} was unplugged", "plug it in again and re-arm"))
                return
            self._lost = True
            failed, self._failed = self._failed, []
            for slot in failed:
                self._submit(slot)


_LEAKED: list[BulkStream] = []

"""Linux's usbfs in Python, under umockdev: unmodified libusb and pyusb talk to a device model.

Run under ``umockdev-wrapper``.  The preload library forwards every ioctl on the device node to a Unix socket as three
u64 (1, request, pointer); the answers are 5 (read client memory), 6 (write it) and 3 (done: result, errno).
"""

import ctypes
import errno
import os
import socket
import struct
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any, Protocol

_MESSAGE = struct.Struct("<QQQ")
_URB = struct.Struct("<BBxxiIxxxxQiiiiiIQ")  # struct usbdevfs_urb, 64 bit
_REQ_IOCTL, _DONE, _READ, _WRITE = 1, 3, 5, 6
(_RESETEP, _SETINTERFACE, _SETCONFIGURATION, _GETDRIVER, _SUBMIT, _DISCARD, _REAP, _REAP_NOW, _CLAIM, _RELEASE) = (
    *(3, 4, 5, 8, 10, 11, 12, 13, 15, 16),
)
_CLEAR_HALT, _CAPABILITIES = 21, 26
_SHUTDOWN, _CANCELLED, _PIPE = -errno.ESHUTDOWN, -errno.ENOENT, -errno.EPIPE


class Stall(Exception):
    """The endpoint refuses."""


class DeviceModel(Protocol):
    """What is behind the endpoints."""

    descriptors: bytes

    def control(self, request_type: int, request: int, value: int, index: int, data: bytes, length: int) -> bytes:
        """Take a control request; return what an IN one reads.  Stall refuses it."""

    def bulk_in(self, size: int) -> bytes | None:
        """Return up to ``size`` bytes, None while there are none.  Stall halts the endpoint."""

    def clear_halt(self) -> None:
        """End the halt."""


def descriptors(vendor: int, product: int, endpoint: int = 0x86) -> bytes:
    """Return device, configuration, interface and endpoint descriptors of a vendor-specific device."""
    device = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x200, 0xFF, 0, 0, 64, vendor, product, 0x210, 0, 0, 0, 1)
    end = struct.pack("<BBBBHB", 7, 5, endpoint, 2, 512, 0)
    interface = struct.pack("<BBBBBBBBB", 9, 4, 0, 0, 1, 0xFF, 0, 0, 0)
    configuration = struct.pack("<BBHBBBBB", 9, 2, 9 + len(interface) + len(end), 1, 1, 0, 0x80, 50)
    return device + configuration + interface + end


class Testbed:
    """A /sys and /dev of our own, seen by this process alone."""

    def __init__(self) -> None:
        self._lib = ctypes.CDLL("libumockdev.so.0")
        for name in ("umockdev_testbed_new", "umockdev_testbed_get_root_dir"):
            getattr(self._lib, name).restype = ctypes.c_void_p
        self._bed = ctypes.c_void_p(self._lib.umockdev_testbed_new())
        self.root = Path(ctypes.string_at(self._lib.umockdev_testbed_get_root_dir(self._bed)).decode())
        self._plugged: dict[int, Plugged] = {}

    def plug(self, model: DeviceModel, number: int) -> "Plugged":
        """Put a device on bus 1 under ``number``."""
        plugged = Plugged(self.root, model, number)
        text = (
            f"P: /devices/emulated/1-{number}\nN: bus/usb/001/{number:03d}\n"
            f"E: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DEVNAME=bus/usb/001/{number:03d}\n"
            f"E: BUSNUM=001\nE: DEVNUM={number:03d}\n"
            f"A: busnum=1\\n\nA: devnum={number}\\n\nA: bConfigurationValue=1\\n\nA: speed=480\\n\n"
            f"H: descriptors={model.descriptors.hex().upper()}\n"
        )
        failure = ctypes.c_void_p()
        added = self._lib.umockdev_testbed_add_from_string(self._bed, text.encode(), ctypes.byref(failure))
        assert added, text
        self._plugged[number] = plugged
        self._event(number, b"add")
        return plugged

    def unplug(self, number: int) -> None:
        """Pull the device out, in whatever it is doing."""
        self._plugged.pop(number).gone.set()
        self._event(number, b"remove")
        self._lib.umockdev_testbed_remove_device(self._bed, f"/sys/devices/emulated/1-{number}".encode())

    def _event(self, number: int, action: bytes) -> None:
        path = f"/sys/devices/emulated/1-{number}".encode()
        self._lib.umockdev_testbed_uevent(self._bed, path, action)


class Plugged:
    """One device's node: answers the ioctls of whoever opens it."""

    def __init__(self, root: Path, model: DeviceModel, number: int) -> None:
        self.model = model
        self.gone = threading.Event()
        self.claimed = 0
        path = root / "ioctl" / "dev" / "bus" / "usb" / "001" / f"{number:03d}"
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            path.unlink()
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(os.fspath(path))
        self._listener.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            link, _ = self._listener.accept()
            threading.Thread(target=self._serve, args=(link,), daemon=True).start()

    def _serve(self, link: socket.socket) -> None:
        session = _Session(self, link)
        while True:
            message = _received(link, _MESSAGE.size)
            if not message:
                self.claimed -= session.claimed  # as the kernel does for a process that ended
                return
            kind, request, pointer = _MESSAGE.unpack(message)
            result, error = 0, 0
            if kind == _REQ_IOCTL and request >> 8 & 0xFF == ord("U"):
                try:
                    result = session.ioctl(request & 0xFF, pointer)
                except OSError as problem:
                    result, error = -1, problem.errno or errno.EIO
            else:
                result, error = -1, errno.ENOTTY
            link.sendall(_MESSAGE.pack(_DONE, result & (1 << 64) - 1, error))


class _Session:
    """One opening of the node, and the URBs queued through it."""

    def __init__(self, plugged: Plugged, link: socket.socket) -> None:
        self._plugged, self._link = plugged, link
        self.claimed = 0
        self._pending: deque[tuple[int, Any]] = deque()
        self._done: deque[tuple[int, Any, int, bytes]] = deque()

    def ioctl(self, number: int, pointer: int) -> int:
        if number in (_REAP, _REAP_NOW):
            return self._reap(pointer)
        if self._plugged.gone.is_set():
            raise OSError(errno.ENODEV, "gone")
        if number == _CAPABILITIES:
            self._write(pointer, struct.pack("<I", 0x01 | 0x04 | 0x08 | 0x10))
        elif number == _CLAIM:
            if self._plugged.claimed:
                raise OSError(errno.EBUSY, "claimed")
            self._plugged.claimed += 1
            self.claimed += 1
        elif number == _RELEASE:
            self._plugged.claimed -= 1
            self.claimed -= 1
        elif number == _GETDRIVER:
            raise OSError(errno.ENODATA, "no driver")
        elif number == _SUBMIT:
            self._submit(pointer)
        elif number == _DISCARD:
            self._discard(pointer)
        elif number == _CLEAR_HALT:
            self._plugged.model.clear_halt()
        elif number not in (_SETINTERFACE, _SETCONFIGURATION, _RESETEP):
            raise OSError(errno.ENOTTY, "not emulated")
        return 0

    def _submit(self, pointer: int) -> None:
        urb = _URB.unpack(self._read(pointer, _URB.size))
        kind, endpoint, _, _, buffer, length, *_ = urb
        if kind == 2:
            setup = self._read(buffer, 8)
            request_type, request, value, index, wanted = struct.unpack("<BBHHH", setup)
            is_in = bool(request_type & 0x80)
            data = b"" if is_in else self._read(buffer + 8, wanted)
            try:
                answer = self._plugged.model.control(request_type, request, value, index, data, wanted)
            except Stall:
                self._done.append((pointer, urb, _PIPE, b""))
                return
            self._done.append((pointer, urb, 0, answer if is_in else bytes(wanted)))
        else:
            assert kind == 3 and endpoint & 0x80, "only bulk IN is emulated"
            self._pending.append((pointer, urb))
        del length

    def _discard(self, pointer: int) -> None:
        for item in self._pending:
            if item[0] == pointer:
                self._pending.remove(item)
                self._done.append((*item, _CANCELLED, b""))
                return
        raise OSError(errno.EINVAL, "not queued")

    def _reap(self, pointer: int) -> int:
        end = time.monotonic() + 0.002  # the node always polls ready: without a pause libusb would spin
        while True:
            if self._plugged.gone.is_set() and self._pending:
                self._done.extend((*item, _SHUTDOWN, b"") for item in self._pending)
                self._pending.clear()
            elif self._pending and not self._done:
                self._progress()
            if self._done:
                address, urb, status, data = self._done.popleft()
                return self._complete(pointer, address, urb, status, data)
            if self._plugged.gone.is_set():
                raise OSError(errno.ENODEV, "gone")
            if time.monotonic() > end:
                raise OSError(errno.EAGAIN, "nothing yet")
            time.sleep(0.0005)

    def _progress(self) -> None:
        address, urb = self._pending[0]
        try:
            data = self._plugged.model.bulk_in(urb[5])
        except Stall:
            self._pending.popleft()
            self._done.append((address, urb, _PIPE, b""))
            return
        if data is not None:
            self._pending.popleft()
            self._done.append((address, urb, 0, data))

    def _complete(self, pointer: int, address: int, urb: Any, status: int, data: bytes) -> int:
        kind, endpoint, _, flags, buffer, length, _, start, packets, errors, signal, context = urb
        if endpoint & 0x80 and data:
            self._write(buffer + (8 if kind == 2 else 0), data)
        finished = (kind, endpoint, status, flags, buffer, length, len(data), start, packets, errors, signal, context)
        self._write(address, _URB.pack(*finished))
        self._write(pointer, struct.pack("<Q", address))
        return 0

    def _read(self, address: int, size: int) -> bytes:
        if not size:
            return b""
        self._link.sendall(_MESSAGE.pack(_READ, address, size))
        return _received(self._link, size)

    def _write(self, address: int, data: bytes) -> None:
        self._link.sendall(_MESSAGE.pack(_WRITE, address, len(data)))
        self._link.sendall(data)


def _received(link: socket.socket, size: int) -> bytes:
    parts = bytearray()
    while len(parts) < size:
        part = link.recv(size - len(parts))
        if not part:
            return b""
        parts += part
    return bytes(parts)

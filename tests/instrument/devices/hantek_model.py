"""A model of a Hantek 6022 for usbfs: it takes firmware, then streams packets that contain their own number."""

import threading
import time
from collections.abc import Callable

import numpy as np

from tests.instrument.devices.usbfs_emulator import Stall, descriptors

PACKET = 512


def packet_numbers(counts: np.ndarray) -> np.ndarray:
    """Return the numbers that whole packets carry, from counts of shape (n, 2) that begin at a packet."""
    codes = (counts[: counts.shape[0] // 256 * 256].reshape(-1, PACKET) + 128).astype(np.int64)
    return codes[:, 0] | codes[:, 1] << 8 | codes[:, 2] << 16


class ColdHantek:
    """Takes a RAM image; ``on_run`` is called when its processor is let run."""

    def __init__(self, on_run: Callable[[], None]) -> None:
        self.descriptors = descriptors(0x04B4, 0x6022)
        self.ram = bytearray(0x4000)
        self.held = False
        self._on_run = on_run

    def control(self, request_type: int, request: int, value: int, index: int, data: bytes, length: int) -> bytes:
        if (request_type, request, index) != (0x40, 0xA0, 0):
            raise Stall
        if value == 0xE600:
            if self.held and data == b"\x00":
                threading.Timer(0.05, self._on_run).start()
            self.held = data == b"\x01"
        elif self.held:
            self.ram[value : value + len(data)] = data
        else:
            raise Stall
        return b""

    def bulk_in(self, size: int) -> bytes | None:
        return None

    def clear_halt(self) -> None:
        pass


class WarmHantek:
    """Streams at the rate it was told, by the clock."""

    def __init__(self, product: int = 0x6022) -> None:
        self.descriptors = descriptors(0x04B5, product)
        self.told: list[tuple[int, int]] = []
        self.running = False
        self.bytes_per_s = 0.0
        self.stalls: list[int] = []  # byte counts at which the endpoint halts
        self.silent_from: int | None = None
        self.sent = 0
        self.skip_at: int | None = None  # the byte count at which the device drops packets
        self.skipped = 0
        self.hangs_at: int | None = None  # the number of the control request that is never answered, from 1 on
        self.hung_s: float | None = None  # since when
        self._requests = 0
        self._halted = False
        self._started = 0.0
        self._numbers = 0

    def control(self, request_type: int, request: int, value: int, index: int, data: bytes, length: int) -> bytes:
        self._requests += 1
        if self._requests == self.hangs_at:
            self.hung_s = time.monotonic()
            threading.Event().wait()
        if request_type == 0xC0 and request == 0xA2:
            return (bytes(8) + bytes([0x80] * 32) + bytes([0xFF] * 48))[value : value + length]
        if request_type != 0x40 or not 0xE0 <= request <= 0xE6:
            raise Stall
        self.told.append((request, data[0]))
        self.running = False  # any vendor request stops sampling
        if request == 0xE2:
            self.bytes_per_s = 2e6 * data[0] if data[0] < 100 else 2e4 * (data[0] - 100)
        if (request, data[0]) == (0xE3, 1):
            self.running = True
            self.sent = self._numbers = 0
            self._started = time.monotonic()
        return b""

    def clear_halt(self) -> None:
        self._halted = False

    def bulk_in(self, size: int) -> bytes | None:
        if self._halted:
            raise Stall
        if not self.running or (self.silent_from is not None and self.sent >= self.silent_from):
            return None
        if self.stalls and self.sent >= self.stalls[0]:
            self.stalls.pop(0)
            self._halted = True
            raise Stall
        if self.sent + size > self.bytes_per_s * (time.monotonic() - self._started):
            return None
        if self.skip_at is not None and self.sent >= self.skip_at:
            self.skip_at = None
            self._numbers += self.skipped // PACKET
            self._started += self.skipped / self.bytes_per_s
        packets = np.full((size // PACKET, PACKET), 100, np.uint8)
        numbers = self._numbers + np.arange(packets.shape[0])
        for byte in range(3):
            packets[:, byte] = numbers >> 8 * byte & 255
        self._numbers += packets.shape[0]
        self.sent += size
        return packets.tobytes()

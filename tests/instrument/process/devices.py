"""Digitizers that a subprocess can open by name, and that fail in a known way."""

import os
import signal
import time
from pathlib import Path

import numpy as np

from instrument.devices.digitizer import Block, CaptureSettings, DigitizerError
from tests.instrument.fake_digitizer import RATE_HZ, FakeDigitizer, samples


def refused() -> FakeDigitizer:
    """Refuse like a device that is not there."""
    raise DigitizerError("no such device is plugged in", "plug it in")


def broken() -> FakeDigitizer:
    """Fail like a driver with a bug."""
    raise ZeroDivisionError("a bug")


class Leaky(FakeDigitizer):
    """Streams by a clock that runs at ``SPEED`` and holds ``memory_s``: what is not fetched is lost, and said."""

    SPEED = 0.25  # so that a busy machine is no reason to lose anything

    def __init__(self, memory_s: float) -> None:
        super().__init__()
        self._memory = int(memory_s * RATE_HZ)
        self._begun_s = 0.0

    def arm(self, settings: CaptureSettings) -> None:
        super().arm(settings)
        self._begun_s = time.monotonic()
        self.at = 0

    def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
        if not self.running.is_set():
            return Block(0, ended=True)
        waiting = self._waiting()
        if waiting < len(buffer):
            time.sleep(0.01)
            waiting = self._waiting()
        lost = max(0, waiting - self._memory)
        self.at += lost
        length = min(waiting - lost, len(buffer))
        buffer[:length] = samples(self.at, length)
        self.at += length
        return Block(length, lost)

    def _waiting(self) -> int:
        return int(self.SPEED * (time.monotonic() - self._begun_s) * RATE_HZ) - self.at


class Unplugged(FakeDigitizer):
    """Is pulled in its second block, works again at the next arming; its first arming is refused."""

    def arm(self, settings: CaptureSettings) -> None:
        if self.armed == 0:
            self.armed = 1
            raise DigitizerError("the device is busy", "wait")
        super().arm(settings)

    def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
        if self.armed == 2 and self.at >= 5_000:
            raise DigitizerError("the digitizer was unplugged", "plug it in, then arm again")
        return super().read_into(buffer, timeout_s)


class Deaf(FakeDigitizer):
    """Hangs in a read, deaf to everything but ``stop`` where ``hears`` is true."""

    def __init__(self, hears: bool) -> None:
        super().__init__()
        self._hears = hears

    def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
        while not self._hears or self.running.is_set():
            time.sleep(0.01)
        return Block(0, ended=True)


class Crashing(FakeDigitizer):
    """Takes its process with it, as a C library may, at its first arming on this ``mark``."""

    def __init__(self, mark: Path) -> None:
        super().__init__()
        self._mark = mark

    def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
        if not self._mark.exists():
            self._mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().read_into(buffer, timeout_s)


def slow_to_prepare() -> FakeDigitizer:
    """Return a digitizer whose preparation takes half a minute."""
    digitizer = FakeDigitizer()
    digitizer.prepare = lambda: time.sleep(30.0)  # type: ignore[method-assign]
    return digitizer


def slow_to_arm() -> FakeDigitizer:
    """Return a digitizer whose arming takes half a minute."""
    digitizer = FakeDigitizer()
    digitizer.arm = lambda settings: time.sleep(30.0)  # type: ignore[method-assign]
    return digitizer

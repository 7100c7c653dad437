"""A digitizer whose samples are all known, and that fails in every way that a test needs."""

import threading
import time
from collections.abc import Callable

import numpy as np

from analysis.shot.recording import Channel, Role, Setup
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError

RATE_HZ = 1e6
REST_HZ = 91_000.0
PERIOD = 60_000  # samples from one step of the light switch to the next rising one
HIGH = 20_000  # of them with the block in the beam
FIRST = 30_000
CHANNELS = (Channel(Role.REFERENCE, 1e-3), Channel(Role.MEASUREMENT, 1e-3), Channel(Role.SWITCH, 1e-3))


def samples(first: int, length: int) -> np.ndarray:
    """Return what the fake measures at its samples ``first`` ...: two beats, and the switch."""
    n = np.arange(first, first + length)
    counts = np.empty((length, 3), np.int16)
    counts[:, 0] = np.rint(1500 * np.sin(2 * np.pi * REST_HZ / RATE_HZ * n))
    counts[:, 1] = np.rint(1500 * np.sin(2 * np.pi * REST_HZ / RATE_HZ * n + 0.3))
    counts[:, 1] += ((n * 2654435761 >> 16) % 7).astype(np.int16)  # so that no two stretches are alike
    counts[:, 2] = np.where((n - FIRST) % PERIOD < HIGH, 1600, 100) * (n >= FIRST) + 100 * (n < FIRST)
    return counts


class FakeDigitizer(Digitizer):
    """Streams ``samples`` without end, as fast as it is read; ``before_block`` may do or raise anything."""

    def __init__(
        self,
        *,
        before_block: Callable[["FakeDigitizer", int], Block | None] | None = None,
        gaps: dict[int, int | None] | None = None,
        channels: tuple[Channel, ...] = CHANNELS,
        max_samples: int | None = None,
        hardware_trigger: bool = False,
        pace_s: float = 0.0,
        simulated: bool = False,
        real_time: bool = False,
    ) -> None:
        self.before_block = before_block
        self.gaps = gaps or {}  # at this sample, so many are lost
        self._channels = channels
        self._max = max_samples
        self._hardware = hardware_trigger
        self._pace_s = pace_s
        self._simulated = simulated
        self._real_time = real_time
        self.at = 0
        self.armed = 0
        self.closed = False
        self.running = threading.Event()
        self._settings: CaptureSettings | None = None
        self._sent = 0

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(
            "fake",
            self._channels,
            12,
            (RATE_HZ,),
            self._max,
            self._hardware,
            self._real_time,
            simulated=self._simulated,
        )

    @property
    def setup(self) -> Setup:
        return Setup(0.01785, digitizer_bits=12)

    def arm(self, settings: CaptureSettings) -> None:
        if settings.sample_rate_hz != RATE_HZ:
            raise DigitizerError("the fake knows one rate", "choose 1 MS/s")
        self.armed += 1
        self._settings = settings
        self._sent = 0
        self.running.set()

    def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
        if self.before_block is not None:
            instead = self.before_block(self, self.at)
            if instead is not None:
                return instead
        if not self.running.is_set():
            return Block(0, ended=True)
        time.sleep(self._pace_s or 0.0002)
        length = min(len(buffer), 5_000)
        lost: int | None = 0
        if self.at in self.gaps:
            lost = self.gaps.pop(self.at)
            self.at += lost or 1_234
        length = min([length, *(g - self.at for g in self.gaps if g > self.at)])
        if self._max is not None:
            length = min(length, self._max - self._sent)
        buffer[:length] = samples(self.at, length)[:, : len(self._channels)]
        self.at += length
        self._sent += length
        return Block(length, lost, ended=self._sent == self._max)

    def stop(self) -> None:
        self.running.clear()

    def close(self) -> None:
        self.stop()
        self.closed = True

"""What the displacement record carries beside the motion: four kinds of noise."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from instrument.bench.sines import Sines

Floats = NDArray[np.float64]


class NoiseKind(StrEnum):
    """How the noise of a displacement record is coloured."""

    WHITE = "white"  # the optics alone
    LOW_PASSED = "low_passed"  # the same after a 10 kHz filter
    DRIFTING = "drifting"  # white and a random walk
    FLOOR = "floor"  # white and the building


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of a displacement record; ``white_m`` is the standard deviation of one sample."""

    kind: NoiseKind = NoiseKind.WHITE
    white_m: float = 1e-10
    cut_hz: float = 10e3
    walk_share: float = 0.05  # of white_m, each sample's step
    floor_m: float = 3e-10

    def draw(self, samples: int, rate_hz: float, random: np.random.Generator) -> Floats:
        """Return ``samples`` of noise in m at ``rate_hz``."""
        white: Floats = self.white_m * random.standard_normal(samples + 1000)
        if self.kind is NoiseKind.LOW_PASSED:
            from scipy.signal import butter, sosfilt  # with all of scipy.stats: not at every start

            white = sosfilt(butter(4, self.cut_hz, fs=rate_hz, output="sos"), white)
        white = white[1000:]  # without the filter's beginning
        if self.kind is NoiseKind.DRIFTING:
            white = white + np.cumsum(self.walk_share * self.white_m * random.standard_normal(samples))
        if self.kind is NoiseKind.FLOOR:
            white = white + Floor(self.floor_m, int(random.integers(2**31))).at(0.0, 1.0 / rate_hz, samples)[0]
        return white


LINES = 64
LOWEST_HZ, HIGHEST_HZ = 4.0, 800.0


class Floor:
    """Many lines, closer together the lower they are, so that the spectrum falls as 1/f; any time can be asked for."""

    def __init__(self, rms_m: float, seed: int) -> None:
        """Get ready ``rms_m`` (m, whole band) of vibration; the same seed gives the same floor."""
        random = np.random.default_rng((seed, 0xF1))
        edges = np.geomspace(LOWEST_HZ, HIGHEST_HZ, LINES + 1)
        frequency_hz = random.uniform(edges[:-1], edges[1:])
        amplitude = random.rayleigh(1.0, LINES) / frequency_hz**0.5
        amplitude *= rms_m / np.sqrt(np.sum(amplitude**2) / 2)
        self._sines = Sines(2 * np.pi * frequency_hz, amplitude, random.uniform(0, 2 * np.pi, LINES))

    def at(self, start_s: float, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ``n`` times of equal spacing."""
        return self._sines.at(start_s, spacing_s, n)

"""What the displacement record carries beside the motion: four kinds of noise."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from instrument.bench.floor import Floor

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

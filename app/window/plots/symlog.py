"""A symmetric logarithmic scale: linear about zero, logarithmic beyond, so that 1 nm and 1 µm stand on one axis."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LEAST_DECADES = 0.7  # beyond the linear part


@dataclass(frozen=True, slots=True)
class SymLog:
    """Maps values to -1 ... 1; ``linear`` is where the linear part ends, ``most`` the largest value shown."""

    linear: float
    most: float

    def place(self, values: Floats) -> Floats:
        """Return where values stand, from -1 (the least) to 1 (the largest); NaN stays, what lies beyond is cut."""
        top = math.log10(1.0 + self.most / self.linear)
        with np.errstate(invalid="ignore"):
            at = np.sign(values) * np.log10(1.0 + np.abs(values) / self.linear) / top
            return np.clip(at, -1.0, 1.0)

    def ticks(self) -> list[float]:
        """Return zero and the decades that have room, both signs."""
        first = math.ceil(math.log10(self.linear) - 1e-9)
        last = math.floor(math.log10(self.most) + 1e-9)
        step = max(1, math.ceil((last - first + 1) / 3))
        decades = [10.0**power for power in range(last, first - 1, -step)]
        return [-value for value in decades] + [0.0] + decades[::-1]


def scale_of(curves: Sequence[Floats], noise: float) -> SymLog:
    """Return one scale for all curves: linear as far as the noise reaches."""
    sizes = [float(np.nanmax(np.abs(curve))) for curve in curves if curve.size and np.isfinite(curve).any()]
    linear = noise if math.isfinite(noise) and noise > 0.0 else max(sizes, default=1.0) / 100.0 or 1.0
    return SymLog(linear, max([*sizes, linear * 10.0**LEAST_DECADES]))

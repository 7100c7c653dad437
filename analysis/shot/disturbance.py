"""What moved the measured path beside the block: lines, a floor, knocks; and what they cost each number."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from analysis.shot.quantity import Quantity

Floats = NDArray[np.float64]

_NOTHING: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class VibrationLine:
    """A steady sine in the measured path, ``amplitude sin(2 pi f t + phase)``; t counts from the first sample."""

    frequency_hz: Quantity
    amplitude_m: Quantity
    phase_rad: float


@dataclass(frozen=True, slots=True)
class Shaking:
    """What moves the frame as sines that stand for its spectrum: ascending frequencies, shape (f,).

    ``power_m2`` is the variance of each one's cosine, and of its sine.  ``random`` says which stand for what shakes at
    random; the others are lines.
    """

    frequency_hz: Floats
    power_m2: Floats
    random: NDArray[np.bool_]

    def density_m2_per_hz(self, frequency_hz: float) -> float:
        """Return the density of what shakes at random; beyond its end it falls as a building's does, with f^4."""
        return float(self.densities_m2_per_hz(np.array([frequency_hz]))[0])

    def densities_m2_per_hz(self, frequency_hz: Floats) -> Floats:
        """Return the densities at several frequencies, shape (k,)."""
        known, power = self.frequency_hz[self.random], self.power_m2[self.random]
        if known.size < 2:
            return np.zeros(frequency_hz.shape)
        density = np.interp(frequency_hz, known, power / np.gradient(known))
        return np.asarray(density * np.minimum(1.0, known[-1] / frequency_hz) ** 4)

    def with_lines(self, lines: Sequence["VibrationLine"]) -> "Shaking":
        """Return it with lines: each as two sines as far apart as its frequency is unsure."""
        apart = np.array([line.frequency_hz.std for line in lines])
        middle = np.array([line.frequency_hz.value for line in lines])
        power = np.array([0.5 * line.amplitude_m.value**2 for line in lines])
        two = np.concatenate([middle - apart, middle + apart])
        return self._with(Shaking(two, np.concatenate([power, power]), np.zeros(two.size, dtype=np.bool_)))

    def _with(self, other: "Shaking") -> "Shaking":
        """Return both together."""
        frequency = np.concatenate([self.frequency_hz, other.frequency_hz])
        order = np.argsort(frequency, kind="stable")
        power = np.concatenate([self.power_m2, other.power_m2])
        return Shaking(frequency[order], power[order], np.concatenate([self.random, other.random])[order])

    @property
    def rms_m(self) -> float:
        """Get the rms of all of it."""
        return float(np.sqrt(self.power_m2.sum()))

    def less(self, density: Callable[[Floats], Floats]) -> "Shaking":
        """Return what shakes beside a noise of one-sided ``density`` in m^2/Hz, which it was learnt together with."""
        power = self.power_m2.copy()
        known = self.frequency_hz[self.random]
        if known.size > 1:
            power[self.random] = np.maximum(power[self.random] - density(known) * np.gradient(known), 0.0)
        return Shaking(self.frequency_hz, power, self.random)

    def closer(self, apart_hz: float) -> "Shaking":
        """Return it with the same density by sines no further apart than that.

        Sines come back together after 1 / their distance: over a longer stretch than that they are no spectrum.
        """
        known = self.frequency_hz[self.random]
        if known.size < 2 or np.diff(known).max() <= apart_hz:
            return self
        parts = np.maximum(np.ceil(np.diff(known) / apart_hz), 1).astype(np.int64)
        place = np.arange(known.size)
        within = np.concatenate([k + np.arange(count) / count for k, count in enumerate(parts)] + [place[-1:]])
        fine = np.interp(within, place, known)
        density = np.interp(fine, known, self.power_m2[self.random] / np.gradient(known))
        floor = Shaking(fine, density * np.gradient(fine), np.ones(fine.size, dtype=np.bool_))
        return floor._with(self.below(0.0))

    def below(self, frequency_hz: float) -> "Shaking":
        """Return what shakes more slowly than that, and all lines."""
        slow = (self.frequency_hz < frequency_hz) | ~self.random
        return Shaking(self.frequency_hz[slow], self.power_m2[slow], self.random[slow])


@dataclass(frozen=True, slots=True)
class Disturbance:
    """The disturbance that the free flights show.

    ``lines`` were taken off the motion before it was read.  ``floor_rms_m`` is what shakes at random beside them, which
    cannot be taken off and stands in the uncertainties; ``floor_rms_m_per_s`` is its velocity.  ``knocks_s`` are the
    (begin, end) of stretches left out because something rang in them.  ``shares`` says for each number of an Impact
    which part of its variance, 0 to 1, comes from all this and would be gone on a quiet table.  ``shaking`` is lines
    and floor together, as fits take them into account.
    """

    lines: tuple[VibrationLine, ...]
    floor_rms_m: float
    floor_rms_m_per_s: float
    knocks_s: tuple[tuple[float, float], ...] = ()
    shares: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    shaking: Shaking | None = None

    @property
    def lines_rms_m(self) -> float:
        """Get the rms of all lines together in m."""
        return float(sum(0.5 * line.amplitude_m.value**2 for line in self.lines) ** 0.5)

    @property
    def rms_m(self) -> float:
        """Get the rms of lines and floor together in m."""
        return float((self.lines_rms_m**2 + self.floor_rms_m**2) ** 0.5)

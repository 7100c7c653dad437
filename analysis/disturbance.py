"""What moved the measured path beside the block: lines, a floor, knocks; and what they cost each number."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from analysis.quantity import Quantity

_NOTHING: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class VibrationLine:
    """A steady sine in the measured path, ``amplitude sin(2 pi f t + phase)``; t counts from the first sample."""

    frequency_hz: Quantity
    amplitude_m: Quantity
    phase_rad: float


@dataclass(frozen=True, slots=True)
class Disturbance:
    """The disturbance that the free flights show.

    ``lines`` were taken off the motion before it was read.  ``floor_rms_m`` is what shakes at random beside them, which
    cannot be taken off and stands in the uncertainties; ``floor_rms_m_per_s`` is its velocity.  ``knocks_s`` are the
    (begin, end) of stretches left out because something rang in them.  ``shares`` says for each number of an Impact
    which part of its variance, 0 to 1, comes from all this and would be gone on a quiet table.
    """

    lines: tuple[VibrationLine, ...]
    floor_rms_m: float
    floor_rms_m_per_s: float
    knocks_s: tuple[tuple[float, float], ...] = ()
    shares: Mapping[str, float] = field(default_factory=lambda: _NOTHING)

    @property
    def lines_rms_m(self) -> float:
        """Get the rms of all lines together in m."""
        return float(sum(0.5 * line.amplitude_m.value**2 for line in self.lines) ** 0.5)

    @property
    def rms_m(self) -> float:
        """Get the rms of lines and floor together in m."""
        return float((self.lines_rms_m**2 + self.floor_rms_m**2) ** 0.5)

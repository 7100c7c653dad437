"""The numbers of one collision, read from the motion without a model (docs/physics.md, "the numbers of a shot").

The module also holds the disturbance of the measured path: steady lines, random floor vibration, and knocks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Floats
from analysis.shot.quantity import NotSeen, Quantity, Reading

_NOTHING: Mapping[str, float] = MappingProxyType({})
_NOT_READ = NotSeen("not read")


@dataclass(frozen=True, slots=True)
class VibrationLine:
    """A steady sine in the measured path, ``amplitude sin(2 pi f t + phase)``; t counts from the first sample."""

    frequency_hz: Quantity
    amplitude_m: Quantity
    phase_rad: float


@dataclass(frozen=True, slots=True)
class VibrationSpectrum:
    """The vibration of the frame as sines that represent its spectrum: ascending frequencies, shape (f,).

    ``power_m2`` is the variance of the cosine amplitude, and equally of the sine amplitude, at each frequency.
    ``random`` is True for components of random vibration and False for lines.
    """

    frequency_hz: Floats
    power_m2: Floats
    random: NDArray[np.bool_]

    def density_m2_per_hz(self, frequency_hz: float) -> float:
        """Return the random part's density at a frequency; above its last frequency it falls as f^-4 (buildings)."""
        return float(self.densities_m2_per_hz(np.array([frequency_hz]))[0])

    def densities_m2_per_hz(self, frequency_hz: Floats) -> Floats:
        """Return ``density_m2_per_hz`` at several frequencies, shape (k,)."""
        known, power = self.frequency_hz[self.random], self.power_m2[self.random]
        if known.size < 2:
            return np.zeros(frequency_hz.shape)
        density = np.interp(frequency_hz, known, power / np.gradient(known))
        return np.asarray(density * np.minimum(1.0, known[-1] / frequency_hz) ** 4)

    def with_lines(self, lines: Sequence["VibrationLine"]) -> "VibrationSpectrum":
        """Return the vibration with lines added, each as two sines at its frequency plus and minus its uncertainty."""
        apart = np.array([line.frequency_hz.std for line in lines])
        middle = np.array([line.frequency_hz.value for line in lines])
        power = np.array([0.5 * line.amplitude_m.value**2 for line in lines])
        frequency = np.concatenate([self.frequency_hz, middle - apart, middle + apart])
        order = np.argsort(frequency, kind="stable")
        power = np.concatenate([self.power_m2, power, power])
        random = np.pad(self.random, (0, 2 * len(lines)))
        return VibrationSpectrum(frequency[order], power[order], random[order])

    @property
    def rms_m(self) -> float:
        return float(np.sqrt(self.power_m2.sum()))

    def below(self, frequency_hz: float) -> "VibrationSpectrum":
        """Return the random part below a frequency, and all lines."""
        slow = (self.frequency_hz < frequency_hz) | ~self.random
        return VibrationSpectrum(self.frequency_hz[slow], self.power_m2[slow], self.random[slow])


@dataclass(frozen=True, slots=True)
class Disturbance:
    """The disturbance of the measured path, estimated from the free flights.

    ``lines`` were subtracted from the motion before it was read.  ``floor_rms_m`` is the rms random vibration, which
    cannot be subtracted and is part of the uncertainties; ``floor_rms_m_per_s`` is its rms velocity.  ``knocks_s`` are
    the (begin, end) of stretches excluded because of a knock.  ``shares`` gives the fraction (0 to 1) of each number's
    variance that comes from the disturbance.  ``vibration`` is lines and random vibration in the form used by fits.
    """

    lines: tuple[VibrationLine, ...]
    floor_rms_m: float
    floor_rms_m_per_s: float
    knocks_s: tuple[tuple[float, float], ...] = ()
    shares: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    vibration: VibrationSpectrum | None = None


@dataclass(frozen=True, slots=True)
class KineticCor:
    """The kinetic COR: T2 / T1 of the first bounces by three kinds of instants, and ``contact`` by the fitted model."""

    force_peaks: Reading = _NOT_READ
    onsets: Reading = _NOT_READ
    flights: Reading = _NOT_READ
    contact: Reading = _NOT_READ


@dataclass(frozen=True, slots=True)
class Impact:
    """The numbers of one collision, read from the motion; times count from the recording's first sample."""

    touch_time_s: Reading
    release_time_s: Reading
    turnaround_time_s: Reading
    velocity_in_m_per_s: Reading
    velocity_out_m_per_s: Reading
    cor_quasi_static: Reading
    cor_impulse: Reading
    cor_kinetic: KineticCor
    force_peak_n: Reading
    force_fwhm_s: Reading
    contact_time_s: Reading
    deflection_max_m: Reading
    stiffness_slope_n_per_m: Reading
    bounce_onsets_s: tuple[float, ...] = ()
    bounce_peaks_s: tuple[float, ...] = ()
    bounce_releases_s: tuple[float, ...] = ()
    flags: tuple[str, ...] = ()
    disturbance: Disturbance | None = None

"""The spectrum of the floor's motion read from flights, in octaves, and the rms floor motion within a given time."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from analysis.shot import Floats, Shaking

LOWEST = 0.35  # lowest octave centre, in units of one over the flights' whole span
SPACING = 0.45  # spacing of the frequencies that represent the floor, in the same unit
MOST_APART = 0.6  # its upper limit, in units of one over the time in flight
STILL_BELOW_HZ = 8.0  # frequency below which a building's velocity falls in proportion to frequency
END_SAMPLES = 33  # samples of a stretch to which a polynomial is fitted


@dataclass(frozen=True, slots=True)
class Octaves:
    """Frequencies (f,) in Hz that represent the floor, and their power (k, f) in m^2 for octaves of unit velocity."""

    frequency_hz: Floats
    power_m2: Floats
    centre_hz: Floats

    @classmethod
    def of(cls, time_s: Floats, bin_s: float) -> "Octaves":
        """Choose octaves and frequencies for bins of ``bin_s`` at ``time_s``."""
        return _octaves(float(np.ptp(time_s)) + bin_s, time_s.size * bin_s, bin_s)

    def density(self, power: Floats, frequency_hz: Floats) -> Floats:
        """Return the one-sided density in m^2/Hz of octaves with ``power`` (k,) in (m/s)^2."""
        frequency = np.asarray(frequency_hz, np.float64)
        hats = _hats(np.maximum(frequency, 1e-3 * self.centre_hz[0]), self.centre_hz)
        return np.asarray(power @ (hats * _density(frequency)))


@lru_cache(maxsize=8)
def _octaves(span_s: float, flown_s: float, bin_s: float) -> Octaves:
    top = 0.5 / bin_s
    centre = LOWEST / span_s * 2.0 ** np.arange(max(3, round(np.log2(top * span_s / LOWEST))))
    frequency = [0.1 / span_s]
    while frequency[-1] < top:
        frequency.append(frequency[-1] + min(max(SPACING / span_s, 0.03 * frequency[-1]), MOST_APART / flown_s))
    at = np.array(frequency)
    power = _hats(at, centre) * _density(at) * np.gradient(at)
    return Octaves(at, power, centre)


def _hats(frequency_hz: Floats, centre_hz: Floats) -> Floats:
    """Return the weight of each octave at each frequency: (k, f), linear in log frequency between centres."""
    place = np.clip(np.log2(frequency_hz / centre_hz[0]), 0.0, centre_hz.size - 1.0)
    return np.asarray(np.maximum(1.0 - np.abs(place - np.arange(centre_hz.size)[:, None]), 0.0))


def _density(frequency_hz: Floats) -> Floats:
    """Return the density in m^2/Hz of a floor with 1 m/s in every octave, and less below STILL_BELOW_HZ."""
    still = np.minimum(1.0, frequency_hz / STILL_BELOW_HZ) ** 2
    return np.asarray(still / (np.log(2.0) * frequency_hz * (2 * np.pi * frequency_hz) ** 2))


def waves_of(time_s: Floats, bin_samples: int, step_s: float, frequency_hz: Floats) -> tuple[Floats, Floats]:
    """Return cosines and sines, each (n, f), averaged over bins of ``bin_samples`` samples at ``time_s``."""
    turn = np.pi * frequency_hz * step_s
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.where(turn > 0, np.sin(bin_samples * turn) / (bin_samples * np.sin(turn)), 1.0)
    angle = 2 * np.pi * time_s[:, None] * frequency_hz[None, :]
    return gain * np.cos(angle), gain * np.sin(angle)


@dataclass(frozen=True, slots=True)
class FloorSpectrum:
    """The floor's spectrum: ``power`` (k,) of its octaves in (m/s)^2; ``white_std_m`` is one sample's white noise."""

    octaves: Octaves
    power: Floats
    white_std_m: float
    sample_rate_hz: float

    @property
    def _power(self) -> Floats:
        """Get the mean power at each frequency in m^2, (f,)."""
        return np.asarray(self.power @ self.octaves.power_m2)

    @property
    def shaking(self) -> Shaking:
        frequency = self.octaves.frequency_hz
        return Shaking(frequency, self._power, np.ones(frequency.size, dtype=np.bool_))

    @property
    def rms_m(self) -> float:
        """Get the floor's rms displacement in m, without the slowest part, which is confounded with the flights."""
        seen = self.octaves.frequency_hz > 2.0 * self.octaves.centre_hz[0]
        return float(np.sqrt(self._power[seen].sum()))

    def difference_std_m(self, lag_s: float, order: int = 1) -> float:
        """Return the std in m of the floor's difference of this order over a time ``lag_s``.

        Order 1 is the floor's displacement.  Order 2 is the error of extrapolating it one step by a straight line,
        order 3 that by a parabola.
        """
        half = np.pi * self.octaves.frequency_hz * lag_s
        return float(np.sqrt(self._power @ (2.0 * np.sin(half)) ** (2 * order)))

    def end_std_m(self, lasts_s: float, degree: int) -> float:
        """Return the std in m of the floor's end off a least-squares polynomial through a stretch of ``lasts_s``."""
        at = np.linspace(-1.0, 1.0, END_SAMPLES)
        powers = np.vander(at, degree + 1)
        off = np.eye(END_SAMPLES)[-1] - powers[-1] @ np.linalg.pinv(powers)
        seen = np.exp(1j * np.pi * lasts_s * self.octaves.frequency_hz[:, None] * at) @ off
        return float(np.sqrt(self._power @ np.abs(seen) ** 2))

    def psd(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided density of white noise and floor in m^2/Hz."""
        return np.asarray(2.0 * self.white_std_m**2 / self.sample_rate_hz + self._moving(frequency_hz))

    def velocity_std_m_per_s(self, at_s: Sequence[float], weights: Sequence[float], bandwidth_hz: float) -> float:
        """Return the std in m/s of a weighted sum of floor velocities at instants, correlated by slow motion."""
        f = np.geomspace(min(0.5, 0.01 * bandwidth_hz), bandwidth_hz, 400)
        seen = np.abs(np.exp(2j * np.pi * f[:, None] * np.asarray(at_s)) @ np.asarray(weights)) ** 2
        return float(np.sqrt(np.trapezoid((2 * np.pi * f) ** 2 * self._moving(f) * seen, f)))

    def _moving(self, frequency_hz: Floats) -> Floats:
        return self.octaves.density(self.power, np.maximum(frequency_hz, self.octaves.frequency_hz[0]))

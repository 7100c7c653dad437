"""The octaves in which the floor's spectrum is described, and the frequencies that represent them."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LOWEST = 0.35  # of the centres of the octaves, over the whole time that the flights span
SPACING = 0.45  # of the frequencies that represent the floor, over the same
MOST_APART = 0.6  # ... over the time in flight
STILL_BELOW_HZ = 8.0  # a building's velocity falls in proportion


@dataclass(frozen=True, slots=True)
class Octaves:
    """Frequencies (f,) in Hz that represent the floor, and the power there of octaves of unit velocity: (k, f), m^2."""

    frequency_hz: Floats
    power_m2: Floats
    centre_hz: Floats

    @classmethod
    def of(cls, time_s: Floats, bin_s: float) -> "Octaves":
        """Choose octaves and frequencies for bins of ``bin_s`` at ``time_s``."""
        span, flown = float(np.ptp(time_s)) + bin_s, time_s.size * bin_s
        return _octaves(span, flown, bin_s)

    @classmethod
    def over(cls, span_s: float, highest_hz: float) -> "Octaves":
        """Choose octaves and frequencies for a stretch without gaps, up to ``highest_hz``."""
        return _octaves(span_s, span_s, 0.5 / highest_hz)

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
    """Return each octave's share of frequencies: (k, f), linear in the logarithm between centres."""
    place = np.clip(np.log2(frequency_hz / centre_hz[0]), 0.0, centre_hz.size - 1.0)
    return np.asarray(np.maximum(1.0 - np.abs(place - np.arange(centre_hz.size)[:, None]), 0.0))


def _density(frequency_hz: Floats) -> Floats:
    """Return the density in m^2/Hz of a floor that moves with 1 m/s in every octave, and less in the slow ones."""
    still = np.minimum(1.0, frequency_hz / STILL_BELOW_HZ) ** 2
    return np.asarray(still / (np.log(2.0) * frequency_hz * (2 * np.pi * frequency_hz) ** 2))


def waves_of(time_s: Floats, bin_samples: int, step_s: float, frequency_hz: Floats) -> tuple[Floats, Floats]:
    """Return cosines and sines, each (n, f), averaged over bins of ``bin_samples`` samples at ``time_s``."""
    turn = np.pi * frequency_hz * step_s
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.where(turn > 0, np.sin(bin_samples * turn) / (bin_samples * np.sin(turn)), 1.0)
    angle = 2 * np.pi * time_s[:, None] * frequency_hz[None, :]
    return gain * np.cos(angle), gain * np.sin(angle)

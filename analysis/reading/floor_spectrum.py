"""The spectrum of the floor's motion as the flights show it, and how far the floor moves within a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.reading.octaves import Octaves
from analysis.shot import Shaking

Floats = NDArray[np.float64]

END_SAMPLES = 33  # of a stretch through which a polynomial is drawn


@dataclass(frozen=True, slots=True)
class FloorSpectrum:
    """A mixture of spectra: ``parts`` are (weight, powers of the octaves); ``white_std_m`` is that of one sample."""

    octaves: Octaves
    parts: tuple[tuple[float, Floats], ...]
    white_std_m: float
    sample_rate_hz: float

    @property
    def _power(self) -> Floats:
        """Get the mean power at each frequency in m^2, (f,)."""
        return np.asarray(sum(w * p for w, p in self.parts) @ self.octaves.power_m2)

    @property
    def shaking(self) -> Shaking:
        frequency = self.octaves.frequency_hz
        return Shaking(frequency, self._power, np.ones(frequency.size, dtype=np.bool_))

    @property
    def rms_m(self) -> float:
        """Get the floor's rms displacement in m, without the slowest, which looks like the flights' own motion."""
        seen = self.octaves.frequency_hz > 2.0 * self.octaves.centre_hz[0]
        return float(np.sqrt(self._power[seen].sum()))

    def difference_std_m(self, lag_s: float) -> float:
        """Return the std of how far the floor moves within a time."""
        half = np.pi * self.octaves.frequency_hz * lag_s
        return float(np.sqrt(self._power @ (4.0 * np.sin(half) ** 2)))

    def curve_std_m(self, lag_s: float) -> float:
        """Return the std of the floor's second difference: what a straight line through it misses one step beyond."""
        half = np.pi * self.octaves.frequency_hz * lag_s
        return float(np.sqrt(self._power @ (2.0 * np.sin(half)) ** 4))

    def end_std_m(self, lasts_s: float, degree: int) -> float:
        """Return the std of how far the floor ends off its own least-squares polynomial through so long a stretch."""
        at = np.linspace(-1.0, 1.0, END_SAMPLES)
        powers = np.vander(at, degree + 1)
        off = np.eye(END_SAMPLES)[-1] - powers[-1] @ np.linalg.pinv(powers)
        seen = np.exp(1j * np.pi * lasts_s * self.octaves.frequency_hz[:, None] * at) @ off
        return float(np.sqrt(self._power @ np.abs(seen) ** 2))

    def bend_std_m(self, lag_s: float) -> float:
        """Return the std of the floor's third difference: what a parabola through it misses one step beyond."""
        half = np.pi * self.octaves.frequency_hz * lag_s
        return float(np.sqrt(self._power @ (2.0 * np.sin(half)) ** 6))

    def psd(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided density of white noise and floor in m^2/Hz."""
        return np.asarray(self._white + self._moving(frequency_hz))

    def velocity_rms_m_per_s(self, bandwidth_hz: float) -> float:
        return self.velocity_std_m_per_s((0.0,), (1.0,), bandwidth_hz)

    def velocity_std_m_per_s(self, at_s: Sequence[float], weights: Sequence[float], bandwidth_hz: float) -> float:
        """Return the std of a weighted sum of the floor's velocities at instants, slow motion being common to them."""
        f = np.geomspace(min(0.5, 0.01 * bandwidth_hz), bandwidth_hz, 400)
        seen = np.abs(np.exp(2j * np.pi * f[:, None] * np.asarray(at_s)) @ np.asarray(weights)) ** 2
        return float(np.sqrt(np.trapezoid((2 * np.pi * f) ** 2 * self._moving(f) * seen, f)))

    def _moving(self, frequency_hz: Floats) -> Floats:
        power = np.asarray(sum(w * p for w, p in self.parts))
        return self.octaves.density(power, np.maximum(frequency_hz, self.octaves.frequency_hz[0]))

    @property
    def _white(self) -> float:
        return 2.0 * self.white_std_m**2 / self.sample_rate_hz

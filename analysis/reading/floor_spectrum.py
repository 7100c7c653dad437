"""The floor's motion under the rig: its spectrum in octaves, and their strengths estimated from flights.

The floor's density is free in each octave, from a third of a period per span of the flights up to the resolution of
their bins.  The strengths maximise the restricted likelihood under a prior: a building moves with about the same
velocity in each octave (Gordon, SPIE 1619, 1991), and neighbouring octaves differ by a factor of a few.  The slowest
octaves are poorly determined, so the result is a mixture over all likely strengths.

The vector of logarithms, shape (k + 2,), holds ln of the white noise variance (known), of the k octaves' powers and of
the power of the flights' drags, each relative to its prior expectation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import block_diag

from analysis.reading.restricted_likelihood import (
    Bands,
    Curvature,
    Likelihood,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
)
from analysis.shot import Floats, VibrationSpectrum

LOWEST = 0.35  # lowest octave centre, in units of one over the flights' whole span
SPACING = 0.45  # spacing of the frequencies that represent the floor, in the same unit
MAX_APART = 0.6  # its upper limit, in units of one over the time in flight
STILL_BELOW_HZ = 8.0  # frequency below which a building's velocity falls in proportion to frequency
END_SAMPLES = 33  # samples of a stretch to which a polynomial is fitted
SPEED_M_PER_S = 3e-6  # prior rms velocity in an octave: a good laboratory's
SPEED_SPREAD = 6.0  # its prior std, a factor of several hundred; spreads are stds of natural logarithms of powers
SLOW_SPREAD = 0.6  # prior std from one octave to the next among slow octaves
FAST_SPREAD = 3.0  # the same among fast octaves, where machines and the frame's modes dominate
DRAG_M_PER_S2 = 1e-3  # prior acceleration of a flight: a tilt of 0.1 mrad
DRAG_SPREAD = 2.0
_WHITE_SPREAD = 1e-6  # the white noise is known
_MIN_DRAG = 1e-4  # least std of a drag, as a fraction of the prior
_PAIRS = 10  # pairs of points of the mixture
_ROUNDING = 1e-11
_NOTHING = -50.0  # ln of a negligible power
_LEAST = 0.01  # weight above which a motionless floor is part of the mixture


@dataclass(frozen=True, slots=True)
class Octaves:
    """Frequencies (f,) in Hz that represent the floor, and their power (k, f) in m^2 for octaves of unit velocity."""

    frequency_hz: Floats
    power_m2: Floats
    centre_hz: Floats

    @classmethod
    def of(cls, time_s: Floats, bin_s: float) -> "Octaves":
        """Choose octaves and frequencies for bins of ``bin_s`` at ``time_s``."""
        span_s, flown_s, top = float(np.ptp(time_s)) + bin_s, time_s.size * bin_s, 0.5 / bin_s
        centre = LOWEST / span_s * 2.0 ** np.arange(max(3, round(np.log2(top * span_s / LOWEST))))
        frequency = [0.1 / span_s]
        while frequency[-1] < top:
            frequency.append(frequency[-1] + min(max(SPACING / span_s, 0.03 * frequency[-1]), MAX_APART / flown_s))
        at = np.array(frequency)
        return cls(at, _hats(at, centre) * _density(at) * np.gradient(at), centre)

    def density(self, power: Floats, frequency_hz: Floats) -> Floats:
        """Return the one-sided density in m^2/Hz of octaves with ``power`` (k,) in (m/s)^2."""
        frequency = np.asarray(frequency_hz, np.float64)
        hats = _hats(np.maximum(frequency, 1e-3 * self.centre_hz[0]), self.centre_hz)
        return np.asarray(power @ (hats * _density(frequency)))


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
    def vibration(self) -> VibrationSpectrum:
        frequency = self.octaves.frequency_hz
        return VibrationSpectrum(frequency, self._power, np.ones(frequency.size, dtype=np.bool_))

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


@dataclass(frozen=True, slots=True)
class FloorEstimate:
    """The floor's strengths estimated from flights: their likelihood, and its maximum."""

    likelihood: RestrictedLikelihood
    maximum: Likelihood

    @property
    def best(self) -> Floats:
        """Get the likeliest logarithms, shape (k + 2,)."""
        return self.maximum.at

    @property
    def worth(self) -> float:
        """Get log-likelihood plus log prior at the likeliest logarithms, coefficients profiled."""
        return self.maximum.profile

    def mixture(self) -> tuple[Floats, Floats]:
        """Return weights, shape (p,), and logarithms, shape (p, k + 2), of points that represent all likely ones.

        One of the points is a motionless floor, if that is likely enough.
        """
        likelihood, best = self.likelihood, self.maximum
        curve = likelihood.curvature(best)
        points = np.pad(points_about(best.at[1:], curve[1:, 1:], _PAIRS), ((0, 0), (1, 0)))
        weights = np.full(len(points), 1.0 / len(points))
        octaves = np.array([0.0, *np.full(best.at.size - 2, _NOTHING), 0.0])
        still = np.array([*octaves[:-1], best.at[-1]])
        left = likelihood.at(still).value + 0.5 * float(octaves @ likelihood.precision @ octaves)  # without the prior
        # log evidence ratio of a moving floor over a motionless one, strengths marginalised (Laplace)
        volume = np.linalg.slogdet(likelihood.precision)[1] - np.linalg.slogdet(curve)[1]
        times = best.value - left + 0.5 * float(volume)
        none = float(1.0 / (1.0 + np.exp(np.clip(times, -30.0, 30.0))))
        if none > _LEAST:
            weights, points = np.append(weights * (1.0 - none), none), np.vstack([points, still])
        return weights, points


@dataclass(frozen=True)
class FlightObservation:
    """The binned displacement of flights, (n,) in m, the white std of a bin, and the drag columns of a design.

    ``waves`` (n, 2 f) are cosines and sines of the octaves' frequencies, averaged over the bins.
    """

    value_m: Floats
    white_m: float
    drags: tuple[int, ...]
    octaves: Octaves
    waves: Floats

    @property
    def unknowns(self) -> int:
        """Get the number of logarithms."""
        return self.octaves.centre_hz.size + 2

    def powers(self, at: Floats) -> Floats:
        """Return the octaves' powers in (m/s)^2, shape (..., k), for vectors of shape (..., k + 2)."""
        return np.asarray(SPEED_M_PER_S**2 * np.exp(at[..., 1:-1]))

    def likelihood(self, design: Floats) -> RestrictedLikelihood:
        """Return the restricted likelihood of the logarithms with a design (n, p) whose coefficients are free.

        The design is in SI units.  Coefficients are in units of the white std, for columns scaled to a maximum of one.
        The prior of each drag is a row after the bins: a drag of zero, with the drags' strength as std.
        """
        bins, width = design.shape
        scale = _scale(design)
        along = self.padded(np.column_stack([self.value_m / self.white_m, design / scale]))
        for row, column in enumerate(self.drags, bins):
            least = 0.5 * _MIN_DRAG * DRAG_M_PER_S2 / self.white_m  # the coefficient is half the acceleration
            along[row, 1 + column] = 1.0 / (least * scale[column])
        rest = np.zeros((1 + width, 1 + width))
        shot = ShotResidual(along, rest, len(along), 0.0, np.arange(width), self.bands, _ROUNDING)
        return RestrictedLikelihood((shot,), _prior(self.octaves.centre_hz.size))

    @cached_property
    def bands(self) -> Bands:
        """Get the motion by the octaves and by the drags at their prior strengths, in units of the white std."""
        known = len(self.drags)
        power = np.tile(self.octaves.power_m2, 2) * (SPEED_M_PER_S / self.white_m) ** 2
        return Bands(block_diag(self.waves, np.eye(known)), block_diag(power, np.full((1, known), _MIN_DRAG**-2)))

    def padded(self, columns: Floats) -> Floats:
        """Return columns, shape (n, c), with zero rows appended for the priors of the drags."""
        return np.pad(columns, ((0, len(self.drags)), (0, 0)))

    def estimate_floor(self, design: Floats, starts: Sequence[Floats] = ()) -> FloorEstimate:
        """Estimate the floor's strengths with a design (n, p) whose coefficients are free; SI units.

        The search begins at the likeliest of ``starts``.  Cost: half a millisecond per iteration at n = 100, and about
        six iterations without a start.
        """
        likelihood = self.likelihood(design)
        return FloorEstimate(likelihood, likelihood.greatest(starts or (self._guess(design),), Curvature()))

    def _guess(self, design: Floats) -> Floats:
        """Return start strengths: rms residual of an unweighted fit, taken at the middle octave's frequency."""
        scale = _scale(design)
        solution, *_ = np.linalg.lstsq(design / scale, self.value_m, rcond=None)
        left = self.value_m - design / scale @ solution
        size = self.octaves.centre_hz.size
        middle = size // 2
        speed = 2 * np.pi * self.octaves.centre_hz[middle] * float(np.sqrt(np.mean(left**2)))
        at = np.full(size + 1, 2.0 * np.log(max(speed, 1e-3 * SPEED_M_PER_S) / SPEED_M_PER_S))
        at -= 1.0 * np.maximum(np.arange(size + 1) - middle, 0)
        drags = [solution[k] / scale[k] for k in self.drags]
        drag = 2.0 * float(np.sqrt(np.mean(np.square(drags)))) if drags else 0.0
        at[-1] = 2.0 * np.log(max(drag / DRAG_M_PER_S2, 0.1))
        return np.array([0.0, *at])

    def solve(self, weights: Floats, points: Floats, design: Floats) -> tuple[Floats, Floats]:
        """Return coefficients (p,) and covariance (p, p) of a mixture, by generalised least squares in every part."""
        values, covariances = self.likelihood(design).fits(points)
        mean = weights @ values
        unscale = self.white_m / _scale(design)
        covariance = mixture_covariance(weights, values, covariances, mean)
        return np.asarray(mean * unscale), np.asarray(covariance * np.outer(unscale, unscale))


def _scale(design: Floats) -> Floats:
    return np.asarray(np.abs(design).max(axis=0) + 1e-300)


@lru_cache(maxsize=8)
def _prior(octaves: int) -> Floats:
    """Return the prior precision of the logarithms, shape (k + 2, k + 2)."""
    level_std = np.full(octaves + 2, np.inf)
    level_std[[0, 1 + octaves // 2, -1]] = _WHITE_SPREAD, SPEED_SPREAD, DRAG_SPREAD
    step_std = np.full(octaves + 1, np.inf)
    step_std[1:-1] = np.where(np.arange(octaves - 1) < octaves // 2, SLOW_SPREAD, FAST_SPREAD)
    return chain_precision(level_std, step_std)

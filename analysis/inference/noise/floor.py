"""The noise of a whole shot: white noise plus up to two Ornstein-Uhlenbeck processes, by maximum likelihood.

A few milliseconds of quiet flight cannot show how far an optical path wanders in fifty.  This noise is therefore
estimated from the whole residual, separately for every model that is compared.  Each process obeys
d x = -x/tau dt + s dW; a long tau is a random walk.  A Kalman filter (``kalman.py``) computes the exact likelihood,
gaps included.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from analysis.inference.noise.kalman import Mask, Series, gains, innovations, steps_of
from analysis.inference.noise.likeliest import LONGEST_TAU_S, SHORTEST_TAU_S, likeliest, likelihood, shape_at
from analysis.shot import Floats
from analysis.signal import white_noise

_NOTHING = np.array([0.0, 1e-2, 0.0, 1e-2])  # shape of white noise alone: (rms over white, tau in s) of both parts
_SIDE, _NEAR, _ALIKE = 0.6, 2e-2, 5e-2  # simplex of a search: initial side, final size, final spread of ln L
MOST_PARTS = 2  # maximum number of wandering parts of a noise
_EVALUATIONS = 60  # largest number in a search, per wandering part


@dataclass(frozen=True, slots=True)
class Floor:
    """A noise model: white noise, two wandering parts and, on a moving frame, the strengths of its motion.

    ``white_m`` is the white std per sample; ``rms_m`` and ``tau_s`` are the rms and correlation times of the wandering
    parts.  ``site`` holds, per band, ln of the frame's power over the power read from flights; () without frame motion.
    """

    white_m: float
    rms_m: tuple[float, float]
    tau_s: tuple[float, float]
    spacing_s: float
    site: tuple[float, ...] = ()

    @property
    def std_m(self) -> float:
        """Get the standard deviation of one sample in m: all parts together except the frame's motion."""
        return math.sqrt(self.white_m**2 + self.rms_m[0] ** 2 + self.rms_m[1] ** 2)

    @property
    def wander(self) -> tuple[tuple[float, float], ...]:
        """Get (rms in m, correlation time in s) of each wandering part."""
        return tuple((rms, tau) for rms, tau in zip(self.rms_m, self.tau_s, strict=True) if rms > 0.0)

    @property
    def coloured(self) -> bool:
        """Get whether the noise has more than a white part: optical-path wander or frame motion."""
        return self.rms_m[0] > 0 or bool(self.site)

    @property
    def still(self) -> "Floor":
        """Get the white part alone."""
        return replace(self, rms_m=(0.0, 0.0), site=())

    @property
    def logarithms(self) -> Floats:
        """Get (ln white_m^2, *site), shape (1 + bands,): the vector of a ``RestrictedLikelihood``."""
        return np.array([2.0 * math.log(self.white_m), *self.site])

    def with_logarithms(self, at: Floats) -> "Floor":
        """Return the noise with these ``logarithms``; this one is its shape, in units of its white part."""
        white_m, (one, two) = math.exp(0.5 * at[0]), self.rms_m
        strengths = tuple(float(a) for a in at[1:])
        return replace(self, white_m=white_m, rms_m=(one * white_m, two * white_m), site=strengths)

    @property
    def kalman(self) -> tuple[float, float, float, float, float, float, float]:
        """Get white variance, then (step variance, memory of a step, variance) of each part."""
        (one, two), (memory_s, other_s) = self.rms_m, self.tau_s
        return (self.white_m**2, *steps_of(one, memory_s, two, other_s, self.spacing_s))

    def whiten(self, columns: Floats, valid: Mask, weight: float = 1.0) -> Floats:
        """Return ``columns``, shape (n, k), whitened so that this noise becomes unit white noise; shape (m, k).

        The result has one row per valid sample.  The filter starts from the stationary variance, so no sample is lost.
        ``weight`` is the shot's white noise over that of this noise.
        """
        gain, scale = self._filter(valid, weight)
        out = np.empty((int(valid.sum()), columns.shape[1]))
        innovations(np.ascontiguousarray(columns), gain, scale, self.kalman[2], self.kalman[5], out)
        return out

    def log_variances(self, valid: Mask, weight: float = 1.0) -> float:
        """Return ln det of the covariance: the sum of the logarithms of the innovations' variances in m^2."""
        _, scale = self._filter(valid, weight)
        return float(-2.0 * np.log(scale[valid]).sum())

    def _filter(self, valid: Mask, weight: float) -> tuple[Floats, Floats]:
        """Return the Kalman gains, shape (n, 2), and 1/std of the innovations, shape (n,), zero where not valid."""
        gain, scale = np.empty((valid.size, 2)), np.empty(valid.size)
        gains(valid, self.white_m**2 * weight**2, self.kalman[1:], gain, scale)
        return gain, scale


def white_floor(white_m: float, spacing_s: float) -> Floor:
    """Return white noise alone, ``white_m`` per sample."""
    return Floor(white_m, (0.0, 0.0), (1e-2, 1e-2), spacing_s)


class LikeliestFloor(NamedTuple):
    """The likeliest noise of residuals, and its log-likelihood."""

    floor: Floor
    value: float


def with_parts(
    best: LikeliestFloor, most: int, samples: int, with_next: Callable[[LikeliestFloor, int], LikeliestFloor | None]
) -> LikeliestFloor:
    """Return a noise with up to ``most`` wandering parts, each added only if it lowers the BIC of ``samples`` values.

    ``with_next`` returns the likeliest noise with one part more, given the best with fewer and the part's number, from
    1; None if none is likelier.
    """
    for number in range(1, most + 1):
        trial = with_next(best, number)
        if trial is None or 2 * (trial.value - best.value) < 2 * math.log(samples):
            break
        best = trial
    return best


def likeliest_floor(
    series: Sequence[Floats],
    valid: Sequence[Mask],
    spacing_s: float,
    *,
    weights: Sequence[float],
    start: Floor | None,
) -> LikeliestFloor:
    """Return the likeliest noise of ``series`` (in m, one for each shot), with the wandering parts of ``with_parts``.

    ``weights`` are the shots' relative white noises.  The search begins near ``start``.  Cost: 1-5 ms for three shots.
    """
    values = [np.where(v, s, 0.0) for s, v in zip(series, valid, strict=True)]
    held, edges = np.concatenate(valid), np.cumsum([0, *(v.size for v in values)])
    white = np.square(np.asarray(weights, dtype=np.float64))
    all_of = Series(np.concatenate(values), held, edges, white, float(spacing_s), max(1, int(held.sum())))
    known = [] if start is None else _ratios(start)

    def with_next(best: LikeliestFloor, number: int) -> LikeliestFloor:
        begin = _ratios(best.floor)
        if len(known) >= number:
            begin.append(known[number - 1])
        elif number == 1:
            begin.append((max(1.0, _roughness(values, valid)), 5e-3))
        else:
            ratio, tau = begin[0]
            begin.append((0.4 * ratio, 0.15 * tau if tau > 4e-3 else 8 * tau))
        return _search(all_of, begin)

    return with_parts(_floor_of(all_of, _NOTHING), MOST_PARTS, all_of.samples, with_next)


def _ratios(floor: Floor) -> list[tuple[float, float]]:
    """Return (rms over white, correlation time in s) of each wandering part."""
    return [(rms / floor.white_m, tau) for rms, tau in floor.wander]


def white_by_differences(series: Sequence[Floats], valid: Sequence[Mask]) -> float:
    """Return the white noise of a sample from third differences, in the units of ``series``; 0 if these are too few."""
    quick = np.concatenate([np.diff(s, 3)[v[3:] & v[:-3]] for s, v in zip(series, valid, strict=True)])
    return white_noise(quick)


def _roughness(series: Sequence[Floats], valid: Sequence[Mask]) -> float:
    """Return the rms of the values over the std of their white part (from third differences)."""
    white = white_by_differences(series, valid)
    spread = math.sqrt(float(np.mean(np.concatenate([s[v] ** 2 for s, v in zip(series, valid, strict=True)]))))
    return spread / white if white > 0 else 1e3


def _floor_of(series: Series, shape: Floats) -> LikeliestFloor:
    """Return the noise with parts of this ``shape``, shape (4,), scaled by maximum likelihood."""
    value, white = likelihood(series, shape)
    one, first, two, second = (float(part) for part in shape)
    return LikeliestFloor(Floor(white, (one * white, two * white), (first, second), series.spacing_s), value)


def _search(series: Series, begin: Sequence[tuple[float, float]]) -> LikeliestFloor:
    span = math.log(LONGEST_TAU_S / SHORTEST_TAU_S)
    z = []
    for ratio, tau in begin:
        share = min(max(math.log(tau / SHORTEST_TAU_S) / span, 1e-3), 1 - 1e-3)
        z += [math.log(max(ratio, 1e-3)), math.log(share / (1 - share))]
    found = likeliest(series, np.array(z), _SIDE, _EVALUATIONS * len(begin), _NEAR, _ALIKE)
    return _floor_of(series, shape_at(found))

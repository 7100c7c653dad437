"""The floor under the rig as flights show it: how strong it is in every octave, and how sure that is.

The floor's density is free in each octave from a third of a period in the flights' time up to what their bins resolve.
The strengths are those of greatest restricted likelihood (Patterson & Thompson, Biometrika 58, 1971) with a prior:
that a building moves with about the same velocity in each octave (Gordon, SPIE 1619, 1991), neighbouring ones
differing by a factor of a few.  The slowest octaves are hardly determined, so the result is the mixture of all likely
strengths.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import solve_triangle
from analysis.reading.octaves import Octaves

Floats = NDArray[np.float64]

SPEED_M_PER_S = 3e-6  # in an octave, before anything is seen: a good laboratory's ...
SPEED_SPREAD = 6.0  # ... to a factor of some hundred; spreads are of natural logarithms of powers
SLOW_SPREAD = 0.6  # from one octave to the next among the slow ones
FAST_SPREAD = 3.0  # ... and the quicker ones, where machines and the frame's own modes decide
DRAG_M_PER_S2 = 1e-3  # a flight's own acceleration, before anything is seen: a tilt of 0.1 mrad ...
DRAG_SPREAD = 2.0
_MOST = 3.0  # that one iteration may move
_ENOUGH = 0.05
_ITERATIONS = 20
_POINTS = 20  # of the mixture
_ROUNDING = 1e-13
_NOTHING = -50.0
_LEAST = 0.01


@dataclass(frozen=True, slots=True)
class FloorEstimate:
    """The floor estimated from flights: ``parts`` are (weight, logarithms of powers), the likeliest are ``best``.

    The logarithms are of the octaves' powers and, last, of the drags', over those that were expected.  ``worth`` is the
    log-likelihood of the best, coefficients at theirs, with what was known before.
    """

    parts: tuple[tuple[float, Floats], ...]
    best: Floats
    worth: float


@dataclass(frozen=True, slots=True)
class FlightObservation:
    """The binned displacement of flights, (n,) in m, the white std of a bin, and which columns of a design are drags.

    ``waves`` (n, 2 f) are cosines and sines of the octaves' frequencies, averaged over the bins.
    """

    value_m: Floats
    white_m: float
    drags: tuple[int, ...]
    octaves: Octaves
    waves: Floats

    @property
    def unknowns(self) -> int:
        """Get how many strengths there are: the octaves' and the drags'."""
        return self.octaves.centre_hz.size + 1

    def powers(self, at: Floats) -> Floats:
        """Return the octaves' powers (k,) in (m/s)^2."""
        return powers_of(at[:-1])

    def estimate_floor(self, design: Floats, start: Floats | None = None) -> FloorEstimate:
        """Estimate the floor's strengths with a design (n, p) whose coefficients are free; SI units.

        Fisher scoring on the logarithms.  Cost: 1 ms per iteration at n = 64, some six iterations from afar.
        """
        scale = _scale(design)
        columns = design / scale
        prior = _prior(self.octaves.centre_hz.size)
        at = self._guess(columns, scale) if start is None else start
        worth, slope, curve = self._likelihood(at, columns, scale, prior)
        for _ in range(_ITERATIONS):
            move = np.linalg.solve(curve, slope)
            move *= min(1.0, _MOST / float(np.abs(move).max()))
            for _ in range(4):
                found = self._likelihood(at + move, columns, scale, prior)
                if found[0] > worth - 1e-6:
                    break
                move = 0.35 * move
            else:
                break
            gained, at = found[0] - worth, at + move
            worth, slope, curve = found
            if np.abs(move).max() < _ENOUGH or gained < 1e-3:
                break
        parts = tuple((1.0 / _POINTS, point) for point in points_about(at, curve))
        still = np.concatenate([np.full(at.size - 1, _NOTHING), at[-1:]])
        left = self._likelihood(still, columns, scale, (still, prior[1]))[0] - 0.5 * prior[1][-1, -1] * at[-1] ** 2
        # how much likelier any floor is than none, its strengths integrated over (Laplace)
        times = worth - left + 0.5 * float(np.linalg.slogdet(prior[1])[1] - np.linalg.slogdet(curve)[1])
        none = float(1.0 / (1.0 + np.exp(np.clip(times, -30.0, 30.0))))
        if none > _LEAST:
            parts = (*((weight * (1.0 - none), point) for weight, point in parts), (none, still))
        return FloorEstimate(parts, at, self.likelihood(at, design))

    def _guess(self, columns: Floats, scale: Floats) -> Floats:
        """Return strengths to begin with: what white noise would leave, as if it were all in the middle octave."""
        solution, *_ = np.linalg.lstsq(columns, self.value_m, rcond=None)
        left = self.value_m - columns @ solution
        size = self.octaves.centre_hz.size
        middle = size // 2
        speed = 2 * np.pi * self.octaves.centre_hz[middle] * float(np.sqrt(np.mean(left**2)))
        at = np.full(size + 1, 2.0 * np.log(max(speed, 1e-3 * SPEED_M_PER_S) / SPEED_M_PER_S))
        at -= 1.0 * np.maximum(np.arange(size + 1) - middle, 0)
        drags = [solution[k] / scale[k] for k in self.drags]
        drag = 2.0 * float(np.sqrt(np.mean(np.square(drags)))) if drags else 0.0
        at[-1] = 2.0 * np.log(max(drag / DRAG_M_PER_S2, 0.1))
        return at

    def _white(self, low: Floats, columns: Floats) -> Floats:
        """Return the bins and then ``columns`` (n, m) as the factor of a covariance leaves them: white, (n, 1 + m)."""
        both = np.column_stack([self.value_m / self.white_m, columns])
        return solve_triangle(low, both, lower=True)

    def root(self, at: Floats) -> Floats:
        """Return the Cholesky factor of the bins' covariance in white noises, (n, n), the lower triangle."""
        power = self.powers(at) @ self.octaves.power_m2 / self.white_m**2
        half = self.waves * np.sqrt(np.concatenate([power, power]))
        covariance = half @ half.T
        covariance[np.diag_indices_from(covariance)] += 1.0 + _ROUNDING * float(np.trace(covariance))
        return np.asarray(np.linalg.cholesky(covariance))

    def known(self, at: Floats, scale: Floats) -> Floats:
        """Return the prior precisions of a design's coefficients that was divided by ``scale``, in white noises."""
        known = np.zeros(scale.size)
        drag = DRAG_M_PER_S2**2 * float(np.exp(np.clip(at[-1], -60.0, 60.0)))
        for column in self.drags:  # half the acceleration
            known[column] = 4.0 / drag * (self.white_m / scale[column]) ** 2
        return known

    def _likelihood(
        self, at: Floats, columns: Floats, scale: Floats, prior: tuple[Floats, Floats]
    ) -> tuple[float, Floats, Floats]:
        """Return log-likelihood with the prior's, its gradient and the expected curvature, over all strengths."""
        size = self.octaves.centre_hz.size
        low = self.root(at)
        known = self.known(at, scale)
        width = columns.shape[1]
        white = self._white(low, np.hstack([columns, self.waves]))
        data, regressors, waves = white[:, 0], white[:, 1 : 1 + width], white[:, 1 + width :]
        inner = np.asarray(np.linalg.cholesky(regressors.T @ regressors + np.diag(known)), np.float64)
        across = solve_triangle(inner, regressors.T, lower=True)
        rest = data - across.T @ (across @ data)
        coefficients = np.linalg.solve(inner.T, across @ data)
        informed = known > 0
        logs = 2.0 * float(np.log(np.diag(low)).sum() + np.log(np.diag(inner)).sum()) - float(
            np.log(known[informed]).sum()
        )
        value = -0.5 * (logs + float(data @ rest))
        seen, told = waves.T @ rest, across @ waves
        gram = waves.T @ waves - told.T @ told
        half = self.waves.shape[1] // 2
        powers = self.powers(at)[:, None] * self.octaves.power_m2 / self.white_m**2  # (k, f)
        both = np.concatenate([powers, powers], axis=1)
        slope = np.empty(size + 1)
        slope[:size] = 0.5 * both @ (seen**2 - np.diag(gram))
        curve = np.zeros((size + 1, size + 1))
        squares = gram**2
        squares = squares[:half, :half] + squares[half:, :half] + squares[:half, half:] + squares[half:, half:]
        curve[:size, :size] = 0.5 * powers @ squares @ powers.T
        if informed.any():
            inverse = np.linalg.inv(inner @ inner.T)
            told = 1.0 - known[informed] * np.diag(inverse)[informed]  # of each drag, by the data
            slope[size] = 0.5 * float((known[informed] * coefficients[informed] ** 2 - told).sum())
            curve[size, size] = 0.5 * float((told**2).sum())
        else:
            slope[size] = 0.0
        away, precision = at - prior[0], prior[1]
        pull = precision @ away
        return value - 0.5 * float(away @ pull), slope - pull, curve + precision

    def likelihood(self, at: Floats, design: Floats) -> float:
        """Return the log-likelihood of strengths and of a design's best coefficients, with what was known before."""
        mean, precision = _prior(self.octaves.centre_hz.size)
        scale = _scale(design)
        low = self.root(at)
        white = self._white(low, design / scale)
        inner = white[:, 1:].T @ white[:, 1:] + np.diag(self.known(at, scale))
        across = white[:, 1:].T @ white[:, 0]
        left = float(white[:, 0] @ white[:, 0] - across @ np.linalg.solve(inner, across))
        return -float(np.log(np.diag(low)).sum()) - 0.5 * (left + float((at - mean) @ precision @ (at - mean)))

    def solve(self, estimate: FloorEstimate, design: Floats) -> tuple[Floats, Floats]:
        """Return coefficients (p,) and covariance (p, p): generalised least squares in every part of the mixture."""
        scale = _scale(design)
        solutions, covariances = [], []
        for _, at in estimate.parts:
            white = self._white(self.root(at), design / scale)
            covariance = np.linalg.inv(white[:, 1:].T @ white[:, 1:] + np.diag(self.known(at, scale)))
            covariances.append(covariance)
            solutions.append(covariance @ (white[:, 1:].T @ white[:, 0]))
        weights = np.array([part[0] for part in estimate.parts])
        mean = weights @ np.stack(solutions)
        apart = np.stack(solutions) - mean
        covariance = np.einsum("k,kij->ij", weights, np.stack(covariances))
        covariance += np.einsum("k,ki,kj->ij", weights, apart, apart)
        unscale = self.white_m / scale
        return np.asarray(mean * unscale), np.asarray(covariance * np.outer(unscale, unscale))


def _scale(design: Floats) -> Floats:
    return np.asarray(np.abs(design).max(axis=0) + 1e-300)


def powers_of(at: Floats) -> Floats:
    """Return the powers of octaves in (m/s)^2, (k,), whose logarithms over what is expected are these."""
    return np.asarray(SPEED_M_PER_S**2 * np.exp(np.clip(at, -60.0, 60.0)))


def points_about(at: Floats, curve: Floats) -> tuple[Floats, ...]:
    """Return points that stand for a normal distribution about ``at``, (k,), of precision ``curve``, (k, k)."""
    level, turn = np.linalg.eigh(curve)
    spread = turn / np.sqrt(level) @ turn.T  # symmetric: eigenvectors alone turn with every rounding
    return tuple(at + spread @ point for point in _normal(at.size))


@lru_cache(maxsize=8)
def _normal(size: int) -> Floats:
    """Return points that stand for a normal distribution, (_POINTS, size): their mean is 0, their covariance one."""
    half = np.random.default_rng(size).standard_normal((_POINTS // 2, size))
    points = np.concatenate([half, -half])
    return np.asarray(points @ np.linalg.inv(np.linalg.cholesky(points.T @ points / _POINTS)).T)


@lru_cache(maxsize=8)
def prior_of(octaves: int) -> tuple[Floats, Floats]:
    """Return mean and precision of the octaves' logarithms before anything is seen, (k,) and (k, k)."""
    precision = np.zeros((octaves, octaves))
    for k in range(octaves - 1):
        spread = SLOW_SPREAD if k < octaves // 2 else FAST_SPREAD
        precision[k : k + 2, k : k + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / spread**2
    precision[octaves // 2, octaves // 2] += 1.0 / SPEED_SPREAD**2
    return np.zeros(octaves), precision


@lru_cache(maxsize=8)
def _prior(octaves: int) -> tuple[Floats, Floats]:
    """Return the same with the drags' logarithm last, ((k + 1),) and (k + 1, k + 1)."""
    mean, precision = (np.pad(part, (0, 1)) for part in prior_of(octaves))
    precision[octaves, octaves] = 1.0 / DRAG_SPREAD**2
    return mean, precision

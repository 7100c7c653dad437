"""The floor under the rig as flights show it: how strong it is in every octave, and how sure that is.

The floor's density is free in each octave from a third of a period in the flights' time up to what their bins resolve.
The strengths are those of greatest restricted likelihood with a prior: that a building moves with about the same
velocity in each octave (Gordon, SPIE 1619, 1991), neighbouring ones differing by a factor of a few.  The slowest
octaves are hardly determined, so the result is the mixture of all likely strengths.

The vector of logarithms, shape (k + 2,), holds those of the white noise, which is known, of the k octaves' powers and
of the power of the flights' drags, each over what is expected.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag

from analysis.reading.floor_spectrum import Octaves
from analysis.reading.restricted_likelihood import (
    Curvature,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
)
from analysis.shot import Floats

SPEED_M_PER_S = 3e-6  # in an octave, before anything is seen: a good laboratory's ...
SPEED_SPREAD = 6.0  # ... to a factor of some hundred; spreads are of natural logarithms of powers
SLOW_SPREAD = 0.6  # from one octave to the next among the slow ones
FAST_SPREAD = 3.0  # ... and the quicker ones, where machines and the frame's own modes decide
DRAG_M_PER_S2 = 1e-3  # a flight's own acceleration, before anything is seen: a tilt of 0.1 mrad ...
DRAG_SPREAD = 2.0
_WHITE_SPREAD = 1e-6  # it is known
_LEAST_DRAG = 1e-4  # of the expected: a drag's std is never less
_PAIRS = 10  # of points of the mixture
_ROUNDING = 1e-11
_NOTHING = -50.0
_LEAST = 0.01  # weight of a motionless floor in the mixture


@dataclass(frozen=True, slots=True)
class FloorEstimate:
    """The floor estimated from flights: a mixture of ``points``, shape (p, k + 2), with ``weights``, shape (p,).

    The likeliest are ``best``; ``worth`` is their log-likelihood, coefficients at theirs, with what was known before.
    """

    weights: Floats
    points: Floats
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
        """Get how many logarithms there are."""
        return self.octaves.centre_hz.size + 2

    def powers(self, at: Floats) -> Floats:
        """Return the octaves' powers in (m/s)^2, shape (..., k), for vectors of shape (..., k + 2)."""
        return np.asarray(SPEED_M_PER_S**2 * np.exp(at[..., 1:-1]))

    def likelihood(self, design: Floats) -> RestrictedLikelihood:
        """Return the restricted likelihood of the logarithms with a design (n, p) whose coefficients are free.

        The design is in SI units, the coefficients are in white noises, of columns whose largest element is one.  What
        is known of each drag is a row after the bins: that the drag is zero, to as much as the drags' strength says.
        """
        (bins, width), known = design.shape, len(self.drags)
        scale = _scale(design)
        along = self.padded(np.column_stack([self.value_m / self.white_m, design / scale]))
        for row, column in enumerate(self.drags, bins):
            least = 0.5 * _LEAST_DRAG * DRAG_M_PER_S2 / self.white_m  # half the acceleration, as the design has it
            along[row, 1 + column] = 1.0 / (least * scale[column])
        factors = block_diag(self.waves.T, np.eye(known)).T  # in the order of Fortran
        power = np.tile(self.octaves.power_m2, 2) * (SPEED_M_PER_S / self.white_m) ** 2
        shares = block_diag(power, np.full((1, known), _LEAST_DRAG**-2))
        rest = np.zeros((1 + width, 1 + width))
        shot = ShotResidual(along, rest, len(along), 0.0, np.arange(width), factors, shares, _ROUNDING)
        return RestrictedLikelihood((shot,), _prior(self.octaves.centre_hz.size))

    def padded(self, columns: Floats) -> Floats:
        """Return columns, shape (n, c), with the rows of what is known of the drags; they are zero there."""
        return np.pad(columns, ((0, len(self.drags)), (0, 0)))

    def estimate_floor(self, design: Floats, start: Floats | None = None) -> FloorEstimate:
        """Estimate the floor's strengths with a design (n, p) whose coefficients are free; SI units.

        Cost: 1 ms per iteration at n = 64, some six iterations from afar.
        """
        likelihood = self.likelihood(design)
        best = likelihood.greatest(self._guess(design) if start is None else start, Curvature())
        curve = likelihood.curvature(best)
        points = np.pad(points_about(best.at[1:], curve[1:, 1:], _PAIRS), ((0, 0), (1, 0)))
        weights = np.full(len(points), 1.0 / len(points))
        octaves = np.array([0.0, *np.full(best.at.size - 2, _NOTHING), 0.0])
        still = np.array([*octaves[:-1], best.at[-1]])
        left = likelihood.at(still).value + 0.5 * float(octaves @ likelihood.precision @ octaves)  # without the prior
        # how much likelier any floor is than none, its strengths integrated over (Laplace)
        volume = np.linalg.slogdet(likelihood.precision)[1] - np.linalg.slogdet(curve)[1]
        times = best.value - left + 0.5 * float(volume)
        none = float(1.0 / (1.0 + np.exp(np.clip(times, -30.0, 30.0))))
        if none > _LEAST:
            weights, points = np.append(weights * (1.0 - none), none), np.vstack([points, still])
        return FloorEstimate(weights, points, best.at, best.profile)

    def _guess(self, design: Floats) -> Floats:
        """Return strengths to begin with: what white noise would leave, as if it were all in the middle octave."""
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
        """Return coefficients (p,) and covariance (p, p): generalised least squares in every part of a mixture."""
        values, covariances = self.likelihood(design).fits(points)
        mean = weights @ values
        unscale = self.white_m / _scale(design)
        covariance = mixture_covariance(weights, values, covariances, mean)
        return np.asarray(mean * unscale), np.asarray(covariance * np.outer(unscale, unscale))


def _scale(design: Floats) -> Floats:
    return np.asarray(np.abs(design).max(axis=0) + 1e-300)


@lru_cache(maxsize=8)
def _prior(octaves: int) -> Floats:
    """Return the precision of the logarithms before anything is seen, shape (k + 2, k + 2)."""
    level_std = np.full(octaves + 2, np.inf)
    level_std[[0, 1 + octaves // 2, -1]] = _WHITE_SPREAD, SPEED_SPREAD, DRAG_SPREAD
    step_std = np.full(octaves + 1, np.inf)
    step_std[1:-1] = np.where(np.arange(octaves - 1) < octaves // 2, SLOW_SPREAD, FAST_SPREAD)
    return chain_precision(level_std, step_std)

"""Fit one hypothesis and compute its likelihood and covariance, the noise learnt anew from its residual."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.arrow import Arrow
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.hypothesis import Hypothesis, JointData
from analysis.inference.fit.least_squares import Hopeless, Minimum, Square, covariance, minimise
from analysis.inference.noise import site_strengths
from analysis.inference.noise.flights import noise_of_flights
from analysis.inference.noise.floor import Floor, learn, white_floor
from analysis.inference.noise.site_strengths import Likely, over_likely
from analysis.shot import Stop

Floats = NDArray[np.float64]
_ROUNDS, _A_ROUND, _BRINGS = 8, 25, 0.05  # of ``lead_on``: rounds, evaluations in each, least gain of ln L
_NEAR = 0.04  # of chi^2 still to fall: no parameter is further than a fifth of its std from the minimum


@dataclass(frozen=True)
class Fitted:
    """A fitted hypothesis: ``log_likelihood`` under its own ``floor``, averaged residual ``residual_m`` of each shot.

    ``inverse`` is (J^T J)^-1 of the whitened derivatives J, shape (p, p), in the coordinates of the search.
    """

    hypothesis: Hypothesis
    z: Floats
    floor: Floor
    log_likelihood: float
    residual_m: tuple[Floats, ...]
    inverse: Floats
    converged: bool

    @property
    def point(self) -> Point:
        """Get the parameters."""
        return self.hypothesis.unpack(self.z)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Get the effects."""
        return tuple(kind.effect for kind in self.hypothesis.effects)

    @property
    def covariance(self) -> Floats:
        """Get the covariance of the parameters, in the vector's order."""
        slope = self.hypothesis.slope(self.z)
        return np.asarray(slope @ self.inverse @ slope.T)

    @property
    def std(self) -> Floats:
        """Get the standard deviations of the parameters, in the vector's order."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def samples(self) -> int:
        """Get the number of valid averaged samples."""
        return sum(int(shot.valid.sum()) for shot in self.hypothesis.data.shots)

    def whitened(self, floor: Floor | None = None) -> list[Floats]:
        """Return the residual at the valid samples, shot by shot, whitened by ``floor`` (None: the fit's own)."""
        shots = self.hypothesis.data.shots
        return [
            shot.whitened(floor or self.floor, left[:, None])[:, 0]
            for left, shot in zip(self.residual_m, shots, strict=True)
        ]

    def chi2(self, floor: Floor) -> float:
        """Return the sum of squares of the residual whitened by ``floor``."""
        return sum(float(left @ left) for left in self.whitened(floor))

    @property
    def bic(self) -> float:
        """Get the Bayesian information criterion (Schwarz 1978): k ln n - 2 ln L; smaller is better."""
        return self.hypothesis.size * math.log(self.samples) - 2 * self.log_likelihood


def square_of(hypothesis: Hypothesis, floor: Floor, z: Floats) -> Square:
    """Return the whitened sum of squares at ``z`` with its derivatives."""
    left, tangents = whitened_tangents(hypothesis, floor, hypothesis.linearised(z))
    left = -left
    if not all(np.all(np.isfinite(one)) for one in (left, *tangents.blocks)):
        raise Infeasible("the trajectory is not finite")
    chi2, pull = float(left @ left), tangents.pull(left)
    return Square(chi2, tangents.gram(), pull, left.size, left, tangents.along, tangents.pull)


def whitened_tangents(
    hypothesis: Hypothesis, floor: Floor, lines: Sequence[tuple[Floats, Floats]]
) -> tuple[Floats, Arrow]:
    """Return residual and derivatives, whitened; ``lines`` as ``Hypothesis.linearised`` returns them.

    The residual is measured minus model, shape (rows,), all shots one after another.
    """
    data = hypothesis.data
    both = zip(data.shots, data.left_m(x for x, _ in lines), lines, strict=True)
    rows = [shot.whitened(floor, np.column_stack([left, tangents])) for shot, left, (_, tangents) in both]
    return np.concatenate([one[:, 0] for one in rows]), hypothesis.arrow([one[:, 1:] for one in rows])


def whitened_residual(hypothesis: Hypothesis, floor: Floor, z: Floats) -> Floats:
    """Return model minus measured at ``z``, whitened, all shots one after another."""
    return hypothesis.data.whitened(floor, [-left[:, None] for left in residuals(hypothesis, z)])[:, 0]


def residuals(hypothesis: Hypothesis, z: Floats) -> tuple[Floats, ...]:
    """Return measured minus model displacement, averaged, one array for each shot."""
    return hypothesis.data.left_m(hypothesis.displacement(z))


def learn_floor(
    data: JointData, left: Sequence[Floats], start: Floor | None = None, *, anew: bool = False
) -> tuple[Floor, float]:
    """Return the likeliest noise of residuals ``left``, and its log-likelihood.

    On a moving frame the wandering parts keep the shape they have in ``start`` unless they are to be learnt ``anew``.
    """
    if data.site is not None:
        return site_strengths.learn(left, data.shots, data.site, start=start, parts=data.parts if anew else 0)
    return learn(
        left,
        [shot.valid for shot in data.shots],
        data.shots[0].spacing_s,
        weights=[shot.weight for shot in data.shots],
        start=start,
        parts=data.parts,
    )


def first_floor(hypothesis: Hypothesis, z: Floats, white_m: float) -> Floor:
    """Return the noise with which a search from ``z`` begins: white where no frame moves.

    On a moving frame it is learnt from the residual, its wandering parts with the shape that the flights show.
    """
    if hypothesis.data.site is not None:
        data = hypothesis.data
        return learn_floor(data, residuals(hypothesis, z), noise_of_flights(data.shots, data.site)[0])[0]
    return white_floor(white_m, hypothesis.data.shots[0].spacing_s)


def search(
    hypothesis: Hypothesis,
    z: Floats,
    floor: Floor,
    *,
    evaluations: int = 25,
    tolerance: float = 1e-2,
    hopeless: Hopeless | None = None,
    cancelled: Stop | None = None,
) -> Minimum:
    """Minimise chi^2 under a given noise from ``z`` until the fall still expected is below ``tolerance``.

    Or until ``hopeless`` says so (see ``minimise``).  Raises Infeasible where the start has no trajectory.
    """
    low, high = hypothesis.bounds
    low[hypothesis.unseen] = high[hypothesis.unseen] = z[hypothesis.unseen]
    return minimise(
        lambda at: square_of(hypothesis, floor, at),
        z,
        bounds=(low, high),
        evaluations=evaluations,
        tolerance=tolerance,
        residual=lambda at: whitened_residual(hypothesis, floor, at),
        hopeless=hopeless,
        cancelled=cancelled,
    )


def finish(hypothesis: Hypothesis, found: Minimum, floor: Floor, *, anew: bool = False) -> Fitted:
    """Return the fit at the end of a search under ``floor``: noise learnt from the residual, likelihood, covariance.

    ``anew`` as in ``learn_floor``.
    """
    left = residuals(hypothesis, found.parameters)
    # The likelihood of wandering parts has several maxima; a search begun at another hypothesis' would stay there.
    floor, value = learn_floor(hypothesis.data, left, floor if floor.site else None, anew=anew)
    inverse = covariance(found.square)
    converged = found.converged
    if inverse is None:
        inverse = np.full((hypothesis.size, hypothesis.size), np.nan)
    else:
        gradient = found.square.gradient
        converged = converged or float(gradient @ inverse @ gradient) < _NEAR * found.square.chi2 / found.square.samples
    return Fitted(hypothesis, found.parameters, floor, value, left, inverse, converged)


def fit_hypothesis(
    hypothesis: Hypothesis,
    z: Floats,
    floor: Floor,
    *,
    evaluations: int = 25,
    anew: bool = False,
    cancelled: Stop | None = None,
) -> Fitted:
    """Fit from ``z`` under the given noise, then under that learnt from the residual; ``anew`` as ``learn_floor``'s."""
    first = finish(hypothesis, search(hypothesis, z, floor, evaluations=evaluations, cancelled=cancelled), floor)
    again = max(8, evaluations // 2)
    second = search(hypothesis, first.z, first.floor, evaluations=again, cancelled=cancelled)
    final = finish(hypothesis, second, first.floor, anew=anew)
    return final if final.log_likelihood >= first.log_likelihood else first


def lead_on(fitted: Fitted, *, cancelled: Stop | None = None) -> Fitted:
    """Continue the search of a fit that had not converged, as long as the likelihood grows.

    With a law the minimum lies in a long bent valley: a point worse by only a thousandth of chi^2 may be ten standard
    deviations away from it.
    """
    for _ in range(_ROUNDS):
        if fitted.converged:
            break
        found = search(fitted.hypothesis, fitted.z, fitted.floor, evaluations=_A_ROUND, cancelled=cancelled)
        further = finish(fitted.hypothesis, found, fitted.floor)
        if further.log_likelihood < fitted.log_likelihood + _BRINGS and not further.converged:
            break
        fitted = further if further.log_likelihood >= fitted.log_likelihood else fitted
        if found.converged:
            break
    return _without_wander(fitted, cancelled)


def _without_wander(fitted: Fitted, cancelled: Stop | None) -> Fitted:
    """Return a fit with white noise alone where that is likelier; wandering noise can hide what a model lacks."""
    floor = fitted.floor
    if floor.site or max(floor.rms_m) < floor.white_m:
        return fitted
    still = fit_hypothesis(fitted.hypothesis, fitted.z, floor.still, evaluations=_A_ROUND, cancelled=cancelled)
    return still if still.log_likelihood > fitted.log_likelihood else fitted


def under_likely_noises(fitted: Fitted) -> Fitted:
    """Return a fit on a moving frame with its covariance under all likely strengths of the frame's bands.

    Under the likeliest strengths alone it is a third too small, since slow bands swing only a few times in a shot.  A
    fit without a moving frame is returned unchanged.
    """
    if fitted.hypothesis.data.site is None or not fitted.floor.site:
        return fitted
    free = np.ones(fitted.hypothesis.size, dtype=np.bool_)
    free[fitted.hypothesis.unseen] = False
    likely = over_likely_strengths(fitted, free)
    return fitted if likely is None else replace(fitted, inverse=likely.covariance)


def over_likely_strengths(fitted: Fitted, free: NDArray[np.bool_]) -> Likely | None:
    """Return the parameters' covariance under all likely strengths, zero where not ``free``, shape (p,).

    None where the free parameters are not determined.
    """
    data = fitted.hypothesis.data
    assert data.site is not None
    tangents = fitted.hypothesis.arrow([line for _, line in fitted.hypothesis.linearised(fitted.z)])
    tangents = tangents.without(np.flatnonzero(~free))
    try:
        likely = over_likely(fitted.residual_m, tangents, data.shots, data.site, fitted.floor)
    except np.linalg.LinAlgError:  # two parameters have the same effect
        return None
    return replace(likely, covariance=np.where(np.outer(free, free), likely.covariance, 0.0))

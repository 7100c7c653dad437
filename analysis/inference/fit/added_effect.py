"""Short fits with one more effect: from its best-scored start values, or from the fit that found it alone."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.arrow import Arrow
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.least_squares import Minimum, Square
from analysis.inference.fit.problem import Fitted, Linearised, Problem
from analysis.shot import Cancelled, Floats, Stop

_SHORT = 7  # evaluations of a fit that only compares
_FAR_BEHIND = 300.0  # BIC behind the other fit at which a search that promises little more is stopped
_START_SHARES = (1.0, 0.3, 0.1)  # of the start amplitude, tried in turn
_COMPENSATING_STEPS = 4  # steps at most
_LEAST_SINGULAR = 1e-4  # of the largest singular value: directions with less are not moved


def refit(
    at: Linearised, kind: TrialEffect, start: Sequence[Mapping[str, float]], stop: Stop, *, least_bic: float = math.inf
) -> Fitted | None:
    """Fit briefly with one more effect from its start values, one set for each shot; None where no trajectory exists.

    ``least_bic`` is the criterion of the fit that it is compared with: a search far behind it is stopped early.
    """
    problem = at.problem.with_effect(kind, start[0])
    effective = at.effective
    low, high = problem.bounds
    if stop():
        raise Cancelled

    def hopeless(z: Floats, square: Square) -> bool:
        return problem.fitted(Minimum(z, square, False, 0)).bic > least_bic + _FAR_BEHIND

    stop_early = hopeless if math.isfinite(least_bic) else None
    for share in _START_SHARES:  # a linear step may lead to where there is no trajectory
        weaker = [kind.times(given, share) for given in start]
        values = tuple({**v, kind.effect: given} for v, given in zip(effective.values, weaker, strict=True))
        try:
            z = np.clip(problem.pack_effective(Point(effective.base, effective.own, values)), low, high)
            z = _compensated(at, problem, z)
            return problem.fit_once(z, evaluations=_SHORT, hopeless=stop_early, cancelled=stop)
        except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
            continue
    return None


def _compensated(at: Linearised, problem: Problem, z: Floats) -> Floats:
    """Return ``z`` with the parameters fitted before moved to compensate for the new effect, by linear steps.

    The effect's whole displacement may be a thousand times the part that the fitted parameters cannot compensate.
    """
    before = at.problem
    places = {
        (effect, free.name, shot): problem.offset + k for k, (effect, free, shot) in enumerate(problem.free_parameters)
    }
    free_parameters = [places[effect, free.name, shot] for effect, free, shot in before.free_parameters]
    moving = np.array([*range(before.offset), *free_parameters])
    compensation = at.once("compensation", lambda: _compensation(at.tangents))
    low, high = problem.bounds
    left = problem.whitened_residual(z)
    chi2 = float(left @ left)
    for _ in range(_COMPENSATING_STEPS):
        there = z.copy()
        there[moving] -= compensation(left)
        there = np.clip(there, low, high)
        try:
            left = problem.whitened_residual(there)
        except Infeasible:
            break
        if not float(left @ left) < 0.99 * chi2:
            break
        z, chi2 = there, float(left @ left)
    return z


def _compensation(tangents: Arrow) -> Callable[[Floats], Floats]:
    """Return the map from a whitened residual, shape (rows,), to the least-squares step of the parameters.

    Directions that hardly change the displacement are not moved.
    """
    gram = tangents.gram()
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    level, turn = np.linalg.eigh(gram / np.outer(scale, scale))
    some = level > _LEAST_SINGULAR**2 * level[-1]
    return lambda left: (turn[:, some] @ (turn[:, some].T @ (tangents.pull(left) / scale) / level[some])) / scale


def with_both_effects(here: Fitted, alone: Fitted, start: Fitted, stop: Stop) -> Fitted | None:
    """Fit briefly with the effects of ``here`` and of ``alone``, both grown from ``start``; None where that fails.

    The search begins with the base parameters moved by the sum of both fits' moves.  A start from a linear step would
    fail where the first effect makes the displacement follow the steps of a fringe.
    """
    first, other = here.problem, alone.problem
    new = tuple(kind for kind in other.effects if kind not in first.effects)
    problem = first.with_effects((*first.effects, *new), {**other.fixed, **first.fixed})
    low, high = problem.bounds
    z = np.empty(problem.size)
    z[: first.offset] = here.z[: first.offset] + alone.z[: first.offset] - start.z[: first.offset]
    found = {**_free_parameters(alone), **_free_parameters(here)}
    for k, (effect, free, shot) in enumerate(problem.free_parameters, first.offset):
        z[k] = found[effect, free.name, shot]
    if stop():
        raise Cancelled
    try:
        return problem.fit_once(np.clip(z, low, high), evaluations=_SHORT, cancelled=stop)
    except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
        return None


def _free_parameters(fitted: Fitted) -> dict[tuple[Effect, str, int], float]:
    """Return the search coordinates of a fit's effects by (effect, parameter, shot)."""
    problem = fitted.problem
    return {
        (effect, free.name, shot): float(fitted.z[k])
        for k, (effect, free, shot) in enumerate(problem.free_parameters, problem.offset)
    }

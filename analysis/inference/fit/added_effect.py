"""Add effects to a fit, starting from their best-scored values or from the fit of each effect alone."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.least_squares import Minimum
from analysis.inference.fit.problem import COMPARABLE, Fitted, Linearised, Problem
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.model.normal_matrix import Square
from analysis.inference.screen.screening import distinct_starts
from analysis.shot import Cancelled, Floats, Stop

_FOLLOWED = 3  # number of start values from which an effect is fitted
_COMPARING, _FROM_NATURAL_SIZE, _ENDING = 7, 30, 16  # evaluations: to compare fits, from natural size, to finish
_FAR_BEHIND = 300.0  # BIC behind the compared fit at which a search near its end is stopped
_START_SHARES = (1.0, 0.3, 0.1)  # fractions of the start amplitude, tried in turn
_COMPENSATING_STEPS = 4  # largest number of steps
_DAMPING = 1e-8  # of a step, relative: directions with a singular value below 1e-4 hardly move
_NO_FIT = (Infeasible, np.linalg.LinAlgError, FloatingPointError)  # raised if a search finds no trajectory


def joined(here: Fitted, kinds: Sequence[TrialEffect], stop: Stop) -> Fitted:
    """Return a fit with these effects added one after the other, with the noise re-estimated at each step.

    Each search starts from the values that explain most of the residual.  Raises Infeasible if an effect has no
    trajectory from any start values.
    """
    for kind in kinds:
        here = _with_one_more(here, kind, stop)
    return here


def _with_one_more(here: Fitted, kind: TrialEffect, stop: Stop) -> Fitted:
    at = here.linearise()
    starts = [score.start for score in distinct_starts(at.scores(kind))[:_FOLLOWED]]
    if here.noise.coloured:  # noise estimated from the residual may have absorbed the effect
        starts += [score.start for score in distinct_starts(at.under(here.unlearned_noise).scores(kind))[:1]]
    trials = [trial for start in starts if (trial := refit(at, kind, start, stop)) is not None]
    if not trials or min(trial.bic for trial in trials) > here.bic:
        natural = (_from_natural_size(here, kind, start, stop) for start in kind.starts[:_FOLLOWED])
        trials += [trial for trial in natural if trial is not None]
    if not trials:
        raise Infeasible(f"no start of {kind.effect.name} gives a trajectory")
    trials.sort(key=lambda trial: trial.bic)
    return trials[0].refitted(evaluations=_ENDING, cancelled=stop)


def _from_natural_size(here: Fitted, kind: TrialEffect, start: Mapping[str, float], stop: Stop) -> Fitted | None:
    """Return a fit from the natural size of an effect that other parameters absorb to first order; None if none."""
    problem = here.problem.with_effect(kind, start)
    try:
        z = _vector_with(problem, here.effective, kind, [start] * len(problem.data.shots))
        return problem.fit_once(z, evaluations=_FROM_NATURAL_SIZE, cancelled=stop)
    except _NO_FIT:
        return None


def _vector_with(problem: Problem, effective: Point, kind: TrialEffect, start: Sequence[Mapping[str, float]]) -> Floats:
    """Return the search vector, within the bounds, of a point with one more effect at its start values."""
    return np.clip(problem.pack_effective(effective.with_effect(kind.effect, start)), *problem.bounds)


def refit(
    at: Linearised, kind: TrialEffect, start: Sequence[Mapping[str, float]], stop: Stop, *, least_bic: float = math.inf
) -> Fitted | None:
    """Fit briefly with one more effect from its start values, one set per shot; None if there is no trajectory.

    ``least_bic`` is the BIC of the fit to compare with: a search far behind it is stopped early.
    """
    problem = at.problem.with_effect(kind, start[0])
    if stop():
        raise Cancelled

    def stop_early(z: Floats, square: Square) -> bool:
        return problem.fitted(Minimum(z, square, False)).bic > least_bic + _FAR_BEHIND

    behind = stop_early if math.isfinite(least_bic) else None
    for share in _START_SHARES:  # a full linear step may have no trajectory
        weaker = [kind.times(given, share) for given in start]
        try:
            z = _compensated(at, problem, _vector_with(problem, at.effective, kind, weaker))
            return problem.fit_once(z, evaluations=_COMPARING, tolerance=COMPARABLE, stop_early=behind, cancelled=stop)
        except _NO_FIT:
            continue
    return None


def _compensated(at: Linearised, problem: Problem, z: Floats) -> Floats:
    """Return ``z`` with the previously fitted parameters moved by linear steps to compensate for the new effect.

    The effect's whole displacement may be a thousand times the part that these parameters cannot compensate.
    """
    before, places = at.problem, _places(problem)
    moving = np.array([*range(before.offset), *(places[parameter] for parameter in _places(before))])
    curvature = at.once("normal matrix", at.tangents.normal_matrix)
    low, high = problem.bounds
    left = problem.whitened_residual(z)
    chi2 = float(left @ left)
    for _ in range(_COMPENSATING_STEPS):
        step = curvature.solve(at.tangents.pull(left), damping=_DAMPING)
        if step is None:
            break
        there = z.copy()
        there[moving] -= step
        there = np.clip(there, low, high)
        try:
            left = problem.whitened_residual(there)
        except Infeasible:
            break
        if not float(left @ left) < 0.99 * chi2:
            break
        z, chi2 = there, float(left @ left)
    return z


def with_both_effects(here: Fitted, alone: Fitted, start: Fitted, stop: Stop) -> Fitted | None:
    """Fit briefly with the effects of ``here`` and of ``alone``, both fitted from ``start``; None if that fails.

    The search starts with the base parameters moved by the sum of both fits' moves.  A start from a linear step would
    fail if the first effect makes the displacement follow the steps of a fringe.
    """
    first, other = here.problem, alone.problem
    new = tuple(kind for kind in other.effects if kind not in first.effects)
    problem = first.with_effects((*first.effects, *new), {**other.fixed, **first.fixed})
    z = np.empty(problem.size)
    z[: first.offset] = here.z[: first.offset] + alone.z[: first.offset] - start.z[: first.offset]
    found = {parameter: fitted.z[at] for fitted in (alone, here) for parameter, at in _places(fitted.problem).items()}
    for parameter, at in _places(problem).items():
        z[at] = found[parameter]
    if stop():
        raise Cancelled
    try:
        return problem.fit_once(z, evaluations=_COMPARING, cancelled=stop)
    except _NO_FIT:
        return None


def _places(problem: Problem) -> dict[tuple[Effect, str, int], int]:
    """Return the index in the vector of each effect parameter: (effect, parameter, shot or -1 if shared)."""
    return {
        (effect, free.name, shot): at for at, (effect, free, shot) in enumerate(problem.free_parameters, problem.offset)
    }

"""Short fits with one more effect: from its best-scored start values, or from the fit that found it alone."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.arrow import Arrow
from analysis.inference.fit.effective_parameters import Point, to_effective
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis import Hypothesis
from analysis.inference.fit.hypothesis_fit import Fitted, finish, search, whitened_residual
from analysis.inference.fit.least_squares import Minimum, Square
from analysis.inference.screen.columns import fixed_of
from analysis.inference.screen.projector import Projector
from analysis.shot import Cancelled, Stop

Floats = NDArray[np.float64]
_SHORT = 7  # evaluations of a fit that only compares
_FAR_BEHIND = 300.0  # BIC behind the other fit at which a search that promises little more is stopped
_START_SHARES = (1.0, 0.3, 0.1)  # of the start amplitude, tried in turn
_COMPENSATING_STEPS = 4  # steps at most
_LEAST_SINGULAR = 1e-4  # of the largest singular value: directions with less are not moved


def refit(
    at: Projector, kind: TrialEffect, start: Sequence[Mapping[str, float]], stop: Stop, *, least_bic: float = math.inf
) -> Fitted | None:
    """Fit briefly with one more effect from its start values, one set for each shot; None where no trajectory exists.

    ``least_bic`` is the criterion of the fit that it is compared with: a search far behind it is stopped early.
    """
    here = at.fitted
    hypothesis = Hypothesis(
        here.hypothesis.data,
        (*here.hypothesis.effects, kind),
        {**here.hypothesis.fixed, kind.effect: fixed_of(kind, start[0])},
    )
    effective = to_effective(here.point)
    low, high = hypothesis.bounds
    if stop():
        raise Cancelled

    def hopeless(z: Floats, square: Square) -> bool:
        so_far = finish(hypothesis, Minimum(z, square, False, 0), here.floor)
        return so_far.bic > least_bic + _FAR_BEHIND

    stop_early = hopeless if math.isfinite(least_bic) else None
    for share in _START_SHARES:  # a linear step may lead to where there is no trajectory
        weaker = [times(kind, given, share) for given in start]
        values = tuple({**v, kind.effect: given} for v, given in zip(effective.values, weaker, strict=True))
        try:
            z = np.clip(hypothesis.pack_effective(Point(effective.base, effective.own, values)), low, high)
            z = _compensated(at, hypothesis, z)
            found = search(hypothesis, z, here.floor, evaluations=_SHORT, hopeless=stop_early, cancelled=stop)
            return finish(hypothesis, found, here.floor)
        except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
            continue
    return None


def _compensated(at: Projector, hypothesis: Hypothesis, z: Floats) -> Floats:
    """Return ``z`` with the parameters fitted before moved to compensate for the new effect, by linear steps.

    The effect's whole displacement may be a thousand times the part that the fitted parameters cannot compensate.
    """
    before = at.fitted.hypothesis
    places = {
        (effect, free.name, shot): hypothesis.offset + k
        for k, (effect, free, shot) in enumerate(hypothesis.free_parameters)
    }
    free_parameters = [places[effect, free.name, shot] for effect, free, shot in before.free_parameters]
    moving = np.array([*range(before.offset), *free_parameters])
    compensation = at.once("compensation", lambda: _compensation(at.tangents))
    low, high = hypothesis.bounds
    left = whitened_residual(hypothesis, at.floor, z)
    chi2 = float(left @ left)
    for _ in range(_COMPENSATING_STEPS):
        there = z.copy()
        there[moving] -= compensation(left)
        there = np.clip(there, low, high)
        try:
            left = whitened_residual(hypothesis, at.floor, there)
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


def times(kind: TrialEffect, values: Mapping[str, float], factor: float) -> Mapping[str, float]:
    """Return an effect's values at ``factor`` times its strength, to first order."""
    factor = 1 / factor if kind.inverse else factor
    return {**values, **{name: values[name] * factor for name in kind.amplitude}}


def with_both_effects(here: Fitted, alone: Fitted, start: Fitted, stop: Stop) -> Fitted | None:
    """Fit briefly with the effects of ``here`` and of ``alone``, both grown from ``start``; None where that fails.

    The search begins with the base parameters moved by the sum of both fits' moves.  A start from a linear step would
    fail where the first effect makes the displacement follow the steps of a fringe.
    """
    first, other = here.hypothesis, alone.hypothesis
    new = tuple(kind for kind in other.effects if kind not in first.effects)
    hypothesis = Hypothesis(first.data, (*first.effects, *new), {**other.fixed, **first.fixed})
    low, high = hypothesis.bounds
    z = np.empty(hypothesis.size)
    z[: first.offset] = here.z[: first.offset] + alone.z[: first.offset] - start.z[: first.offset]
    found = {**_free_parameters(alone), **_free_parameters(here)}
    for k, (effect, free, shot) in enumerate(hypothesis.free_parameters, first.offset):
        z[k] = found[effect, free.name, shot]
    if stop():
        raise Cancelled
    try:
        ended = search(hypothesis, np.clip(z, low, high), here.floor, evaluations=_SHORT, cancelled=stop)
        return finish(hypothesis, ended, here.floor)
    except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
        return None


def _free_parameters(fitted: Fitted) -> dict[tuple[Effect, str, int], float]:
    """Return the search coordinates of a fit's effects by (effect, parameter, shot)."""
    hypothesis = fitted.hypothesis
    return {
        (effect, free.name, shot): float(fitted.z[k])
        for k, (effect, free, shot) in enumerate(hypothesis.free_parameters, hypothesis.offset)
    }

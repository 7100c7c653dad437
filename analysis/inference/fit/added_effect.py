"""A fit with one effect more: from where it scored best, or from where it was found alone."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects.row import Effect
from analysis.collision.parameters import Infeasible
from analysis.inference.fit.arrow import Arrow
from analysis.inference.fit.effective_parameters import Point, to_effective
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis import Hypothesis
from analysis.inference.fit.hypothesis_fit import Fitted, finish, search, whitened_residual
from analysis.inference.fit.least_squares import Minimum, Square
from analysis.inference.screen.columns import fixed_of
from analysis.inference.screen.projector import Projector
from analysis.shot.shot import Cancelled, Stop

Floats = NDArray[np.float64]
_SHORT = 7  # evaluations of a search that only compares
_GIVEN_UP = 300.0  # of the criterion behind another fit: such a search is left where it promises little
_OF_THE_START = (1.0, 0.3, 0.1)
_ROOM = 4  # steps at most
_HARDLY = 1e-4  # of what the parameters together do most: so little need not give way


def refit(
    at: Projector, kind: TrialEffect, start: Sequence[Mapping[str, float]], stop: Stop, *, least_bic: float = math.inf
) -> Fitted | None:
    """Fit quickly with one effect more from its start values a shot; None where there is no trajectory.

    ``least_bic`` is the criterion of a fit that it is compared with: far behind, it is not followed to its end.
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
        return so_far.bic > least_bic + _GIVEN_UP

    asked = hopeless if math.isfinite(least_bic) else None
    for share in _OF_THE_START:  # a linear step may lead further than any trajectory goes
        weaker = [times(kind, given, share) for given in start]
        values = tuple({**v, kind.effect: given} for v, given in zip(effective.values, weaker, strict=True))
        try:
            z = np.clip(hypothesis.pack_effective(Point(effective.base, effective.own, values)), low, high)
            z = _made_room(at, hypothesis, z)
            found = search(hypothesis, z, here.floor, evaluations=_SHORT, hopeless=asked, cancelled=stop)
            return finish(hypothesis, found, here.floor)
        except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
            continue
    return None


def _made_room(at: Projector, hypothesis: Hypothesis, z: Floats) -> Floats:
    """Return ``z`` with what was fitted before moved out of the new effect's way, by the derivatives at hand.

    An effect may do a thousand times more than what it does beside the base parameters.
    """
    before = at.fitted.hypothesis
    places = {
        (effect, free.name, shot): hypothesis.offset + k
        for k, (effect, free, shot) in enumerate(hypothesis.free_parameters)
    }
    free_parameters = [places[effect, free.name, shot] for effect, free, shot in before.free_parameters]
    moving = np.array([*range(before.offset), *free_parameters])
    giving_way = at.once("giving way", lambda: _giving_way(at.tangents))
    low, high = hypothesis.bounds
    left = whitened_residual(hypothesis, at.floor, z)
    chi2 = float(left @ left)
    for _ in range(_ROOM):
        there = z.copy()
        there[moving] -= giving_way(left)
        there = np.clip(there, low, high)
        try:
            left = whitened_residual(hypothesis, at.floor, there)
        except Infeasible:
            break
        if not float(left @ left) < 0.99 * chi2:
            break
        z, chi2 = there, float(left @ left)
    return z


def _giving_way(tangents: Arrow) -> Callable[[Floats], Floats]:
    """Return what turns a remainder, shape (rows,), into the moves of the parameters that leave it.

    What hardly shows does not move.
    """
    gram = tangents.gram()
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    level, turn = np.linalg.eigh(gram / np.outer(scale, scale))
    some = level > _HARDLY**2 * level[-1]
    return lambda left: (turn[:, some] @ (turn[:, some].T @ (tangents.pull(left) / scale) / level[some])) / scale


def times(kind: TrialEffect, values: Mapping[str, float], factor: float) -> Mapping[str, float]:
    """Return an effect's values at which it does ``factor`` times what it did, in first order."""
    factor = 1 / factor if kind.inverse else factor
    return {**values, **{name: values[name] * factor for name in kind.amplitude}}


def united(here: Fitted, alone: Fitted, start: Fitted, stop: Stop) -> Fitted | None:
    """Fit quickly with what ``here`` and ``alone`` each found beyond ``start``; None where there is no trajectory.

    Both moved the base: to first order it goes both ways.  Where the first effect shows every step of a fringe, a
    search from the second's first order goes nowhere.
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

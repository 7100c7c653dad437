"""What an effect's starts do to the shots, and what of that is new beside a fit: the columns that are scored.

A start is followed along a trajectory of its own; where there are many, along the fit's path to first order.
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects.row import Effect
from analysis.collision.linear_path import LinearPath
from analysis.collision.parameters import Infeasible
from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit.effective_parameters import Point, to_actual, to_effective
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis import Hypothesis
from analysis.inference.fit.samples import Samples
from analysis.inference.screen import first_order
from analysis.inference.screen.columns_beside import ColumnsBeside, column_by_column
from analysis.inference.screen.projector import FEW_SHOTS, Projector

Floats = NDArray[np.float64]
Starts = Sequence[Mapping[str, float]]
Paths = dict[int, LinearPath]  # by steps a sample
MANY_STARTS = 8  # from here on a path with propagators costs less than a trajectory a start
KNOWN_PATH = 1  # the same where the path is there already


@dataclass(frozen=True, slots=True)
class Seen:
    """What columns of ``starts`` do beside a fit, each of shape (k,).

    Squared norms as they are (``whole``) and of what the fitted parameters cannot do (``power``), and the products with
    what is left (``along``).
    """

    starts: list[Mapping[str, float]]
    whole: Floats
    power: Floats
    along: Floats


@dataclass(frozen=True, slots=True)
class _OfShot:
    """What one shot adds to ``Seen``: squared norms, those of its own parameters' part, and products, (s, k) and (k,).

    The products are with the directions of the shared parameters and with what is left.
    """

    whole: Floats
    own: Floats
    shared: Floats
    along: Floats


def seen(at: Projector, kind: TrialEffect, starts: Starts, few: int, *, kept: bool = False) -> Seen:
    """Return what the starts that have a trajectory do beside a fit; more than ``few`` are taken to first order.

    Shot by shot: what columns hold is forgotten, unless they are ``kept`` and few, or the shots are.
    """
    count = len(at.fitted.hypothesis.data.shots)
    inside = _inside(at, starts)
    remember = kept and (count <= FEW_SHOTS or len(inside) <= few)

    def total(columns: Callable[[int], Floats | None], how: str) -> Seen | None:
        def of_shot(index: int) -> _OfShot | None:
            key = f"{how} of {kind.effect.key}, shot {index}"
            bare = at.once(key, partial(columns, index), nearby=True) if remember else columns(index)
            if bare is None:
                return None
            whiten = partial(ColumnsBeside.of, at.fitted.hypothesis.data.shots[index], at.floor, bare)
            return _of_shot(at, index, at.once(key, whiten) if remember else whiten())

        return _summed(inside, side_by_side(of_shot, range(count)))

    found = None
    if len(inside) > few:
        with contextlib.suppress(Infeasible):
            found = total(lambda index: _to_first_order(at, kind, inside, index), "first order")
    if found is None:
        moved = [_moved(at, kind, start) for start in inside]
        found = total(lambda index: _by_trajectories(at, kind, moved, index), "trajectories")
    assert found is not None
    return found


def laid(at: Projector, kinds: Sequence[TrialEffect]) -> dict[Effect, Seen]:
    """Return what those effects do that are taken to first order along the same paths, by effect; of many shots alone.

    A shot's path, some 15 MB, serves all effects and is forgotten then.
    """
    count = len(at.fitted.hypothesis.data.shots)
    inside = {kind.effect: _inside(at, kind.starts) for kind in kinds if kind.effect.wave is None}
    many = [kind for kind in kinds if not kind.own and len(inside.get(kind.effect, ())) > MANY_STARTS]
    if count <= FEW_SHOTS:
        return {}

    def of_shot(index: int) -> dict[Effect, _OfShot]:
        paths: Paths = {}
        out = {}
        for kind in many:
            with contextlib.suppress(Infeasible):
                bare = _to_first_order(at, kind, inside[kind.effect], index, paths)
                if bare is not None:
                    white = ColumnsBeside.of(at.fitted.hypothesis.data.shots[index], at.floor, bare)
                    out[kind.effect] = _of_shot(at, index, white)
        return out

    each = side_by_side(of_shot, range(count))
    every = {kind.effect: _summed(inside[kind.effect], [one.get(kind.effect) for one in each]) for kind in many}
    return {effect: found for effect, found in every.items() if found is not None}


def own_columns(at: Projector, kind: TrialEffect, starts: Starts) -> list[Floats] | None:
    """Return what ``starts`` do to each shot by trajectories, shape (n, k) a shot; None where one has none."""
    moved = [_moved(at, kind, start) for start in starts]
    makes = [partial(_by_trajectories, at, kind, moved, index) for index in range(len(at.lines))]
    bare = [at.once(f"{index} of {kind.effect.key} {starts}", make, nearby=True) for index, make in enumerate(makes)]
    return bare if all(np.all(np.isfinite(columns)) for columns in bare) else None


def within(start: Mapping[str, float], shots: Sequence[Samples]) -> bool:
    """Return whether a start's line, if it has one, lies within what the records can show."""
    f = start.get("frequency_hz")
    return f is None or 2.5 / max(s.length_s for s in shots) < f < 0.45 / shots[0].spacing_s


def fixed_of(kind: TrialEffect, start: Mapping[str, float]) -> Mapping[str, float]:
    """Return the values of a start that are not searched."""
    names = {free.name for free in kind.free_parameters}
    return {name: value for name, value in start.items() if name not in names}


def _inside(at: Projector, starts: Starts) -> list[Mapping[str, float]]:
    return [start for start in starts if within(start, at.fitted.hypothesis.data.shots)]


def _of_shot(at: Projector, index: int, columns: ColumnsBeside) -> _OfShot:
    own, shared, left = at.basis.own[index], at.basis.shared[index], at.tangents.parts(at.left)[index]
    products = columns.products_with(np.column_stack([own, shared, left]))
    of_own, of_shared, along = np.split(products, [own.shape[1], own.shape[1] + shared.shape[1]])
    return _OfShot(columns.products(), column_by_column(of_own, of_own), of_shared, along[0])


def _summed(starts: list[Mapping[str, float]], found: Sequence[_OfShot | None]) -> Seen | None:
    """Return what all shots together say, of the starts that have a trajectory; None where a shot says nothing."""
    every = [one for one in found if one is not None]
    if len(every) < len(found):
        return None
    whole, own, along = (np.sum([getattr(one, name) for one in every], axis=0) for name in ("whole", "own", "along"))
    shared = np.sum([one.shared for one in every], axis=0)
    power = whole - own - np.einsum("ij,ij->j", shared, shared)
    good = np.flatnonzero(np.isfinite(whole))
    return Seen([starts[int(k)] for k in good], whole[good], power[good], along[good])


def _moved(at: Projector, kind: TrialEffect, start: Mapping[str, float]) -> Point | None:
    """Return a fit's point with an effect's start beside it, None where there is no such thing."""
    effective = to_effective(at.fitted.point)
    values = tuple({**v, kind.effect: start} for v in effective.values)
    try:
        return to_actual(Point(effective.base, effective.own, values))
    except Infeasible:
        return None


def moved_to(at: Projector, kind: TrialEffect, starts: Starts) -> Point | None:
    """Return a fit's point with an effect's start of each shot beside it, None where there is no such thing."""
    effective = to_effective(at.fitted.point)
    values = tuple({**v, kind.effect: start} for v, start in zip(effective.values, starts, strict=True))
    try:
        return to_actual(Point(effective.base, effective.own, values))
    except Infeasible:
        return None


def shown_with(at: Projector, kind: TrialEffect, point: Point, index: int) -> Floats:
    """Return what an effect, with its values in ``point``, adds to one shot's averaged samples, shape (n,).

    Raises Infeasible where the shot has no trajectory with it.
    """
    with_it, finely, base = _with_and_without(at, kind, index)
    return _shown(with_it, index, point, finely) - base


def _by_trajectories(at: Projector, kind: TrialEffect, moved: Sequence[Point | None], index: int) -> Floats:
    """Return what points with an effect add to one shot, shape (n, k), not a number where one has no trajectory."""
    with_it, finely, base = _with_and_without(at, kind, index)
    out = np.full((base.size, len(moved)), np.nan)
    for k, point in enumerate(moved):
        if point is not None:
            with contextlib.suppress(Infeasible):
                out[:, k] = _shown(with_it, index, point, finely) - base
    return out


def _with_and_without(at: Projector, kind: TrialEffect, index: int) -> tuple[Hypothesis, bool, Floats]:
    """Return the model with an effect, whether it is to be averaged like the data, and one shot without the effect."""
    before = at.fitted.hypothesis
    fixed = {**before.fixed, kind.effect: fixed_of(kind, kind.starts[0])}
    with_it = Hypothesis(before.data, (*before.effects, kind), fixed)
    # A sensor's ripple is finer than the averaged samples: it is averaged like the data.
    finely = kind.effect.sensor is not None
    show = partial(_shown, before, index, at.fitted.point, finely)
    return with_it, finely, at.once(f"seen without it {finely} {index}", show)


def _shown(hypothesis: Hypothesis, index: int, point: Point, finely: bool) -> Floats:
    return hypothesis.averaged(index, point) if finely else hypothesis.coarse(index, point)


def _to_first_order(
    at: Projector, kind: TrialEffect, starts: Starts, index: int, paths: Paths | None = None
) -> Floats | None:
    """Return the columns of starts for one shot to first order, shape (n, k), or None where that does not serve.

    Of many shots a path is remembered in ``paths`` alone.  Raises Infeasible.
    """
    effect, hypothesis, point = kind.effect, at.fitted.hypothesis, at.fitted.point
    shot = hypothesis.shot_at(index, point)
    steps = np.array(first_order.steps_for(hypothesis.shot_at(0, point), effect, starts))
    out = np.empty((shot.time_s.size, len(starts)))
    paths = {} if paths is None else paths
    for some in (int(one) for one in np.unique(steps)):
        if len(hypothesis.data.shots) <= FEW_SHOTS:
            path = at.once(f"path {index} {some}", partial(first_order.path_of, shot, some), nearby=True)
        else:
            path = paths[some] = paths.get(some) or first_order.path_of(shot, some)
        which = np.flatnonzero(steps == some)
        part = first_order.responses(shot, path, effect, [starts[int(k)] for k in which])
        if part is None or not np.all(np.isfinite(part)):
            return None
        out[:, which] = part
    return out

"""Columns to be scored: the displacement added by each start of an effect, and its part not absorbed by the fit.

A few starts are computed by one trajectory each; many are computed to first order along the fit's trajectory.
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.collision import Effect, Infeasible, LinearPath, first_order_change, steps_per_sample
from analysis.compiled import side_by_side
from analysis.inference.joint.weighted_model import WeightedModel
from analysis.inference.model.effective_parameters import Point, to_physical
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.model.response import ShotModel, change_shown
from analysis.inference.screen.projector import FEW_SHOTS, Projector
from analysis.inference.screen.whitened_columns import WhitenedColumns, column_by_column
from analysis.shot import Floats

Starts = Sequence[Mapping[str, float]]
Paths = dict[int, LinearPath]  # by steps per sample
MANY_STARTS = 8  # number of starts above which a linearised path costs less than one trajectory per start
KNOWN_PATH = 1  # the same if the path is already known
_ShotProducts = tuple[Floats, Floats, Floats, Floats]  # of ``_shot_products``


@dataclass(frozen=True, slots=True)
class ColumnProducts:
    """Squared norms of the columns of ``starts`` and their products with a fit's residual, each of shape (k,).

    ``whole``: squared norms; ``power``: squared norms after projection off the fitted parameters; ``along``: products
    with the residual.
    """

    starts: list[Mapping[str, float]]
    whole: Floats
    power: Floats
    along: Floats


def column_products(
    at: Projector, kind: TrialEffect, starts: Starts, few: int, *, kept: bool = False
) -> ColumnProducts:
    """Return the products for all starts that have a trajectory; more than ``few`` are computed to first order.

    The shots are processed one by one, to save memory.  Columns are cached only with ``kept`` and few starts or shots.
    """
    count = len(at.problem.data.shots)
    inside = _inside(at, starts)
    remember = kept and (count <= FEW_SHOTS or len(inside) <= few)

    def total(columns: Callable[[int], Floats | None], how: str) -> ColumnProducts | None:
        def of_shot(index: int) -> _ShotProducts | None:
            key = f"{how} of {kind.effect.key}, shot {index}"
            bare = at.once(key, partial(columns, index), nearby=True) if remember else columns(index)
            if bare is None:
                return None
            whiten = partial(WhitenedColumns.of, at.problem.data.shots[index], at.noise, bare)
            return _shot_products(at, index, at.once(key, whiten) if remember else whiten())

        return _sum_over_shots(inside, side_by_side(of_shot, range(count)))

    found = None
    if len(inside) > few:
        with contextlib.suppress(Infeasible):
            found = total(lambda index: _to_first_order(at, kind, inside, index), "first order")
    if found is None:
        moved = [_moved(at, kind, [start] * count) for start in inside]
        found = total(lambda index: _by_trajectories(at, kind, moved, index), "trajectories")
    assert found is not None
    return found


def products_along_paths(at: Projector, kinds: Sequence[TrialEffect]) -> dict[Effect, ColumnProducts]:
    """Return the products of all effects with many starts, to first order along common paths, by effect.

    Empty for few shots.  A shot's path, about 15 MB, is used for all effects and then released.
    """
    count = len(at.problem.data.shots)
    if count <= FEW_SHOTS:
        return {}
    inside = {kind.effect: _inside(at, kind.starts) for kind in kinds if kind.effect.wave is None}
    many = [kind for kind in kinds if not kind.own and len(inside.get(kind.effect, ())) > MANY_STARTS]

    def of_shot(index: int) -> dict[Effect, _ShotProducts]:
        paths: Paths = {}
        out = {}
        for kind in many:
            with contextlib.suppress(Infeasible):
                bare = _to_first_order(at, kind, inside[kind.effect], index, paths)
                if bare is not None:
                    white = WhitenedColumns.of(at.problem.data.shots[index], at.noise, bare)
                    out[kind.effect] = _shot_products(at, index, white)
        return out

    each = side_by_side(of_shot, range(count))
    every = {kind.effect: _sum_over_shots(inside[kind.effect], [one.get(kind.effect) for one in each]) for kind in many}
    return {effect: found for effect, found in every.items() if found is not None}


def own_columns(at: Projector, kind: TrialEffect, starts: Starts) -> list[Floats] | None:
    """Return the columns of ``starts`` by trajectories, shape (n, k) per shot; None if one has no trajectory."""
    moved = [_moved(at, kind, [start] * len(at.lines)) for start in starts]
    makes = [partial(_by_trajectories, at, kind, moved, index) for index in range(len(at.lines))]
    bare = [at.once(f"{index} of {kind.effect.key} {starts}", make, nearby=True) for index, make in enumerate(makes)]
    return bare if all(np.all(np.isfinite(columns)) for columns in bare) else None


def _inside(at: Projector, starts: Starts) -> list[Mapping[str, float]]:
    """Return the starts without a frequency or with one in the band of the records."""
    slowest, fastest = at.problem.data.band_hz
    return [start for start in starts if "frequency_hz" not in start or slowest < start["frequency_hz"] < fastest]


def _shot_products(at: Projector, index: int, columns: WhitenedColumns) -> _ShotProducts:
    """Return squared norms of one shot's columns, (k,), in total and along the shot's own parameters.

    Then come products with the directions of shared parameters, (s, k), and with the residual, (k,).
    """
    own, shared, left = at.basis.own[index], at.basis.shared[index], at.tangents.parts(at.left)[index]
    products = columns.products_with(np.column_stack([own, shared, left]))
    of_own, of_shared, along = np.split(products, [own.shape[1], own.shape[1] + shared.shape[1]])
    return columns.products(), column_by_column(of_own, of_own), of_shared, along[0]


def _sum_over_shots(starts: list[Mapping[str, float]], found: Sequence[_ShotProducts | None]) -> ColumnProducts | None:
    """Return the sums over all shots, for starts with a trajectory in each; None if a shot has no result."""
    every = [one for one in found if one is not None]
    if len(every) < len(found):
        return None
    with np.errstate(invalid="ignore"):  # a start may overflow, which makes its sums not finite
        whole, own, shared, along = (np.asarray(sum(parts)) for parts in zip(*every, strict=True))
        power = whole - own - np.einsum("ij,ij->j", shared, shared)
    good = np.flatnonzero(np.isfinite(whole) & np.isfinite(power) & np.isfinite(along))
    return ColumnProducts([starts[int(k)] for k in good], whole[good], power[good], along[good])


def _moved(at: Projector, kind: TrialEffect, starts: Starts) -> Point | None:
    """Return a fit's point with an effect added at one start per shot; None if Infeasible."""
    try:
        return to_physical(at.effective.with_effect(kind.effect, starts))
    except Infeasible:
        return None


def contribution_of(at: Projector, kind: TrialEffect, starts: Starts) -> list[Floats] | None:
    """Return an effect's contribution to each shot's averaged samples, (n,) each; None if there is no trajectory."""
    moved = [_moved(at, kind, starts)]
    columns = [_by_trajectories(at, kind, moved, index)[:, 0] for index in range(len(at.lines))]
    return columns if all(np.all(np.isfinite(column)) for column in columns) else None


def _by_trajectories(at: Projector, kind: TrialEffect, moved: Sequence[Point | None], index: int) -> Floats:
    """Return an effect's contribution to one shot at each point, shape (n, k); NaN if there is no trajectory."""
    before = at.problem
    with_it = before.with_effect(kind, kind.starts[0])
    # The ripple of a sensor's effect is finer than averaged samples: it is averaged like the data.
    finely = kind.effect.sensor is not None
    base = at.once(f"seen without it {finely} {index}", partial(_shown, before, index, at.point, finely))
    out = np.full((base.size, len(moved)), np.nan)
    for k, point in enumerate(moved):
        if point is not None:
            with contextlib.suppress(Infeasible):
                out[:, k] = _shown(with_it, index, point, finely) - base
    return out


def _shown(model: WeightedModel, index: int, point: Point, finely: bool) -> Floats:
    return model.averaged(index, point) if finely else model.coarse(index, point)


def _to_first_order(
    at: Projector, kind: TrialEffect, starts: Starts, index: int, paths: Paths | None = None
) -> Floats | None:
    """Return one shot's columns of ``starts`` to first order, shape (n, k); None if the effect cannot be linearised.

    With many shots a path is cached in ``paths`` only.  Raises Infeasible.
    """
    effect, problem, point = kind.effect, at.problem, at.point
    shot = problem.shot_at(index, point)
    first, values = problem.shot_at(0, point), [[start[p.name] for p in effect.parameters] for start in starts]
    steps = np.array([steps_per_sample(effect, given, first.collision, first.samples.spacing_s) for given in values])
    out = np.empty((shot.samples.centre_s.size, len(starts)))
    paths = {} if paths is None else paths
    for some in (int(one) for one in np.unique(steps)):
        if len(problem.data.shots) <= FEW_SHOTS:
            path = at.once(f"path {index} {some}", partial(shot.path, some), nearby=True)
        else:
            path = paths[some] = paths.get(some) or shot.path(some)
        which = np.flatnonzero(steps == some)
        part = change_to_first_order(shot, path, effect, [starts[int(k)] for k in which])
        if part is None or not np.all(np.isfinite(part)):
            return None
        out[:, which] = part
    return out


def change_to_first_order(shot: ShotModel, path: LinearPath, effect: Effect, starts: Starts) -> Floats | None:
    """Return the displacement added by each of ``starts`` as the optics show it, shape (n, k); 50 ns per value.

    None if the effect's function cannot be linearised in this way.
    """
    parameters = np.zeros((len(starts), 3))
    for place, parameter in enumerate(effect.parameters):
        parameters[:, place] = [start[parameter.name] for start in starts]
    change = first_order_change(path, effect, shot.collision, parameters, shot.samples.centre_s.size)
    return None if change is None else change_shown(shot, path, change)

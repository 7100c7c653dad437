"""The first-order response of a fitted shot to a small effect, as the optics show it, for all start values at once.

The mechanics are those of ``collision.solver.first_order`` along the shot's own path; the fit's sensor effects are then
applied.  All times are the centres of the averaged samples.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.collision import Effect, LinearPath, first_order_change
from analysis.collision import steps_per_sample as steps_of
from analysis.inference.model.optics import change_shown
from analysis.inference.model.response import ShotModel
from analysis.shot import Floats


def steps_for(shot: ShotModel, effect: Effect, starts: Sequence[Mapping[str, float]]) -> list[int]:
    """Return the steps per sample required by each start: powers of two, so that many starts share a path."""
    values = ([start[parameter.name] for parameter in effect.parameters] for start in starts)
    return [steps_of(effect, given, shot.collision, shot.samples.spacing_s) for given in values]


def parameter_columns(effect: Effect, starts: Sequence[Mapping[str, float]]) -> Floats:
    """Return the parameters of ``starts`` as arguments of an effect's function, shape (k, 3)."""
    out = np.zeros((len(starts), 3))
    for place, parameter in enumerate(effect.parameters):
        out[:, place] = [start[parameter.name] for start in starts]
    return out


def responses(
    shot: ShotModel, path: LinearPath, effect: Effect, starts: Sequence[Mapping[str, float]]
) -> Floats | None:
    """Return the displacement added by each of an effect's ``starts``, shape (n, k); about 50 ns per value.

    None if the effect's function cannot be linearised in this way.
    """
    count = shot.samples.centre_s.size
    change = first_order_change(path, effect, shot.collision, parameter_columns(effect, starts), count)
    return None if change is None else change_shown(shot, path, change)

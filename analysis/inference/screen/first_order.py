"""The first-order response of a fitted shot to a small effect, for all start values at once, as the optics show it.

The mechanics are those of ``collision.first_order`` along the shot's own path; the fit's sensor effects follow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision import Effect, LinearPath, V, X, along, linear_path
from analysis.collision import steps_for as steps_of
from analysis.inference.fit.situation import Optics, Values, shown_by_optics, situation
from analysis.shot import Floats

_STEP = 1e-40  # the complex step


@dataclass(frozen=True, slots=True)
class Shot:
    """One shot of a fit: sample times in s, and parameters by name."""

    time_s: Floats
    base: Floats
    own: Floats
    values: Values
    mass_kg: float
    optics: Optics


def path_of(shot: Shot, steps: int) -> LinearPath:
    """Return a shot's path in at least ``steps`` per sample; Infeasible where they would be too many."""
    collision, active = situation(shot.base, shot.own, shot.values, shot.mass_kg)
    return linear_path(collision, active, shot.time_s - shot.own[1], steps)


def steps_for(shot: Shot, effect: Effect, starts: Sequence[Mapping[str, float]]) -> list[int]:
    """Return the steps per sample that each start needs: powers of two, so that many share a path."""
    collision, _ = situation(shot.base, shot.own, {}, shot.mass_kg)
    spacing_s = float(shot.time_s[1] - shot.time_s[0])
    values = ([start[parameter.name] for parameter in effect.parameters] for start in starts)
    return [steps_of(effect, given, collision, spacing_s) for given in values]


def parameter_columns(effect: Effect, starts: Sequence[Mapping[str, float]]) -> Floats:
    """Return the parameters of ``starts`` in the form that an effect's function takes, shape (k, 3)."""
    out = np.zeros((len(starts), 3))
    for place, parameter in enumerate(effect.parameters):
        out[:, place] = [start[parameter.name] for start in starts]
    return out


def responses(shot: Shot, path: LinearPath, effect: Effect, starts: Sequence[Mapping[str, float]]) -> Floats | None:
    """Return the displacement that each of ``starts`` of an effect adds, shape (n, k); about 50 ns per value.

    None where the effect's function cannot be linearised in this way.
    """
    collision, _ = situation(shot.base, shot.own, shot.values, shot.mass_kg)
    change = along(path, effect, collision, parameter_columns(effect, starts), shot.time_s.size)
    if change is None:
        return None
    x, v = np.empty(shot.time_s.size), np.empty(shot.time_s.size)
    x[:], v[:] = path.effect_inputs[0, 0, X], path.effect_inputs[0, 0, V]
    at = path.sample >= 0
    x[path.sample[at]], v[path.sample[at]] = path.effect_inputs[at, 2, X], path.effect_inputs[at, 2, V]
    if all(effect.sensor is None for effect in shot.values):
        return change
    remembers = any(effect.remembers for effect in shot.values)
    moved = np.asarray(x[:, None] + 1j * _STEP * (change if remembers else 1.0), dtype=np.complex128)
    shown = np.asarray(shown_by_optics(moved, v, shot.time_s, shot.values, shot.optics).imag / _STEP)
    return shown if remembers else shown * change

"""The first-order response of a fitted shot to a small effect, for all start values at once, as the optics show it.

The mechanics are those of ``collision.first_order`` along the shot's own path; the fit's sensor effects follow.  All
times are the centres of the averaged samples.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from analysis.collision import Effect, LinearPath, Sensed, V, X, along, sensors
from analysis.collision import steps_for as steps_of
from analysis.inference.fit.response import ShotModel
from analysis.shot import Floats

_STEP = 1e-40  # the complex step


def steps_for(shot: ShotModel, effect: Effect, starts: Sequence[Mapping[str, float]]) -> list[int]:
    """Return the steps per sample that each start needs: powers of two, so that many share a path."""
    spacing_s = float(shot.samples.centre_s[1] - shot.samples.centre_s[0])
    values = ([start[parameter.name] for parameter in effect.parameters] for start in starts)
    return [steps_of(effect, given, shot.collision, spacing_s) for given in values]


def parameter_columns(effect: Effect, starts: Sequence[Mapping[str, float]]) -> Floats:
    """Return the parameters of ``starts`` in the form that an effect's function takes, shape (k, 3)."""
    out = np.zeros((len(starts), 3))
    for place, parameter in enumerate(effect.parameters):
        out[:, place] = [start[parameter.name] for start in starts]
    return out


def responses(
    shot: ShotModel, path: LinearPath, effect: Effect, starts: Sequence[Mapping[str, float]]
) -> Floats | None:
    """Return the displacement that each of ``starts`` of an effect adds, shape (n, k); about 50 ns per value.

    None where the effect's function cannot be linearised in this way.
    """
    count = shot.samples.centre_s.size
    change = along(path, effect, shot.collision, parameter_columns(effect, starts), count)
    if change is None or all(effect.sensor is None for effect in shot.values):
        return change
    x, v = np.empty(count), np.empty(count)
    x[:], v[:] = path.effect_inputs[0, 0, X], path.effect_inputs[0, 0, V]
    at = path.sample >= 0
    x[path.sample[at]], v[path.sample[at]] = path.effect_inputs[at, 2, X], path.effect_inputs[at, 2, V]
    remembers = any(effect.remembers for effect in shot.values)
    moved = np.asarray(x[:, None] + 1j * _STEP * (change if remembers else 1.0), dtype=np.complex128)
    shown = np.asarray(shown_by_optics(shot, moved, v).imag / _STEP)
    return shown if remembers else shown * change


def shown_by_optics(shot: ShotModel, x: Any, v: Floats) -> Any:
    """Return what the optics show of motions ``x``, shape (n,) or (n, k), after all effects of the sensor.

    ``v``, shape (n,), is the velocity about which ``x`` is taken.  The imaginary part of a complex ``x`` carries a
    derivative.
    """
    samples = shot.samples
    wavelength_m = math.nan if samples.wavelength_m is None else samples.wavelength_m
    sensed = Sensed(samples.centre_s, v, wavelength_m, samples.factor / samples.spacing_s)
    out = x.reshape(x.shape[0], math.prod(x.shape[1:]))
    for row in sensors(shot.values):
        assert row.sensor is not None
        given = shot.values[row]
        if (row.optical and samples.wavelength_m is None) or given[row.amplitude] == 0.0:
            continue
        p = np.zeros((max(3, len(row.parameters)), out.shape[1]), dtype=out.dtype)
        for place, parameter in enumerate(row.parameters):
            p[place] = given[parameter.name]
        out = row.sensor(sensed, out, p)
    return np.asarray(out).reshape(x.shape)

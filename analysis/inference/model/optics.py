"""The displacement shown by the optics for a motion and for a small change of it, after the shot's sensor effects.

All times are the centres of the averaged samples.
"""

import math
from typing import Any

import numpy as np

from analysis.collision import LinearPath, SensorInput, V, X, sensor_effects
from analysis.inference.model.response import ShotModel
from analysis.shot import Floats

_STEP = 1e-40  # the complex step


def change_shown(shot: ShotModel, path: LinearPath, change: Floats) -> Floats:
    """Return small changes, shape (n, k), of the block's position along a shot's ``path`` as the optics show them."""
    if all(effect.sensor is None for effect in shot.values):
        return change
    x, v = np.empty(len(change)), np.empty(len(change))
    x[:], v[:] = path.effect_inputs[0, 0, X], path.effect_inputs[0, 0, V]
    at = path.sample >= 0
    x[path.sample[at]], v[path.sample[at]] = path.effect_inputs[at, 2, X], path.effect_inputs[at, 2, V]
    remembers = any(effect.has_memory for effect in shot.values)
    moved = np.asarray(x[:, None] + 1j * _STEP * (change if remembers else 1.0), dtype=np.complex128)
    shown = np.asarray(shown_by_optics(shot, moved, v).imag / _STEP)
    return shown if remembers else shown * change


def shown_by_optics(shot: ShotModel, x: Any, v: Floats) -> Any:
    """Return motions ``x``, shape (n,) or (n, k), as the optics show them, after all sensor effects.

    ``v``, shape (n,), is the velocity of the unperturbed motion.  The imaginary part of a complex ``x`` carries a
    derivative.
    """
    samples = shot.samples
    wavelength_m = math.nan if samples.wavelength_m is None else samples.wavelength_m
    sensed = SensorInput(samples.centre_s, v, wavelength_m, samples.factor / samples.spacing_s)
    out = x.reshape(x.shape[0], math.prod(x.shape[1:]))
    for row in sensor_effects(shot.values):
        assert row.sensor is not None
        given = shot.values[row]
        if (row.optical and samples.wavelength_m is None) or given[row.amplitude] == 0.0:
            continue
        p = np.zeros((max(3, len(row.parameters)), out.shape[1]), dtype=out.dtype)
        for place, parameter in enumerate(row.parameters):
            p[place] = given[parameter.name]
        out = row.sensor(sensed, out, p)
    return np.asarray(out).reshape(x.shape)

"""What optics would show of one shot whose parameters are given by name."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects import named
from analysis.inference.fit.base import base_named
from analysis.inference.fit.response import DEFAULT_WAVELENGTH_M, Model, Response, ShotData, respond
from analysis.inference.fit.situation import Optics, fastest_shown

Floats = NDArray[np.float64]


def shown(
    time_s: Floats,
    base: Floats,
    own: Floats,
    values: Mapping[str, Mapping[str, float]],
    mass_kg: float,
    optics: Optics,
    stride: float = 2.0,
) -> Response:
    """Return the motion of the paper's two bodies with effects of these ``values``, by effect and parameter."""
    model = Model(base_named("paper"), tuple(named(name) for name in values), tuple(_flat(values).items()))
    given = _flat(values)
    shared = [*base, *(given[name] for name in model.shared_effect_names)]
    wavelength_m = optics.wavelength_m or DEFAULT_WAVELENGTH_M
    shot = ShotData(
        time_s, np.zeros(time_s.size), np.ones(time_s.size, np.bool_), mass_kg, None,
        wavelength_m, optics.sample_rate_hz, plate=(float(own[3]), float(own[4])) if own.size > 3 else (0.0, 0.0),
    )  # fmt: skip
    of_shot = [*own[:3], *(given[name] for name in model.own_names[3:])]
    fastest = fastest_shown(float(time_s[1] - time_s[0]), 1000)
    return respond(
        model, shot, np.array(shared), np.array(of_shot), derivatives=False, stride=stride, fastest_rad_per_s=fastest
    )


def _flat(values: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return values by "effect.parameter"."""
    return {f"{name}.{parameter}": value for name, given in values.items() for parameter, value in given.items()}

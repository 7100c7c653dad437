"""What optics would show of one shot whose parameters are given by name."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER, Infeasible
from analysis.inference.joint.search_vector import SearchVector
from analysis.inference.model.base import base_named
from analysis.inference.model.course import Course
from analysis.inference.model.response import Response, ShotModel, respond
from analysis.inference.model.samples import Samples

Floats = NDArray[np.float64]
_A_SAMPLE = 10  # samples of the record in each of ``time_s``


def model_of(
    time_s: Floats, base: Floats, own: Floats, values: Mapping[str, Mapping[str, float]], model: str = "paper"
) -> ShotModel:
    """Return a base model with effects of these ``values``, by effect and parameter, at the times of averages."""
    by_effect = {effect_named(name): given for name, given in values.items()}
    return ShotModel(samples_at(time_s, _A_SAMPLE), base_named(model), base, own, by_effect)


def samples_at(time_s: Floats, factor: int, block_mass_kg: float = PAPER.block_mass_kg) -> Samples:
    """Return averages of ``factor`` samples at these times, displacement zero."""
    fine, coarse = np.ones(time_s.size * factor, np.bool_), np.ones(time_s.size, np.bool_)
    spacing_s = float(time_s[1] - time_s[0])
    course = Course(0.0, 0.0, -0.2, 0.0, 0.0, 0.0, 0.0, slice(0), slice(0))
    grid_s = time_s[0] + spacing_s * ((np.arange(fine.size) + 0.5) / factor - 0.5)
    return Samples(
        grid_s, fine, factor, time_s, np.zeros(time_s.size), coarse, spacing_s, block_mass_kg, 632.8e-9, course, 1e-10
    )


def shown(
    time_s: Floats, base: Floats, own: Floats, values: Mapping[str, Mapping[str, float]], model: str = "paper"
) -> Response:
    """Return the motion of ``model_of``."""
    shot = model_of(time_s, base, own, values, model)
    if shot.too_fast:
        raise Infeasible("too fast")
    return respond(shot, time_s)


def whole_slope(problem: SearchVector, z: Floats) -> Floats:
    """Return the derivatives of all physical parameters by all entries of the vector, shape (size, size)."""
    out = np.zeros((problem.size, problem.size))
    for at, slope in zip(problem.places, problem.slopes(z), strict=True):
        out[np.ix_(at, at)] = slope
    return out

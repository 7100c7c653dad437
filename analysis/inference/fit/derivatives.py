"""One shot solved at a search vector, with exact derivatives: the integrator's tangents by the chain rule.

In some directions of the base model's parameters the displacement changes ten thousand times less than in others.
Finite differences of trajectories lose these directions in their error, and a search then stops in the middle of a
valley; the tangents carried along by the integrator do not.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.response import Model, Response, respond
from analysis.inference.fit.search_vector import SearchVector
from analysis.inference.fit.situation import Values, fastest_shown, too_fast
from analysis.shot import Floats

_LONG_STRIDE = 2.0  # step where a law is nonlinear: right to 0.05 pm, far below any noise


def solved(
    vector: SearchVector,
    index: int,
    point: Point,
    *,
    derivatives: bool = False,
    averaged: bool = True,
    centres: bool = False,
    laws: Sequence[Effect] = (),
) -> tuple[Model, Response]:
    """Return one shot's motion, averaged like the data or on the motion's own grid; Infeasible where there is none.

    With ``centres`` the motion is solved at the centres of the averaged samples, in longer steps where a law is
    nonlinear in the state.  ``laws`` act besides the vector's effects, with parameters that are not searched.

    Cost: 0.3 ms, with derivatives 0.5 to 1 ms; where a law is not linear in the state 1 to 2 ms and 4 to 11 ms.
    """
    values, shot = point.values[index], vector.data.shots[index]
    # The model can follow oscillations that no sample can show; a search must not go there.
    fastest = fastest_shown(shot.spacing_s, shot.factor)
    if laws:  # they have rates of their own, which no search can raise
        at, fastest = vector.shot_at(index, point), math.inf
        if too_fast(at.base, at.own, values, shot.moving_mass_kg, shot.spacing_s, shot.factor):
            raise Infeasible("something would swing faster than any record can show")
    model = vector.model(_chosen(vector, values), laws)
    searched = [(p.own, values[effect][p.name]) for _, effect, _, p in model.effect_parameters if not p.fixed]
    shared = [*point.base, *(value for is_own, value in searched if not is_own)]
    own = [*point.own[index], *(value for is_own, value in searched if is_own)]
    block = shot.factor if averaged and not centres else 1
    given = np.array(shared), np.array(own)
    if any(np.isnan(one).any() for one in given):
        raise Infeasible("a parameter is not a number")
    seen = shot.for_model
    return model, respond(
        model,
        replace(seen, time_s=shot.centre_s) if centres else seen,
        *given,
        derivatives=derivatives,
        stride=_LONG_STRIDE if centres else vector.stride,
        block=block,
        fastest_rad_per_s=fastest,
    )


def linearised_shot(
    vector: SearchVector, index: int, point: Point, slope: Floats, laws: Sequence[Effect] = ()
) -> tuple[Floats, Floats]:
    """Return one shot's averaged displacement, shape (n,), and its derivatives by its ``places``, shape (n, q).

    ``point`` holds the physical parameters of the vector, ``slope`` their derivatives by the vector (for all shots).
    """
    _, response = solved(vector, index, point, derivatives=True, laws=laws)
    at = vector.places[index]
    return response.displacement_m, response.derivatives @ slope[np.ix_(at, at)]


def _chosen(vector: SearchVector, values: Values) -> tuple[tuple[str, float], ...]:
    """Return the values that are not searched, from the point: scores try several orders of a cyclic error."""
    fixed = vector.fixed.items()
    return tuple((f"{effect.key}.{key}", values[effect][key]) for effect, given in fixed for key in given)

"""Start a search of the catalogue at the base model's fit, or at the readings of the collision."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.diagnosis.search.forward_selection import Trail, add_effects, better, forward_search
from analysis.diagnosis.search.wider_variants import contained_effects
from analysis.diagnosis.time_limit import Limit
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference import Fitted, Point, SearchStart, TrialEffect, first_guesses, joined
from analysis.shot import Stop

_SOFTENED = ((1.0, 1.0), (0.01, 0.1))  # factors on stiffness and damping of the contact as read


def accept(base: Fitted, catalogue: Sequence[TrialEffect], accepted: Sequence[Effect], stop: Stop) -> Fitted:
    """Return the base fit with the effects already in the model added."""
    kinds = {kind.effect: kind for kind in catalogue}
    for effect in accepted:
        if effect not in kinds:
            raise ValueError(f"no effect is called {effect.name!r}; there are {', '.join(e.name for e in kinds)}")
    held = contained_effects(accepted)
    return joined(base, [kinds[effect] for effect in accepted if effect not in held], stop)


def search_from_base(
    before: Fitted,
    given: SearchStart,
    catalogue: Sequence[TrialEffect],
    stop: Stop,
    *,
    most: int = CRITERIA.most_effects,
    limit: Limit | None = None,
    beat: float = math.inf,
) -> tuple[Fitted, Trail]:
    """Search for at most ``most`` effects; return best fit and trail.  ``given`` is the start of the base fit."""
    if not before.converged and given.left > CRITERIA.drawn_far:
        return _from_the_guess(before, catalogue, stop, limit)
    best, trail = forward_search(before, catalogue, stop, most=most, limit=limit, beat=beat)
    again = trail.of(before.effects)
    if again is not None and better(again, before):  # adding and removing an effect led to a better minimum of the base
        return forward_search(again, catalogue, stop, most=most, limit=limit, beat=beat)
    return best, trail


def _from_the_guess(
    before: Fitted, catalogue: Sequence[TrialEffect], stop: Stop, limit: Limit | None
) -> tuple[Fitted, Trail]:
    """Return the best fit with effects, started from the readings of the collision instead of the base model's fit.

    A missing effect a thousand times the noise drives base parameters to a bound, from which no step leads back.  The
    effect may also have spoilt the reading of the contact, so a softer contact is a second start.
    """
    problem = before.problem
    shots = problem.data.shots
    guess = first_guesses(problem.data.base, shots, stop)[0]
    own = np.array([shot.course.own for shot in shots])
    climbs = []
    for softer in _SOFTENED:
        contact = guess.copy()
        contact[problem.data.base.contact_at] *= softer
        point = problem.with_softened_contact(Point(contact, own, before.point.values))
        try:
            there = problem.fit_once(problem.pack(point), evaluations=1, cancelled=stop)
        except Infeasible:
            continue
        trail = Trail(before, catalogue, stop, limit=limit)
        best = add_effects(there, trail)
        if best is not there and best.bic < before.bic:
            climbs.append((best, trail))
    if climbs:
        return min(climbs, key=lambda climbed: climbed[0].bic)
    return forward_search(before, catalogue, stop, limit=limit)

"""Search of the catalogue under one noise model: wandering of the optical path, or frame motion due to a building.

The two look alike in flight, but not in contact.  A missing law bends flights as well and may look like either.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.diagnosis_input import DiagnosisInput
from analysis.diagnosis.evidence.residual import Residual, residual_of
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search.forward_selection import (
    Trail,
    add_effects,
    best_untried_pair,
    better,
    contained_effects,
    nearly_as_likely,
)
from analysis.diagnosis.search.full_rate import with_frame_response_updated
from analysis.inference import (
    STILL_FRAME,
    Fitted,
    Point,
    SearchStart,
    Site,
    TrialEffect,
    base_fit,
    first_guesses,
    frame_moves_far,
    joined,
    joint_data,
    per_shot_nuisances,
    white_floor,
    with_frame_relinearised,
)
from analysis.shot import Stop

_SOFTENED = ((1.0, 1.0), (0.01, 0.1))  # factors on stiffness and damping of the contact as read


@dataclass(frozen=True)
class SearchResult:
    """The best fit under one noise model, and the trail that led to it.

    ``rounds`` is the number of rounds left out; each might have added one effect.
    """

    best: Fitted
    trail: Trail
    rounds: int = 0

    @cached_property
    def residual(self) -> Residual:
        """Get the residual of the best fit."""
        return residual_of(self.best, self.trail.linearised(self.best))

    @property
    def leaves_something(self) -> bool:
        """Get whether the best fit leaves more than noise, and more than a trace that no effect explains."""
        return self.residual.leaves_something(nothing_pays=self.trail.nothing_pays)

    def to_convergence(self) -> "SearchResult":
        """Return the search after the rounds that were left out, where there is a residual to explain."""
        if not self.rounds or not self.residual.significant:
            return self
        return SearchResult(add_effects(self.best, self.trail, self.rounds), self.trail)

    def with_pairs(self) -> "SearchResult":
        """Return the search with the best pair of effects not yet tried jointly, where that is likelier."""
        pair = self.trail.within("two effects that hide each other", lambda: best_untried_pair(self.trail), None)
        return self if pair is None or pair.bic >= self.best.bic else replace(self, best=pair)


@dataclass(frozen=True, slots=True)
class Search:
    """A search of the catalogue of one ``question``; effects already in the model are part of every fit."""

    question: DiagnosisInput

    def under(self, site: Site, *, most: int = CRITERIA.most_effects, beat: float = math.inf) -> SearchResult:
        """Search under one noise model for at most ``most`` effects; frame motion belongs to ``site``, not to effects.

        A search that cannot come below ``beat``, the BIC of a likelier search, is not continued.
        """
        question, given, stop, limit = self.question, self.question.begin, self.question.stop, self.question.limit
        data = joint_data(question.shots, given, site)
        catalogue = [
            kind for kind in question.catalogue if kind.effect in question.accepted or not site.resembles(kind.effect)
        ]

        def along_with(along: Sequence[Effect]) -> tuple[Fitted, Trail]:
            base = base_fit(data, given, stop, along)
            start = accept(base, question.catalogue, question.accepted, stop)
            if question.accepted or frame_moves_far(start.problem):
                start = with_frame_relinearised(start, stop)
            question.progress("scoring the catalogue", 0.15)
            if not site.moves:
                return search_from_base(Trail(start, catalogue, stop, limit=limit, beat=beat), given, most)
            # A missing effect makes plates seem to move, which could pass for a second effect.
            first, trail = search_from_base(Trail(start, catalogue, stop, limit=limit), given, most=1)
            each = side_by_side(
                lambda fitted: with_frame_response_updated(fitted, trail), nearly_as_likely(first, trail)
            )
            first, trail = min(each, key=lambda updated: updated[0].bic)
            more = most - len(trail.added(first))
            best = add_effects(first, trail, more) if trail.added(first) else first
            return (best, trail) if best is first else with_frame_response_updated(best, trail)

        along = per_shot_nuisances(data.shots, CRITERIA.own_flights)
        best, trail = along_with(along)
        if along:  # accelerations fitted per shot may absorb one law common to all shots
            plain, plain_trail = along_with(())
            own_needed = plain.bic > best.bic and _nuisances_pay(best, along, stop)
            in_time = plain_trail.compared or not trail.compared  # a search cut short does not replace a complete one
            if in_time and not own_needed:
                best, trail = plain, plain_trail
        added = len(trail.added(best))
        return SearchResult(best, trail, CRITERIA.most_effects - added if added >= most else 0)

    def base_without_frame_motion(self) -> Fitted:
        """Return the base model's fit without frame motion.  Raises AnalysisError where there is none."""
        given = self.question.begin
        return base_fit(joint_data(self.question.shots, given, STILL_FRAME), given, self.question.stop)

    def likelier_without_frame_motion(self, best: Fitted) -> bool:
        """Return whether the shots are likelier without frame motion, given the same effects; costs one more fit.

        An effect that bends flights can be mistaken for frame motion.  The strengths of that motion, learned with a
        base model that lacks the effect, are uncertain; a fit may end with the touch wrong by ten times the noise.
        """
        if not best.effects:
            return False
        data = joint_data(self.question.shots, self.question.begin, STILL_FRAME)
        rms_m = math.sqrt(float(np.mean(np.concatenate(best.residual_m) ** 2)))
        still = replace(best.problem, data=data, noise=white_floor(rms_m, best.noise.spacing_s))
        return still.fit(best.z, cancelled=self.question.stop).bic < best.bic


def _nuisances_pay(best: Fitted, nuisances: Sequence[Effect], stop: Stop) -> bool:
    """Return whether the ``nuisances`` effects lower the BIC, given the other effects of a fit."""
    point = best.point
    kinds = (kind for kind in best.problem.effects if kind.effect not in nuisances)
    bare = best.problem.with_effects(kinds, best.problem.fixed)
    values = tuple({effect: v for effect, v in of.items() if effect not in nuisances} for of in point.values)
    try:
        return best.bic < bare.fit(bare.pack(Point(point.base, point.own, values)), cancelled=stop).bic
    except Infeasible:
        return True


def accept(base: Fitted, catalogue: Sequence[TrialEffect], accepted: Sequence[Effect], stop: Stop) -> Fitted:
    """Return the base fit with the effects already in the model added."""
    kinds = {kind.effect: kind for kind in catalogue}
    for effect in accepted:
        if effect not in kinds:
            raise ValueError(f"no effect is called {effect.name!r}; there are {', '.join(e.name for e in kinds)}")
    held = contained_effects(accepted)
    return joined(base, [kinds[effect] for effect in accepted if effect not in held], stop)


def search_from_base(trail: Trail, given: SearchStart, most: int = CRITERIA.most_effects) -> tuple[Fitted, Trail]:
    """Search for at most ``most`` effects; return best fit and trail.  ``given`` is the start of the base fit."""
    before = trail.start
    if not before.converged and given.left > CRITERIA.drawn_far:
        return _from_the_guess(trail)
    best = add_effects(before, trail, most)
    again = trail.of(before.effects)
    if again is not None and better(again, before):  # adding and removing an effect led to a better minimum of the base
        trail = trail.begun_at(again)
        best = add_effects(again, trail, most)
    return best, trail


def _from_the_guess(search: Trail) -> tuple[Fitted, Trail]:
    """Return the best fit with effects, started from the readings of the collision instead of the base model's fit.

    A missing effect a thousand times the noise drives base parameters to a bound, from which no step leads back.  The
    effect may also have spoilt the reading of the contact, so a softer contact is a second start.
    """
    before, problem = search.start, search.start.problem
    shots = problem.data.shots
    guess = first_guesses(problem.data.base, shots, search.stop)[0]
    own = np.array([shot.course.own for shot in shots])
    climbs = []
    for softer in _SOFTENED:
        contact = guess.copy()
        contact[problem.data.base.contact_at] *= softer
        point = problem.with_softened_contact(Point(contact, own, before.point.values))
        try:
            there = problem.fit_once(problem.pack(point), evaluations=1, cancelled=search.stop)
        except Infeasible:
            continue
        trail = search.begun_at(before)
        best = add_effects(there, trail)
        if best is not there and best.bic < before.bic:
            climbs.append((best, trail))
    if climbs:
        return min(climbs, key=lambda climbed: climbed[0].bic)
    return add_effects(before, search), search

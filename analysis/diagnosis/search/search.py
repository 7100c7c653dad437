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
from analysis.diagnosis.search.forward_selection import Trail, add_effects, best_untried_pair, nearly_as_likely
from analysis.diagnosis.search.full_rate import with_frame_response_updated
from analysis.diagnosis.search.search_starts import accept, search_from_base
from analysis.diagnosis.time_limit import Limit
from analysis.diagnosis.verdict.conclusion import leaves_something
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.residual import Residual, residual_of
from analysis.inference import (
    Fitted,
    Point,
    Samples,
    SearchStart,
    Site,
    TrialEffect,
    base_fit,
    joint_data,
    per_shot_nuisances,
    resembles_frame_motion,
    white_floor,
    with_frame_relinearised,
)
from analysis.shot import Progress, Stop


@dataclass(frozen=True)
class SearchResult:
    """The best fit under one noise model, the trail that led to it, and the catalogue that was searched.

    ``rounds`` is the number of rounds left out; each might have added one effect.
    """

    best: Fitted
    trail: Trail
    catalogue: Sequence[TrialEffect]
    rounds: int = 0

    @cached_property
    def residual(self) -> Residual:
        """Get the residual of the best fit."""
        return residual_of(self.best, self.trail.linearised(self.best))

    @property
    def leaves_something(self) -> bool:
        """Get whether the best fit leaves more than noise, and more than a trace that no effect explains."""
        return leaves_something(self.residual, nothing_pays=self.trail.nothing_pays)

    def to_convergence(self) -> "SearchResult":
        """Return the search after the rounds that were left out, where there is a residual to explain."""
        if not self.rounds or not self.residual.significant:
            return self
        return SearchResult(add_effects(self.best, self.trail, self.rounds), self.trail, self.catalogue)

    def with_pairs(self) -> "SearchResult":
        """Return the search with the best pair of effects not yet tried jointly, where that is likelier."""
        pair = self.trail.within("two effects that hide each other", lambda: best_untried_pair(self.trail), None)
        return self if pair is None or pair.bic >= self.best.bic else replace(self, best=pair)


@dataclass(frozen=True, slots=True)
class Search:
    """A search of averaged ``shots``: the base fit starts at ``given``, ``accepted`` effects are part of the model."""

    shots: tuple[Samples, ...]
    given: SearchStart
    catalogue: Sequence[TrialEffect]
    accepted: Sequence[Effect]
    tell: Progress
    stop: Stop
    limit: Limit | None = None

    def under(self, site: Site | None, *, most: int = CRITERIA.most_effects, beat: float = math.inf) -> SearchResult:
        """Search under one noise model for at most ``most`` effects; frame motion belongs to ``site``, not to effects.

        A search that cannot come below ``beat``, the BIC of a likelier search, is not continued.
        """
        data = joint_data(self.shots, self.given, site)
        catalogue = [
            kind
            for kind in self.catalogue
            if site is None or kind.effect in self.accepted or not resembles_frame_motion(kind.effect)
        ]

        def along_with(along: Sequence[Effect]) -> tuple[Fitted, Trail]:
            base = base_fit(data, self.given, self.stop, along)
            start = accept(base, self.catalogue, self.accepted, self.stop)
            start = with_frame_relinearised(start, self.stop) if self.accepted else start
            self.tell("scoring the catalogue", 0.15)
            if site is None:
                return search_from_base(start, self.given, catalogue, self.stop, most=most, limit=self.limit, beat=beat)
            # A missing effect makes plates seem to move, which could pass for a second effect.
            first, trail = search_from_base(start, self.given, catalogue, self.stop, most=1, limit=self.limit)
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
            own_needed = plain.bic > best.bic and _nuisances_pay(best, along, self.stop)
            in_time = plain_trail.compared or not trail.compared  # a search cut short does not replace a complete one
            if in_time and not own_needed:
                best, trail = plain, plain_trail
        added = len(trail.added(best))
        return SearchResult(best, trail, catalogue, CRITERIA.most_effects - added if added >= most else 0)

    def base_without_frame_motion(self) -> Fitted:
        """Return the base model's fit without frame motion.  Raises AnalysisError where there is none."""
        return base_fit(joint_data(self.shots, self.given, None), self.given, self.stop)

    def likelier_without_frame_motion(self, best: Fitted) -> bool:
        """Return whether the shots are likelier without frame motion, given the same effects; costs one more fit.

        An effect that bends flights can be mistaken for frame motion.  The strengths of that motion, learnt with a
        base model that lacks the effect, are uncertain; a fit may end with the touch wrong by ten times the noise.
        """
        if not best.effects:
            return False
        data = joint_data(self.shots, self.given, None)
        rms_m = math.sqrt(float(np.mean(np.concatenate(best.residual_m) ** 2)))
        still = replace(best.problem, data=data, noise=white_floor(rms_m, best.noise.spacing_s))
        return still.fit(best.z, cancelled=self.stop).bic < best.bic


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

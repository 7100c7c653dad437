"""The search through the catalogue, under a noise that the shots may have: a path that wanders, or a building.

The two look alike in flight; in contact they do not.  A law that the model lacks bends flights, too, and may pass for
either.  So where the readings tell of a site, the shots are searched with it and without it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.collision.effects import named
from analysis.diagnosis.limit import Limit
from analysis.diagnosis.search.forward_selection import Trail, climb, paired
from analysis.diagnosis.search.from_base import accept, explored
from analysis.diagnosis.search.full_rate import swayed_from_there
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.residual import Residual, judge
from analysis.inference.fit.base_fit import base_fit, pays_along
from analysis.inference.fit.begin import Begin
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis_fit import Fitted, fit
from analysis.inference.noise.floor import white_floor
from analysis.inference.noise.joint_data import joint_data
from analysis.inference.noise.own_flights import own_flights
from analysis.inference.noise.site import Site, may_be_of_a_site
from analysis.shot.motion import Motion
from analysis.shot.shot import Progress, Stop


@dataclass(frozen=True)
class Searched:
    """The best fit under one noise, how it was come to, and the catalogue that was asked.

    ``rounds`` are those in which one more effect might still join.
    """

    best: Fitted
    trail: Trail
    catalogue: Sequence[TrialEffect]
    rounds: int = 0

    @cached_property
    def rest(self) -> Residual:
        """Get what the best fit leaves over."""
        return judge(self.best, self.trail.projector_of(self.best))

    def to_the_end(self) -> "Searched":
        """Return the search with the rounds that were left out, where something is left to explain."""
        if not self.rounds or not self.rest.significant:
            return self
        return Searched(climb(self.best, self.trail, self.rounds), self.trail, self.catalogue)

    def with_pairs(self) -> "Searched":
        """Return the search with the likeliest two that it did not ask together, where that is likelier."""
        pair = self.trail.within("two effects that hide each other", lambda: paired(self.trail), None)
        return self if pair is None or pair.bic >= self.best.bic else replace(self, best=pair)


@dataclass(frozen=True, slots=True)
class Search:
    """What is searched: the base of ``motions`` begins as ``given``, ``accepted`` effects are part of the model."""

    motions: Sequence[Motion]
    given: Begin
    catalogue: Sequence[TrialEffect]
    accepted: Sequence[str]
    tell: Progress
    stop: Stop
    limit: Limit | None = None

    def under(self, site: Site | None, *, most: int = CRITERIA.most_effects) -> Searched:
        """Search under one noise with at most ``most`` effects; what shakes the frame is the site, no finding."""
        data = joint_data(self.motions, self.given, site)
        catalogue = [
            kind
            for kind in self.catalogue
            if site is None or kind.name in self.accepted or not may_be_of_a_site(named(kind.name))
        ]

        def along_with(along: Sequence[str]) -> tuple[Fitted, Trail]:
            base = base_fit(data, self.given, self.stop, along)
            start = accept(base, self.catalogue, self.accepted, self.stop)
            self.tell("scoring the catalogue", 0.15)
            if site is None:
                return explored(start, self.given, catalogue, self.stop, most=most, limit=self.limit)
            # What plates seem to do beside a missing effect would call for a second one.
            first, trail = explored(start, self.given, catalogue, self.stop, most=1, limit=self.limit)
            first, trail = swayed_from_there(first, trail)
            more = CRITERIA.most_effects - len(trail.added(first))
            return (climb(first, trail, more) if trail.added(first) else first), trail

        along = own_flights(data.shots, CRITERIA.own_flights)
        best, trail = along_with(along)
        if along:  # bends of each shot's own take up what one law of all does, at the price of a number each
            plain, plain_trail = along_with(())
            if plain.bic <= best.bic or not pays_along(best, along, self.stop):
                best, trail = plain, plain_trail
        added = len(trail.added(best))
        return Searched(best, trail, catalogue, CRITERIA.most_effects - added if added >= most else 0)

    def likelier_without_site(self, searched: Searched) -> bool:
        """Return whether the shots are likelier as if no building shook them, their effects the same: one fit more.

        An effect that bends flights is read as a building, and its strengths, learnt beside a base model that lacks the
        effect, are a wide valley: a fit may end in it with a contact's start off by ten times the noise.
        """
        best = searched.best
        if not best.names:
            return False
        still = replace(best.hypothesis, data=joint_data(self.motions, self.given, None))
        rms_m = math.sqrt(float(np.mean(np.concatenate(best.residual_m) ** 2)))
        return fit(still, best.z, white_floor(rms_m, best.floor.spacing_s), cancelled=self.stop).bic < best.bic

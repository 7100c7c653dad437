"""Best-first search for what explains the shots: under which noise, with which effects, with which laws.

Flights before and after the contact are bent by a building that shakes the rig as well as by a law that the model
lacks.  So there may be two branches: one in which the frame moves as the flights say, one in which nothing shakes the
rig.  Each takes the same steps, the cheap before the dear: search the catalogue, name what was found, learn laws.
After every step the likelier branch (by the Bayesian information criterion) is carried on, and a branch that can no
longer become the likelier one is left.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from analysis.diagnosis.explanation import Explanation, explain_with_effects, explain_with_laws
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.question import Question
from analysis.diagnosis.result import Verdict
from analysis.diagnosis.search.full_rate import at_full_rate
from analysis.diagnosis.search.other_scales import at_likeliest_scale
from analysis.diagnosis.search.search import Search, Searched
from analysis.diagnosis.verdict.acceptance import Settled, settle
from analysis.diagnosis.verdict.criteria import CRITERIA, may_reach
from analysis.shot import AnalysisError


@dataclass
class Branch:
    """One noise, and what has been found under it so far.

    ``law`` is the one law that may stand in the place of all effects, and whether it was tried; ``named`` the
    explanation with the effects that pass their gates, ``complete`` the same with learned laws.
    """

    searched: Searched
    law: SingleLaw
    law_was_tried: bool = False
    named: Explanation | None = None
    complete: Explanation | None = None

    @property
    def bic(self) -> float:
        """Get the criterion of the best fit of the search."""
        return self.searched.best.bic

    def is_likelier_than(self, other: "Branch") -> bool:
        """Return whether this is at least as likely as the other.

        A search that had no time to compare the effects of the catalogue never is beside one that had.
        """
        return self.searched.trail.compared >= other.searched.trail.compared and self.bic <= other.bic

    @property
    def leaves_something(self) -> bool:
        """Get whether the best fit leaves something to explain."""
        return self.searched.leaves_something


class BestFirst:
    """A search for the likeliest explanation of the shots of one question."""

    def __init__(self, question: Question) -> None:
        self._question = question
        self._search = Search(
            question.shots,
            question.begin,
            question.catalogue,
            question.accepted,
            question.progress,
            question.stop,
            question.limit,
        )
        self._in_building: Branch | None = None
        self._at_rest: Branch | None = None
        self._answer: Explanation | None = None
        self._law_hides_in_building = False

    def explanation(self) -> Explanation:
        """Return the likeliest explanation.

        Raises Cancelled when asked to stop, AnalysisError where nothing seems to be missing but the time was over
        before the effects of the catalogue were compared: noise that was learned without them may have swallowed one.
        """
        while self._answer is None:
            self._next_step()()
        if self._answer.verdict is Verdict.ADEQUATE and not self._answer.trail.compared:
            raise AnalysisError(
                f"no time within {self._question.limit.seconds:g} s to compare the effects of the catalogue: "
                "allow more, or diagnose fewer shots"
            )
        return self._answer

    def _next_step(self) -> Callable[[], None]:
        """Return what to do next: here, and in what it calls, that is decided and nowhere else."""
        building, rest = self._in_building, self._at_rest
        if self._question.site is not None and building is None:
            return self._search_in_building
        if building is not None and rest is None:
            if not building.leaves_something and building.named is None:
                return partial(self._name, building)
            named = building.named
            if named is not None and named.explained and not self._may_be_likelier_at_rest(building):
                return partial(self._end_with, named)
            if self._question.limit():
                return partial(self._complete, building)
            lacking = building.leaves_something if named is None else not named.explained
            if lacking and not building.law_was_tried:
                return partial(self._try_one_law_instead, building, building)
            if building.named is None and building.searched.rounds:
                return partial(self._search_on, building)
        if rest is None:
            return self._search_at_rest
        likelier = rest if building is None or rest.is_likelier_than(building) else building
        if (likelier.leaves_something or self._law_hides_in_building) and not rest.law_was_tried:
            return partial(self._try_one_law_instead, rest, likelier)
        if building is None or likelier is rest:
            return partial(self._complete, rest)
        return self._next_in_likelier_building(building, rest)

    def _next_in_likelier_building(self, building: Branch, rest: Branch) -> Callable[[], None]:
        """Return what to do next where both branches are searched and the one in a building is the likelier."""
        if building.named is None:
            return partial(self._name, building)
        if building.named.explained:
            return partial(self._end_with, building.named)
        if self._question.limit():
            return partial(self._complete, building)
        if rest.complete is None:
            return partial(self._complete_where_it_may_win, rest, building.named.bic)
        if rest.complete.explained and rest.complete.bic < building.named.bic:
            return partial(self._end_with, rest.complete)
        return partial(self._complete, building)

    def _search_in_building(self) -> None:
        """Search as the frame moves; the last effect that may join waits: one law takes less time."""
        searched = self._search.under(self._question.site, most=CRITERIA.most_effects - 1)
        self._in_building = Branch(searched, self._question.one_law_beside(searched.trail.start))

    def _may_be_likelier_at_rest(self, building: Branch) -> bool:
        """Return whether shots that a building explains may be likelier with nothing that shakes the rig.

        They are fitted with the same effects.  Where there are none, one law is asked for that may hide in the
        building, and whether it may is kept: a building takes up what a law does as slowly (a squeeze film of 4,254
        norms).
        """
        best = building.searched.best
        if best.effects:
            return self._search.likelier_without_site(best)
        try:
            law = self._question.one_law_beside(self._search.base_at_rest())
        except AnalysisError:
            return False
        self._law_hides_in_building = law.in_flight_may_reach(building.bic - CRITERIA.law_fall)
        return self._law_hides_in_building

    def _search_on(self, branch: Branch) -> None:
        branch.searched = branch.searched.to_the_end()

    def _search_at_rest(self) -> None:
        """Search as if nothing shook the rig; where only that is possible the last effect that may join waits."""
        most = CRITERIA.most_effects - (self._question.site is None)
        beat = math.inf if self._in_building is None else self._in_building.bic
        searched = self._search.under(None, most=most, beat=beat)
        self._at_rest = Branch(searched, self._question.one_law_beside(searched.trail.start))

    def _try_one_law_instead(self, branch: Branch, likelier: Branch) -> None:
        """Ask whether one law of a branch explains all where the effects of the likelier branch do not.

        Two effects that hide each other are tried first.
        """
        branch.law_was_tried = True
        law = branch.law
        if not law.replaces_effects(likelier.searched.best, self._question.catalogue):
            return
        with_pairs = likelier.searched.with_pairs()
        if with_pairs is not likelier.searched:
            likelier.searched, likelier.named = with_pairs, None
        found = law.found
        if found is None or not law.is_likelier_than(likelier.searched.best):
            return
        if branch is self._in_building and self._search.likelier_without_site(found.fitted):
            return
        if at_full_rate(branch.searched.best, branch.searched.trail, self._question.motions) is None:
            self._answer = explain_with_laws(self._question, self._without_effects(branch), law)

    def _name(self, branch: Branch) -> None:
        """Name the effects that pass their gates; a ripple of the light is looked for at the record's own rate."""
        question = self._question
        best, trail, rest = branch.searched.best, branch.searched.trail, branch.searched.residual
        finely = at_full_rate(best, trail, question.motions)
        if finely is not None:
            best, trail = finely
            branch.law = question.one_law_beside(trail.start)
        held_out = question.held_out(trail.start.problem.data, in_turn=best is not trail.start)
        # where something is left that no effect explains, no support's frequency is worth the search for a large one
        best, given = at_likeliest_scale(best, trail, thoroughly=not branch.leaves_something), best
        judged = rest if finely is None and best is given else None
        settled = settle(best, trail, held_out, question.progress, question.limit, judged)
        branch.named = explain_with_effects(question, trail, settled, held_out)

    def _complete(self, branch: Branch) -> None:
        """Search a branch to its end, learn its laws, and end with it."""
        if branch.named is None:
            branch.searched = branch.searched.to_the_end()
            self._name(branch)
        assert branch.named is not None
        self._answer = explain_with_laws(self._question, branch.named, branch.law)

    def _complete_where_it_may_win(self, branch: Branch, beat: float) -> None:
        """Carry the less likely branch on, as far as it may come below the criterion ``beat``."""
        if may_reach(beat, branch.bic, branch.searched.trail.start.bic):
            self._name(branch)
        else:
            branch.named = self._without_effects(branch)
        assert branch.named is not None
        branch.complete = explain_with_laws(self._question, branch.named, branch.law, beat=beat)

    def _without_effects(self, branch: Branch) -> Explanation:
        """Return the explanation of a branch in which no effect of the catalogue is named."""
        trail = branch.searched.trail
        settled = Settled.nothing(trail.start, trail.linearised(trail.start))
        return explain_with_effects(self._question, trail, settled, branch.law.held)

    def _end_with(self, explanation: Explanation) -> None:
        self._answer = explanation

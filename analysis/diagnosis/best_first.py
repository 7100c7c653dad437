"""Best-first search for the likeliest explanation of the shots: noise model, effects and learned laws.

Frame motion (a building that shakes the rig) and a missing law both bend the free flights before and after contact.
The search therefore has up to two branches: one with the frame motion that the flights show, one without any.  Both
take the same steps, cheapest first: search the catalogue, name the effects found, learn laws.  After each step the
search continues the branch with the lower Bayesian information criterion (BIC), and drops a branch that can no longer
become the likelier one.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from analysis.diagnosis.catalogue_search import Search, SearchResult
from analysis.diagnosis.diagnosis_input import DiagnosisInput
from analysis.diagnosis.evidence.cross_validation import choose
from analysis.diagnosis.evidence.residual import residual_of
from analysis.diagnosis.explanation import Explanation, explain_with_effects
from analysis.diagnosis.findings.criteria import CRITERIA, may_beat
from analysis.diagnosis.findings.result import Verdict
from analysis.diagnosis.laws_outside_catalogue import explain_with_laws
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.search.full_rate import at_full_rate
from analysis.diagnosis.search.scale_maxima import at_likeliest_scale
from analysis.diagnosis.verdict.acceptance import GatedFit, settle
from analysis.inference import STILL_FRAME, frame_hides_effects
from analysis.shot import AnalysisError


@dataclass
class Branch:
    """One noise model, and the results found under it so far.

    ``law`` is the single law that may replace all effects; ``law_was_tried`` says whether it was tested.  ``named`` is
    the explanation with the effects that passed their gates, ``complete`` the same with learned laws.
    """

    searched: SearchResult
    law: SingleLaw
    law_was_tried: bool = False
    named: Explanation | None = None
    complete: Explanation | None = None

    @property
    def bic(self) -> float:
        """Get the BIC of the best fit of the search."""
        return self.searched.best.bic

    def is_likelier_than(self, other: "Branch") -> bool:
        """Return whether this branch is at least as likely as the other.

        A search without time to compare the catalogue's effects is never likelier than one that compared them.
        """
        return self.searched.trail.compared >= other.searched.trail.compared and self.bic <= other.bic


class BestFirst:
    """A search for the likeliest explanation of the shots of one question."""

    def __init__(self, question: DiagnosisInput) -> None:
        self._question = question
        self._search = Search(question)
        self._in_building: Branch | None = None
        self._at_rest: Branch | None = None
        self._answer: Explanation | None = None
        self._law_hides_in_building = False

    def explanation(self) -> Explanation:
        """Return the likeliest explanation.

        Raises Cancelled when asked to stop, AnalysisError where nothing seems to be missing but time ran out before
        the effects of the catalogue were compared: noise learned without them may have absorbed one; and where
        something seems to be missing but the frame moves too far for its response to be computed.
        """
        while self._answer is None:
            self._next_step()()
        if self._answer.verdict is Verdict.ADEQUATE and not self._answer.trail.compared:
            raise AnalysisError(
                f"no time within {self._question.limit.seconds:g} s to compare the effects of the catalogue: "
                "allow more, or diagnose fewer shots"
            )
        if self._frame_hides(self._answer):
            raise AnalysisError(
                "the frame moves so far in contact that its effect on these shots cannot be computed: "
                "take them at a quieter site"
            )
        return self._answer

    def _next_step(self) -> Callable[[], None]:
        """Choose the next step; only this method and the two below decide the order of steps."""
        building, at_rest = self._in_building, self._at_rest
        if at_rest is None:
            if building is not None:
                return self._next_in_building(building)
            return self._search_in_building if self._question.site.moves else self._search_at_rest
        likelier = at_rest if building is None or at_rest.is_likelier_than(building) else building
        if (likelier.searched.leaves_something or self._law_hides_in_building) and not at_rest.law_was_tried:
            return partial(self._try_one_law_instead, at_rest, likelier)
        if building is None or likelier is at_rest:
            return partial(self._complete, at_rest)
        return self._next_in_likelier_building(building, at_rest)

    def _next_in_building(self, building: Branch) -> Callable[[], None]:
        """Choose the next step when only the branch with frame motion is searched."""
        named, leaves_something = building.named, building.searched.leaves_something
        if named is None and not leaves_something:
            return partial(self._name, building)
        if named is not None and named.explained and not self._may_be_likelier_at_rest(building):
            return partial(self._end_with, named)
        if self._question.limit():
            return partial(self._complete, building)
        lacking = leaves_something if named is None else not named.explained
        if lacking and not building.law_was_tried:
            return partial(self._try_one_law_instead, building, building)
        if named is None and building.searched.rounds:
            return partial(self._search_on, building)
        return self._search_at_rest

    def _next_in_likelier_building(self, building: Branch, at_rest: Branch) -> Callable[[], None]:
        """Choose the next step when both branches are searched and the one with frame motion is the likelier."""
        if building.named is None:
            return partial(self._name, building)
        first = at_rest.complete is None  # later the question of the frame has been answered
        if building.named.explained or (first and self._frame_hides(building.named)):  # no law would be told either
            return partial(self._end_with, building.named)
        if self._question.limit():
            return partial(self._complete, building)
        if at_rest.complete is None:
            return partial(self._complete_where_it_may_win, at_rest, building.named.bic)
        if at_rest.complete.explained and at_rest.complete.bic < building.named.bic:
            return partial(self._end_with, at_rest.complete)
        return partial(self._complete, building)

    def _frame_hides(self, explanation: Explanation) -> bool:
        """Return whether what an explanation finds missing may be the frame, which moves too far to be computed."""
        lacking = explanation.verdict is not Verdict.ADEQUATE
        return lacking and frame_hides_effects(explanation.after, self._question.stop)

    def _search_in_building(self) -> None:
        """Search with frame motion for one effect fewer than allowed: one law takes less time than the last effect."""
        searched = self._search.under(self._question.site, most=CRITERIA.most_effects - 1)
        self._in_building = Branch(searched, self._question.single_law_given(searched.trail.start))

    def _may_be_likelier_at_rest(self, building: Branch) -> bool:
        """Return whether shots that are explained with frame motion may be likelier without it.

        The shots are refitted without frame motion and with the same effects.  Without effects, test instead whether
        frame motion may hide one law, and keep the answer: frame motion absorbs the action of an equally slow law (a
        squeeze film of 4,254 noise norms).
        """
        best = building.searched.best
        if best.effects:
            return self._search.likelier_without_frame_motion(best)
        try:
            law = self._question.single_law_given(self._search.base_without_frame_motion())
        except AnalysisError:
            return False
        self._law_hides_in_building = law.flight_law_may_beat(building.bic - CRITERIA.law_fall)
        return self._law_hides_in_building

    def _search_on(self, branch: Branch) -> None:
        branch.searched = branch.searched.to_convergence()

    def _search_at_rest(self) -> None:
        """Search without frame motion; if the flights show none, search for one effect fewer than allowed."""
        most = CRITERIA.most_effects - (not self._question.site.moves)
        beat = math.inf if self._in_building is None else self._in_building.bic
        searched = self._search.under(STILL_FRAME, most=most, beat=beat)
        self._at_rest = Branch(searched, self._question.single_law_given(searched.trail.start))

    def _try_one_law_instead(self, branch: Branch, likelier: Branch) -> None:
        """End with one law of a branch where it explains the shots and the effects of the likelier branch do not.

        Pairs of effects that hide each other are tried first.
        """
        branch.law_was_tried = True
        law = branch.law
        if not law.replaces_effects(likelier.searched.best, self._question.catalogue):
            return
        with_pairs = likelier.searched.with_pairs()
        if with_pairs is not likelier.searched:
            likelier.searched, likelier.named = with_pairs, None
        found = law.found
        if found is None or found.fitted.bic >= likelier.bic - CRITERIA.form_excluded:
            return
        if branch is self._in_building and self._search.likelier_without_frame_motion(found.fitted):
            return
        if at_full_rate(branch.searched.best, branch.searched.trail, self._question.motions) is None:
            self._answer = explain_with_laws(self._without_effects(branch), law)

    def _name(self, branch: Branch) -> None:
        """Name the effects that pass their gates; interferometer ripple is tested at the record's own sample rate."""
        question = self._question
        best, trail, residual = branch.searched.best, branch.searched.trail, branch.searched.residual
        finely = at_full_rate(best, trail, question.motions)
        if finely is not None:
            best, trail = finely
            branch.law = question.single_law_given(trail.start)
        held_out = choose(trail.start.problem.data, in_turn=best is not trail.start)
        # where the best fit leaves a residual, a thorough search of a support's frequency is not worth its time
        best, given = at_likeliest_scale(best, trail, thoroughly=not branch.searched.leaves_something), best
        judged = residual if finely is None and best is given else None
        settled = settle(best, trail, held_out, question.progress, judged)
        branch.named = explain_with_effects(question, trail, settled, held_out)

    def _complete(self, branch: Branch) -> None:
        """Search a branch for all effects allowed, learn its laws, and end with the result."""
        if branch.named is None:
            branch.searched = branch.searched.to_convergence()
            self._name(branch)
        assert branch.named is not None
        self._answer = explain_with_laws(branch.named, branch.law)

    def _complete_where_it_may_win(self, branch: Branch, beat: float) -> None:
        """Complete the less likely branch, naming effects only if its BIC may fall below ``beat``."""
        if may_beat(beat, branch.bic, branch.searched.trail.start.bic):
            self._name(branch)
        else:
            branch.named = self._without_effects(branch)
        assert branch.named is not None
        branch.complete = explain_with_laws(branch.named, branch.law, beat=beat)

    def _without_effects(self, branch: Branch) -> Explanation:
        """Return the explanation of a branch with no catalogue effect named."""
        trail = branch.searched.trail
        start, at = trail.start, trail.linearised(trail.start)
        bare = GatedFit(start, at, {}, residual_of(start, at), None, start)
        return explain_with_effects(self._question, trail, bare, branch.law.held)

    def _end_with(self, explanation: Explanation) -> None:
        self._answer = explanation

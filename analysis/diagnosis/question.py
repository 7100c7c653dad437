"""What a diagnosis is asked: shots of one rig, the base model with the effects it has, the time it may take."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from analysis.collision import Acts, Effect, findings
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.limit import Limit
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.cross_validation import choose
from analysis.inference import (
    Fitted,
    JointData,
    Samples,
    SearchStart,
    Site,
    TrialEffect,
    averaged_shots,
    base_named,
    first_fit,
    shakings_of,
    site_under,
    trial_effects,
)
from analysis.shot import Motion, Progress, Shaking, Stop


@dataclass(frozen=True)
class Question:
    """Shots and settings of one diagnosis; what follows from them alone is computed once.

    ``hold_out`` is the index of the only shot to be predicted from the others.  ``progress`` is told what is being done
    and which fraction is done.
    """

    motions: Sequence[Motion]
    model: str
    named: Sequence[Effect]  # effects and laws that the model has already
    laws: Sequence[Effect]  # a person's own, tried like the catalogue's effects
    hold_out: int | None
    shakings_read: Sequence[Shaking | None] | None
    progress: Progress
    stop: Stop
    limit: Limit
    began: float = field(default_factory=time.perf_counter)

    @cached_property
    def catalogue(self) -> Sequence[TrialEffect]:
        """Get every effect that may be tried: of a plate that does not move those alone that have a meaning there."""
        kinds = trial_effects([*self.laws, *(one for one in self.accepted if one.acts is not Acts.IN_DRIVE)])
        plate_moves = not base_named(self.model).one_body
        return [kind for kind in kinds if plate_moves or kind.effect.one_body or kind.effect in self.accepted]

    @property
    def accepted(self) -> tuple[Effect, ...]:
        """Get the effects in the model that a diagnosis could have found."""
        return findings(self.named)

    @cached_property
    def shots(self) -> tuple[Samples, ...]:
        """Get the averaged shots."""
        return averaged_shots(self.motions)

    @cached_property
    def site(self) -> Site | None:
        """Get what shook the rig as the flights before and after the contact show it; None where that is nothing."""
        shakings = shakings_of(self.motions, self.model, self.shakings_read)
        return site_under(self.motions, shakings, CRITERIA.site_nm)

    @cached_property
    def begin(self) -> SearchStart:
        """Get where every search begins: the base model as a first fit has it."""
        return first_fit(self.shots, self.model, self.site, self.stop)

    def held_out(self, data: JointData, *, in_turn: bool = True) -> tuple[int, ...]:
        """Return the shots that are predicted from the others, each in turn."""
        return choose(data, in_turn=in_turn) if self.hold_out is None else (self.hold_out,)

    def one_law_beside(self, start: Fitted) -> SingleLaw:
        """Return the law that ``start`` may lack; it is learned when it is first needed."""
        return SingleLaw(start, self.held_out(start.problem.data), self.progress, self.stop, self.limit)

    @property
    def seconds(self) -> float:
        """Get the time since the diagnosis began."""
        return time.perf_counter() - self.began

"""Input of a diagnosis: shots of one rig, the base model with the effects already in it, and the time limit."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from analysis.collision import Acts, Effect, without_nuisances
from analysis.diagnosis.evidence.cross_validation import choose
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.search.time_limit import Limit
from analysis.inference import (
    Fitted,
    Samples,
    SearchStart,
    Site,
    TrialEffect,
    averaged_shots,
    base_named,
    first_fit,
    frame_motions_of,
    site_under,
    trial_effects,
)
from analysis.shot import Motion, Progress, Stop, VibrationSpectrum


@dataclass(frozen=True)
class DiagnosisInput:
    """Shots and settings of one diagnosis; quantities derived from them alone are computed once.

    ``progress`` is called with the current step and the fraction done.
    """

    motions: Sequence[Motion]
    model: str
    named: Sequence[Effect]  # effects and laws already in the model
    laws: Sequence[Effect]  # user-defined, tried like the catalogue's effects
    vibrations_read: Sequence[VibrationSpectrum | None] | None
    progress: Progress
    stop: Stop
    limit: Limit
    began: float = field(default_factory=time.perf_counter)

    @cached_property
    def catalogue(self) -> Sequence[TrialEffect]:
        """Get every effect that may be tried: those that the base model allows, and those already in the model."""
        kinds = trial_effects([*self.laws, *(one for one in self.accepted if one.acts is not Acts.IN_DRIVE)])
        base = base_named(self.model)
        return [kind for kind in kinds if base.allows(kind.effect) or kind.effect in self.accepted]

    @property
    def accepted(self) -> tuple[Effect, ...]:
        """Get the effects already in the model that a diagnosis could have found."""
        return without_nuisances(self.named)

    @cached_property
    def shots(self) -> tuple[Samples, ...]:
        """Get the averaged shots."""
        return averaged_shots(self.motions)

    @cached_property
    def site(self) -> Site:
        """Get the frame motion that the free flights before and after contact show."""
        vibrations = frame_motions_of(self.motions, self.model, self.vibrations_read)
        return site_under(self.motions, vibrations, CRITERIA.site_nm)

    @cached_property
    def begin(self) -> SearchStart:
        """Get the start of every search: the first fit of the base model."""
        return first_fit(self.shots, self.model, self.site, self.stop)

    def single_law_given(self, start: Fitted) -> SingleLaw:
        """Return the single law that ``start`` may lack; it is learned when first needed."""
        return SingleLaw(start, choose(start.problem.data), self.progress, self.stop, self.limit)

    @property
    def seconds(self) -> float:
        """Get the time since the diagnosis began."""
        return time.perf_counter() - self.began

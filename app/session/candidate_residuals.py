"""Residual of each candidate of a diagnosis, from joint fits that run while no other job is queued.

A diagnosis stores the numbers of its candidates but not their residuals.  The diagnosed model plus one candidate is
fitted jointly to all shots, the best candidate first.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis import Candidate, Diagnosis
from analysis.fitted import fit_jointly
from analysis.shot import AnalysisError, Floats, Progress, Shot, Stop
from app.session.jobs import LOW_PRIORITY, Job, JobQueues

MOST = 6  # most candidates fitted: effects found, then the next best


@dataclass(frozen=True, slots=True, eq=False)
class CandidateResidual:
    """Residual of each shot, (n,) in m, with one candidate in the model; None if the fit did not converge."""

    effect: Effect
    left_m: tuple[Floats, ...] | None
    reduced_chi2: float


def by_evidence(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates, best first: those fitted in full by the fall of the BIC, then the others by score."""
    return sorted(candidates, key=lambda c: (math.inf if c.delta_bic is None else c.delta_bic, -abs(c.score)))


def candidate_residual(
    shots: Sequence[Shot], base: str, effects: tuple[Effect, ...], *, progress: Progress, cancelled: Stop
) -> CandidateResidual:
    """Return the residual of a joint fit with these effects; the last of them is the candidate."""
    progress("fit with this candidate", 0.0)
    try:
        fit = fit_jointly(shots, base, effects, cancelled)
    except AnalysisError:
        return CandidateResidual(effects[-1], None, float("nan"))
    left = tuple(np.asarray(part.residual_m) for part in fit.shots) if fit.converged else None
    return CandidateResidual(effects[-1], left, fit.reduced_chi2)


class CandidateResiduals:
    """Residuals of the candidates of one diagnosis; ``found`` grows as the fits finish."""

    def __init__(self, work: JobQueues) -> None:
        self._work = work
        self._of: Diagnosis | None = None
        self._shots: list[Shot] = []
        self._wanted: list[Effect] = []
        self._job: Job | None = None
        self._arrived = False  # whether a residual was found since the last ``refresh``
        self.found: dict[Effect, CandidateResidual] = {}

    def show(self, diagnosis: Diagnosis | None, shots: Sequence[Shot]) -> None:
        """Switch to a diagnosis, or to none; ``shots`` are in the order of its fits."""
        if diagnosis is self._of:
            return
        if self._job is not None:
            self._job.discard()
        self._of, self.found, self._job = diagnosis, {}, None
        self._shots = [shot for shot in shots if shot.motion is not None]
        self._wanted = []
        if diagnosis is None or diagnosis.drive is not None or not self._shots:
            return
        before = set(diagnosis.fit_before.effects)
        named = [found.effect for found in diagnosis.effects]
        ranked = [candidate.effect for candidate in by_evidence(diagnosis.candidates)]
        self._wanted = [effect for effect in dict.fromkeys([*named, *ranked]) if effect not in before][:MOST]

    def first(self, effect: Effect) -> None:
        """Fit this candidate next, because the operator points at it."""
        if effect in self._wanted:
            self._wanted.remove(effect)
            self._wanted.insert(0, effect)

    def stop(self) -> None:
        """Fit no more candidates of this diagnosis."""
        self._wanted = []

    def refresh(self) -> bool:
        """Start the next fit if no other job waits; return whether a residual was found since the last call."""
        if self._job is None and self._wanted and self._of is not None and self._work.jobs.open_jobs == 0:
            self._ask(self._of, self._wanted[0])
        arrived, self._arrived = self._arrived, False
        return arrived

    def _ask(self, diagnosis: Diagnosis, effect: Effect) -> None:
        effects = (*diagnosis.fit_before.effects, effect)
        fitting = partial(candidate_residual, self._shots, diagnosis.fit_before.model, effects)
        self._job = self._work.submit_long(
            effect.words, fitting, LOW_PRIORITY, self._take, lambda why: self._ended(effect, again=why is None)
        )

    def _take(self, found: CandidateResidual) -> None:
        self.found[found.effect] = found
        self._arrived = True
        self._ended(found.effect, again=False)

    def _ended(self, effect: Effect, *, again: bool) -> None:
        """Note that the fit of a candidate has ended; ``again``: another job cancelled it, so it is fitted later."""
        self._job = None
        if not again:
            self._wanted = [other for other in self._wanted if other != effect]

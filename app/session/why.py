"""The residual that each candidate of a diagnosis leaves, from joint fits made while no other work waits.

A diagnosis has the numbers of its candidates, not their curves.  The base model with one candidate is fitted to all
shots jointly, the best candidate first.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis import Candidate, Diagnosis
from analysis.fitted import fit_jointly, shaking_of
from analysis.shot import AnalysisError, Floats, Motion, Progress, Shaking, Shot, Stop
from app.session.jobs import Job, Work
from levimass import is_drive

MOST = 6  # candidates: the named ones and their neighbours
KIND = "why"


@dataclass(frozen=True, slots=True, eq=False)
class Remainder:
    """The residual with one candidate in the model: for each shot (n,), in m; None where the fit did not converge."""

    effect: Effect
    left_m: tuple[Floats, ...] | None
    reduced_chi2: float


def by_evidence(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates in the order of their evidence: those fitted in full first, by the fall of the BIC."""
    return sorted(candidates, key=lambda c: (math.inf if c.delta_bic is None else c.delta_bic, -abs(c.score)))


def remainder_of(
    motions: Sequence[Motion],
    base: str,
    effects: tuple[Effect, ...],
    shakings: Sequence[Shaking | None],
    *,
    progress: Progress,
    cancelled: Stop,
) -> Remainder:
    """Return the residual of a joint fit with these effects, the last of which is the candidate."""
    try:
        fit = fit_jointly(motions, base, effects, cancelled, shakings)
    except AnalysisError:
        return Remainder(effects[-1], None, float("nan"))
    left = tuple(np.asarray(part.residual_m) for part in fit.shots) if fit.converged else None
    return Remainder(effects[-1], left, fit.reduced_chi2)


class Why:
    """The residuals of one diagnosis's candidates, as far as they are fitted."""

    def __init__(self, work: Work) -> None:
        self._work = work
        self._of: Diagnosis | None = None
        self._motions: list[Motion] = []
        self._shakings: list[Shaking | None] = []
        self._wanted: list[Effect] = []
        self._job: Job | None = None
        self._fitting: Effect | None = None  # the candidate that the job is about
        self.found: dict[Effect, Remainder] = {}

    @property
    def waiting(self) -> bool:
        """Get whether some candidates are still to be fitted."""
        return bool(self._wanted)

    def show(self, diagnosis: Diagnosis | None, shots: Sequence[Shot]) -> None:
        """Begin with another diagnosis, or none; ``shots`` in the order of its fits."""
        if diagnosis is self._of:
            return
        if self._job is not None:
            self._job.cancel()
        self._of, self.found, self._job = diagnosis, {}, None
        self._motions = [shot.motion for shot in shots if shot.motion is not None]
        self._shakings = [shaking_of(shot) for shot in shots if shot.motion is not None]
        self._wanted = []
        if diagnosis is None or is_drive(diagnosis.fit_before.model) or not self._motions:
            return
        before = set(diagnosis.fit_before.effects)
        named = [found.effect for found in diagnosis.effects]
        ranked = [candidate.effect for candidate in by_evidence(diagnosis.candidates)]
        self._wanted = [effect for effect in dict.fromkeys([*named, *ranked]) if effect not in before][:MOST]

    def first(self, effect: Effect) -> None:
        """Fit this candidate before the others, as the operator points at it."""
        if effect in self._wanted:
            self._wanted.remove(effect)
            self._wanted.insert(0, effect)

    def stop(self) -> None:
        """Fit no more candidates of this diagnosis."""
        self._wanted = []

    def refresh(self) -> bool:
        """Take a finished fit, start the next while there is no other work; return whether one has finished."""
        job, came = self._job, False
        if job is not None and job.done.is_set():
            self._job = None
            if isinstance(job.result, Remainder) and not job.cancelled:
                self.found[job.result.effect] = job.result
                came = True
            if not job.cancelled:
                self._wanted = [effect for effect in self._wanted if effect != self._fitting]
        if self._job is None and self._wanted and self._of is not None and self._work.jobs.open_jobs == 0:
            self._ask(self._of, self._wanted[0])
        return came

    def _ask(self, diagnosis: Diagnosis, effect: Effect) -> None:
        effects = (*diagnosis.fit_before.effects, effect)
        fitting = partial(remainder_of, self._motions, diagnosis.fit_before.model, effects, self._shakings)

        def work(report: Progress, cancelled: Stop) -> Remainder:
            report("fit with this candidate", 0.0)
            made: Remainder = self._work.do(fitting, report, cancelled)
            return made

        self._fitting = effect
        self._job = self._work.jobs.submit(effect.words, work, KIND)

"""Diagnose shots: the effects that the base model lacks, the errors before and after, and the residual."""

from collections.abc import Sequence
from dataclasses import replace

from analysis.collision import Effect, effects_named
from analysis.diagnosis.best_first import BestFirst
from analysis.diagnosis.diagnosis_input import DiagnosisInput
from analysis.diagnosis.driven import diagnose_driven
from analysis.diagnosis.evidence.cross_validation import Prediction
from analysis.diagnosis.evidence.residual import errors
from analysis.diagnosis.explanation import Explanation
from analysis.diagnosis.findings.result import Diagnosis, Errors, Verdict
from analysis.diagnosis.search.time_limit import SECONDS, Limit
from analysis.diagnosis.verdict.alternatives import blind_spots, candidates
from analysis.fitted import vibration_of
from analysis.inference import OWN_NAMES, Fitted, Floor, as_fit
from analysis.shot import AnalysisError, Motion, Progress, Shot, Stop
from levimass import PAPER_MODEL, base_model


def diagnose(
    shots: Sequence[Shot | Motion],
    *,
    model: str | None = None,
    accepted: Sequence[Effect | str] = (),
    laws: Sequence[Effect] = (),
    seconds: float = SECONDS,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Diagnosis:
    """Diagnose one or several shots of one rig against the base ``model`` with the ``accepted`` effects.

    ``model`` defaults to that of the shots' settings, and to "paper" for motions alone.  An effect of the catalogue
    may be given by its name.  ``laws`` are user-defined laws (``laws.user_law``), tried like the catalogue's effects.
    The slowest shot, a middle one and the fastest are predicted in turn from the others (of two, the slower).  Frame
    motion is taken from the shots' readings; for motions alone it is read here.  After ``seconds`` on two cores,
    optional steps are left out: restarts of the catalogue search, laws.  Errors are judged in displacement.

    Raises ValueError for an unknown model or effect and for shots of different base models, AnalysisError where there
    is nothing to judge, Cancelled when asked to stop.
    """
    motions = [_motion(shot) for shot in shots]
    model = _model(shots) if model is None else model
    if not motions:
        raise ValueError("no shot to diagnose")
    if not base_model(model).collides:
        return diagnose_driven(motions, accepted, progress, cancelled)
    stop = cancelled or (lambda: False)
    vibrations = [vibration_of(shot) for shot in shots if isinstance(shot, Shot)]
    question = DiagnosisInput(
        motions=motions,
        model=model,
        named=effects_named(accepted),
        laws=laws,
        vibrations_read=vibrations if len(vibrations) == len(shots) else None,  # None: some are motions alone
        progress=progress or (lambda _what, _fraction: None),
        stop=stop,
        limit=Limit(seconds, stop),
    )
    question.progress("fitting the base model", 0.0)
    return _diagnosis(question, BestFirst(question).explanation())


def _motion(shot: Shot | Motion) -> Motion:
    if isinstance(shot, Motion):
        return shot
    if shot.motion is None:
        raise AnalysisError(f"{shot.name} has no motion: {shot.problem or 'it was not demodulated'}")
    return shot.motion


def _model(shots: Sequence[Shot | Motion]) -> str:
    models = {shot.settings.model for shot in shots if isinstance(shot, Shot)}
    if len(models) > 1:
        raise ValueError(f"the shots have different base models: {', '.join(sorted(models))}")
    return models.pop() if models else PAPER_MODEL


def _diagnosis(question: DiagnosisInput, explanation: Explanation) -> Diagnosis:
    """Return the diagnosis for an explanation, with errors, candidates and detection limits."""
    question.progress("errors before and after", 0.9)
    motions, before, after = question.motions, explanation.before, explanation.after
    shots, verdict = before.problem.data.shots, explanation.verdict
    predictions = explanation.predictions or (None, None)
    detectable = (
        ()
        if verdict is Verdict.UNEXPLAINED
        else blind_spots(explanation.linearised, explanation.trail.catalogue, explanation.nearest)
    )
    error_before = error_after = _errors(motions, before, after.noise)
    fit_before = fit_after = as_fit(before, motions, question.model, 0.0)
    if after is not before:
        error_after = _errors(motions, after, after.noise)
        fit_after = as_fit(after, motions, question.model, 0.0)
    diagnosis = Diagnosis(
        verdict=verdict,
        effects=explanation.effects,
        candidates=candidates(explanation.nearest, explanation.trail),
        error_before=error_before,
        error_after=error_after,
        error_held_out_before=_held_out_errors(question, explanation, predictions[0]),
        error_held_out_after=_held_out_errors(question, explanation, predictions[1]),
        fit_before=fit_before,
        fit_after=replace(fit_after, seconds=question.seconds),
        remainder=explanation.remainder,
        blind_spots=detectable,
        speeds_m_per_s=tuple(abs(shot.course.velocity_in_m_per_s) for shot in shots),
        seconds=question.seconds,
        laws=explanation.laws,
        imitated_by=explanation.imitations,
        not_asked=question.limit.left_out,
        compared=explanation.trail.compared,
    )
    question.progress("diagnosed", 1.0)
    return diagnosis


def _errors(motions: Sequence[Motion], fitted: Fitted, floor: Floor) -> Errors:
    problem = fitted.problem
    return errors(motions, problem.data.shots, problem.full(fitted.point), floor, problem.size)


def _held_out_errors(
    question: DiagnosisInput, explanation: Explanation, prediction: Prediction | None
) -> Errors | None:
    held_out = explanation.held_out
    if not held_out or prediction is None:
        return None
    motions, shots = question.motions, explanation.before.problem.data.shots
    own = len(OWN_NAMES) * len(held_out)
    displacement_m, floor = prediction.displacement_m, explanation.after.noise
    return errors([motions[i] for i in held_out], [shots[i] for i in held_out], displacement_m, floor, own)

"""``levimass replay``: analyse and diagnose recordings, plan next shots, write results and reports."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from analysis.collision import Effect
from analysis.diagnosis import (
    Diagnosis,
    PredictionTest,
    SavedModel,
    Verdict,
    diagnose,
    prediction_words,
)
from analysis.fitted import fit_shot, read_together
from analysis.planning import Reach, plan_next, plan_precision, refit_diagnosed, shots_in_words
from analysis.report import result
from analysis.shot import AnalysisError, AnalysisSettings, Shot, fitted_shots, motions_of, why_no_joint_fit
from app.command_line.options import known_model
from app.command_line.outputs import (
    Outputs,
    check_outputs,
    error_line,
    json_text,
    say,
    say_problem,
    write_json,
)
from app.report import export, export_hdf5, export_laws, export_prediction, report_of, summary
from app.session import load_and_analyse, predicted, significant_drift, write_model
from instrument.files import RecordingError, find_recordings, read_law, write_text_atomic

Result = TypeVar("Result")
NOTHING_OPEN = "no further shot is needed: the diagnosis is unambiguous"


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """Requests in addition to the analysis of each shot.

    ``laws`` are files of own laws, which the diagnosis also tries.  ``test_model``: test the model file's predictions
    on these shots.  ``plan``: plan shots that decide between the candidates (""), or that halve the uncertainty of
    the named parameter; ``reach`` are the rig's possible speeds, weights and run-up.
    """

    diagnosis: bool = True
    laws: Sequence[Path] = ()
    test_model: bool = False
    plan: str | None = None
    reach: Reach | None = None


@dataclass(frozen=True, slots=True)
class PlannedShots:
    """The planned shots in words, and in the form of the result file (None: the diagnosis leaves nothing open)."""

    words: str
    result: dict[str, Any] | None


@dataclass(frozen=True, slots=True)
class _Results:
    """All that is written; ``tried`` are effects in the model that no diagnosis found."""

    shots: Sequence[Shot]
    diagnosis: Diagnosis | None
    prediction: PredictionTest | None
    planned: PlannedShots | None
    tried: Sequence[Effect]
    failed: bool  # a part that was asked for is missing


def replay(
    paths: Sequence[Path],
    request: ReplayRequest,
    outputs: Outputs,
    *,
    model: str | None,
    settings: AnalysisSettings,
    checked: bool = True,
) -> int:
    """Analyse recordings and motion records; return the exit status.

    ``model`` is the name of a base model, or the path of a model file whose effects are then in the model; ``checked``
    compares the data with their hash.  A failed diagnosis makes the exit status 1.
    """
    shots: list[Shot] = []
    try:
        laws = [read_law(path) for path in request.laws]
        known = known_model(model)
        check_outputs(outputs.json, outputs.export, outputs.report, outputs.model)
    except (AnalysisError, RecordingError, OSError) as error:
        say(error_line(error, model))
        return 1
    settings = replace(settings, effects=known.effects if known else ())
    for path in find_recordings(paths):
        shot = load_and_analyse(path, known.base if known else model, settings=settings, checked=checked)
        say_problem(shot)
        shots.append(shot)
    results = _results(shots, request, laws, known, settings.diagnosis_seconds)
    ok = _write(outputs, results) and not results.failed
    if known is not None and results.diagnosis is not None:
        _say_drift(known, results.diagnosis)
    if outputs.model is not None:
        ok &= _save_model(outputs.model, results)
    return 0 if ok and shots and not any(shot.problem or shot.fit_problem for shot in results.shots) else 1


def _results(
    shots: Sequence[Shot], request: ReplayRequest, laws: Sequence[Effect], known: SavedModel | None, seconds: float
) -> _Results:
    """Carry out the request on analysed shots, the diagnosis within ``seconds``."""
    diagnosis, failed = _diagnosis(shots, laws, seconds) if request.diagnosis else (None, False)
    shots = _with_found(shots, diagnosis)
    prediction = _prediction(shots, known) if request.test_model and known is not None else None
    planned = plan_shots(shots, diagnosis, request.plan, request.reach) if request.plan is not None else None
    failed |= request.test_model and prediction is None
    failed |= request.plan is not None and planned is None
    return _Results(shots, diagnosis, prediction, planned, known.tried if known is not None else (), failed)


def _with_found(shots: Sequence[Shot], diagnosis: Diagnosis | None) -> Sequence[Shot]:
    """Return the shots with the effects found in their model."""
    if diagnosis is None:
        return shots
    if diagnosis.drive is not None:  # a drive's shots are refitted individually
        return [fit_shot(shot, diagnosis.fit_after.effects) for shot in shots]
    return read_together(shots, diagnosis.fit_after) if diagnosis.verdict is Verdict.EFFECT_FOUND else shots


def _diagnosis(shots: Sequence[Shot], laws: Sequence[Effect], seconds: float) -> tuple[Diagnosis | None, bool]:
    """Return the joint diagnosis of all fitted shots, or None, and whether the diagnosis failed.

    Without a diagnosis of fitted shots one line on standard error says why.
    """
    shots = fitted_shots(shots)
    if not shots:
        return None, False
    if why := why_no_joint_fit(shots):
        say(f"no joint diagnosis: {why}")
        return None, False
    accepted = shots[0].settings.effects
    found = _or_said(lambda: diagnose(shots, accepted=accepted, laws=laws, seconds=seconds), "no diagnosis")
    if found is None:
        return None, True
    if found.not_asked:
        say(f"not computed within {seconds:g} s: {'; '.join(found.not_asked)}")
    return found, False


def _prediction(shots: Sequence[Shot], known: SavedModel) -> PredictionTest | None:
    """Return the errors of the model file's predictions; after a failure print one line on stderr, return None."""
    prediction = _or_said(lambda: predicted([shot for shot in shots if not shot.problem], known), "no prediction")
    for shot in prediction.shots if prediction is not None else ():
        if shot.took_part:
            say(f"{shot.name}: was used to fit the model, so it does not test it")
        if shot.problem:
            say(f"{shot.name}: not predicted: {shot.problem}")
    return prediction


def _or_said(work: Callable[[], Result], lacking: str) -> Result | None:
    """Return the result of ``work``; after a failure print a line beginning with ``lacking`` and return None."""
    try:
        return work()
    except Exception as error:  # the shots' own results are still written
        say(error_line(error, lacking))
        return None


def _say_drift(known: SavedModel, diagnosis: Diagnosis) -> None:
    """Print the parameters of these shots that differ significantly from those in the model file."""
    for name, deviation in significant_drift(known, diagnosis.fit_after).items():
        say(f"{name} deviates by {deviation:+.1f} σ from the model file")


def _save_model(path: Path, results: _Results) -> bool:
    diagnosis = results.diagnosis
    if diagnosis is None or not diagnosis.fit_after.converged:
        say(f"{path}: no model to save without a diagnosis whose fit converged")
        return False
    try:
        write_model(path, diagnosis.fit_after, results.shots, diagnosis, results.tried)
    except RecordingError as error:
        say(error)
        return False
    return True


def _write(outputs: Outputs, results: _Results) -> bool:
    """Write all outputs; a failed one is reported in one line and does not stop the others."""
    texts: list[str] = []
    ok = _written(lambda: texts.append(_json_text(results)), "the result") if outputs.json else True
    for write, where in _files(outputs, results):
        ok &= _written(write, where)
    if outputs.json == "-":
        print("".join(texts), end="")
        return ok
    if (name := outputs.json) and texts:
        ok &= _written(lambda: write_json(texts[0], name), name)
    _print_summary(results)
    return ok


def _json_text(results: _Results) -> str:
    next_shots = {"next_shots": results.planned.result} if results.planned is not None else {}
    return json_text(result(results.shots, results.diagnosis, results.prediction) | next_shots)


def _files(outputs: Outputs, results: _Results) -> Iterator[tuple[Callable[[], object], Path]]:
    """Yield, for each part of the export and for the report, what writes it and where."""
    shots, diagnosis, prediction = results.shots, results.diagnosis, results.prediction
    if (folder := outputs.export) is not None:
        yield partial(export, shots, folder), folder
        if diagnosis is not None:
            yield partial(export_laws, diagnosis, folder), folder
        if prediction is not None:
            yield partial(export_prediction, prediction, folder), folder
        if outputs.hdf5:
            yield partial(export_hdf5, shots, folder), folder
    if outputs.report is not None:
        yield partial(_write_report, outputs.report, results), outputs.report


def _write_report(path: Path, results: _Results) -> None:
    words = results.planned.words if results.planned is not None else ""
    page = report_of(
        results.shots, results.diagnosis, prediction=results.prediction, tried=results.tried, next_shots=words
    )
    write_text_atomic(path, page, sync=True)


def _print_summary(results: _Results) -> None:
    for shot in results.shots:
        if not shot.problem or shot.impact is not None:  # else the problem is already on standard error
            print(summary(shot))
    if results.diagnosis is not None:
        print(f"diagnosis: {results.diagnosis.verdict.value}: {results.diagnosis.sentence}")
    if results.prediction is not None:
        print(prediction_words(results.prediction))
    if results.planned is not None:
        print(f"next: {results.planned.words}")


def _written(write: Callable[[], object], where: object) -> bool:
    """Call ``write`` and return whether it succeeded; report a failure in one line on standard error."""
    try:
        write()
    except Exception as error:
        say(error_line(error, where))
        return False
    return True


def plan_shots(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, parameter: str, reach: Reach | None = None
) -> PlannedShots | None:
    """Plan shots that decide between a diagnosis's candidates (``parameter`` "") or that halve a parameter's ±.

    ``reach`` are the rig's possible speeds, weights and run-up; None: the planning's defaults.  Returns None, after
    one line on standard error, if there is nothing to plan from.
    """
    if diagnosis is None:
        say("nothing planned: there is no diagnosis")
        return None
    if diagnosis.drive is not None:
        say("nothing planned: a drive strikes no plate, so there is no collision to plan")
        return None

    fitted = fitted_shots(shots)

    def planned() -> PlannedShots:
        if parameter:
            refitted = refit_diagnosed(diagnosis.fit_after, motions_of(fitted), lambda: False)
            sharper = plan_precision(refitted, parameter, reach=reach)
            words = f"{shots_in_words(sharper.shots)} would make {sharper.words}."
            return PlannedShots(words, {**sharper.to_json(), "words": words})
        further = plan_next(fitted, diagnosis, reach=reach).plan
        if further is None:
            return PlannedShots(NOTHING_OPEN, None)
        return PlannedShots(further.words, further.to_json())

    return _or_said(planned, "nothing planned")

"""``levimass --replay``: the analysis of the window, without the window."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.diagnosis.diagnose import diagnose as diagnose_motions
from analysis.diagnosis.model_file import SavedModel, drift, saved, to_text
from analysis.diagnosis.result import Diagnosis, Verdict
from analysis.diagnosis.verdict.foretold import Foretold
from analysis.diagnosis.verdict.foretold import foretell as foretell_motions
from analysis.fitted.fit_time import SECONDS, run_in_time
from analysis.fitted.fitted_shot import fit_again, read_together, readings_model, shaking_of
from analysis.planning.next_shot import Reach
from analysis.report import result
from analysis.shot.fit import Fit
from analysis.shot.plates_of_set import why_not_together
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError, AnalysisSettings, Shot
from analysis.uncertainty.budget import combined_of, stated
from analysis.uncertainty.numbers import Origin, of_collision
from app.command_line.options import known_model
from app.command_line.outputs import Outputs, check_outputs, in_a_line
from app.command_line.plan_ahead import Ahead, plan_ahead
from app.report.export import export, export_foretold, export_laws
from app.report.export_hdf5 import export_hdf5
from app.report.page import report_of
from app.session.combined_in_model import with_combined
from app.session.load import complaint, load_and_analyse
from app.words.flag_words import by_weight, flag_words
from instrument.files.law_file import read_law
from instrument.files.recording_error import RecordingError
from instrument.files.recording_search import find_recordings
from instrument.files.recording_writer import write_text_beside

DRIFT_SIGMAS = 4.0


@dataclass(frozen=True, slots=True)
class Asked:
    """What is to be found out of the shots: ``laws`` are files of a person's own, which the diagnosis asks, too.

    ``foretell`` puts a model file to the test, as it is.  ``plan`` asks for the next shots: those that decide (""), or
    that make a parameter surer; ``reach`` is what the rig can do.
    """

    diagnosis: bool = True
    laws: Sequence[Path] = ()
    foretell: bool = False
    plan: str | None = None
    reach: Reach | None = None


def replay(
    paths: Sequence[Path],
    asked: Asked,
    outputs: Outputs,
    *,
    model: str | None,
    settings: AnalysisSettings,
    checked: bool = True,
) -> int:
    """Analyse recordings and motion records; return the exit status.

    ``model`` is a base model's name or the path of a model file, whose effects are then part of the model; ``checked``
    compares the data with their hash.  A diagnosis that fails is a failure.
    """
    shots: list[Shot] = []
    try:
        own = [read_law(path).key for path in asked.laws]
        known = known_model(model)
        check_outputs(outputs.json, outputs.export, outputs.report, outputs.model)
    except (AnalysisError, RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, model)}", file=sys.stderr)
        return 1
    settings = replace(settings, effects=known.effects if known else ())
    for path in find_recordings(paths):
        shot = load_and_analyse(path, known.base if known else model, settings=settings, checked=checked)
        if why := shot.problem or shot.fit_problem:
            print(complaint(shot.path or shot.name, why if shot.problem else f"not fitted: {why}"), file=sys.stderr)
        shots.append(shot)
    diagnosis, failed = _diagnosis(shots, own, settings.diagnosis_seconds) if asked.diagnosis else (None, False)
    if diagnosis is not None and diagnosis.fit_after.model == "driven":  # its records have no overlay to compare
        shots = [fit_again(shot, diagnosis.fit_after.effects) for shot in shots]
    elif diagnosis is not None and diagnosis.verdict is Verdict.EFFECT_FOUND:
        shots = read_together(shots, diagnosis.fit_after)
    told = _foretold(shots, known) if asked.foretell and known is not None else None
    tried = known.tried if known is not None else ()
    ahead = plan_ahead(shots, diagnosis, asked.plan, asked.reach) if asked.plan is not None else None
    ok = _write(shots, diagnosis, told, outputs, tried, ahead) and (told is not None or not asked.foretell)
    ok = ok and (ahead is not None or asked.plan is None) and not failed
    if known is not None and diagnosis is not None:
        _tell_drift(known, diagnosis)
    if outputs.model is not None:
        ok = _save_model(shots, diagnosis, outputs.model, tried) and ok
    return 0 if ok and shots and not any(shot.problem or shot.fit_problem for shot in shots) else 1


def _diagnosis(shots: Sequence[Shot], laws: Sequence[str], seconds: float) -> tuple[Diagnosis | None, bool]:
    """Return one diagnosis over the shots that can take part in it; None, and one line, where there is none.

    The second says whether it failed.
    """
    fitted = [shot for shot in shots if shot.motion is not None and shot.fit is not None]
    if not fitted:
        return None, False
    if why := why_not_together(fitted):
        print(f"levimass: no joint diagnosis: {why}", file=sys.stderr)
        return None, False
    try:
        found = diagnose_motions(
            [shot.motion for shot in fitted if shot.motion is not None],
            model=fitted[0].settings.model,
            accepted=fitted[0].settings.effects,
            laws=laws,
            shakings=[shaking_of(shot) for shot in fitted],
            seconds=seconds,
        )
    except AnalysisError as error:
        print(f"levimass: no diagnosis: {error}", file=sys.stderr)
    except Exception as error:  # a fault of the program's own must not cost the shots their numbers
        print(f"levimass: no diagnosis: {_fault(error)}", file=sys.stderr)
    else:
        if found.not_asked:
            print(f"levimass: no time within {seconds:g} s for {'; '.join(found.not_asked)}", file=sys.stderr)
        return found, False
    return None, True


def _foretold(shots: Sequence[Shot], known: SavedModel) -> Foretold | None:
    """Return what the model file foretells of these shots; None, and one line, where it cannot be put to the test."""
    seen = [shot for shot in shots if shot.motion is not None and not shot.problem]
    motions = [shot.motion for shot in seen if shot.motion is not None]
    try:
        names = [shot.path or shot.name for shot in seen]
        told = run_in_time(lambda: foretell_motions(motions, names, known), SECONDS * (1 + len(seen)))
    except AnalysisError as error:
        print(f"levimass: no prediction: {error}", file=sys.stderr)
        return None
    except Exception as error:  # the shots keep their numbers
        print(f"levimass: no prediction: {_fault(error)}", file=sys.stderr)
        return None
    for shot in told.shots:
        if shot.took_part:
            print(f"levimass: {shot.name}: took part in the model's fit, so it is no test of it", file=sys.stderr)
        if shot.problem:
            print(f"levimass: {shot.name}: not predicted: {shot.problem}", file=sys.stderr)
    return told


def _tell_drift(known: SavedModel, diagnosis: Diagnosis) -> None:
    """Say which parameters of the model file these shots no longer agree with."""
    for name, deviation in drift(known, diagnosis.fit_after).items():
        if abs(deviation) > DRIFT_SIGMAS:
            print(f"levimass: {name} lies {deviation:+.1f} standard deviations from the model file's", file=sys.stderr)


def _save_model(shots: Sequence[Shot], diagnosis: Diagnosis | None, path: Path, tried: Sequence[str]) -> bool:
    if diagnosis is None or not diagnosis.fit_after.converged:
        print(f"levimass: {path}: no model to save without a diagnosis whose fit converged", file=sys.stderr)
        return False
    names = [shot.path or shot.name for shot in shots if shot.fit is not None]
    try:
        model = to_text(saved(diagnosis.fit_after, names, diagnosis, tried))
        write_text_beside(path, with_combined(model, diagnosis.fit_after, shots), sync=True)
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        return False
    return True


def _write(
    shots: Sequence[Shot],
    diagnosis: Diagnosis | None,
    told: Foretold | None,
    outputs: Outputs,
    tried: Sequence[str],
    ahead: Ahead | None,
) -> bool:
    """Write each output for itself, so that one that fails, with a line, costs none of the others."""
    texts: list[str] = []

    def make_text() -> None:
        whole = result(shots, diagnosis, told) | ({"next_shots": ahead.result} if ahead is not None else {})
        texts.append(json.dumps(whole, indent=1, allow_nan=False) + "\n")

    def write_report(path: Path) -> None:
        planned = ahead.words if ahead is not None else ""
        page = report_of(shots, diagnosis, foretold=told, tried=tried, next_shots=planned)
        write_text_beside(path, page, sync=True)

    ok = _done(make_text, "the result") if outputs.json else True
    if (folder := outputs.export) is not None:
        ok &= _done(lambda: export(shots, folder), folder)
        if diagnosis is not None:
            ok &= _done(lambda: export_laws(diagnosis, folder), folder)
        if told is not None:
            ok &= _done(lambda: export_foretold(told, folder), folder)
        if outputs.hdf5:
            ok &= _done(lambda: export_hdf5(shots, folder), folder)
    if (report := outputs.report) is not None:
        ok &= _done(lambda: write_report(report), report)
    if outputs.json == "-":
        print("".join(texts), end="")
        return ok
    if (name := outputs.json) and texts:
        ok &= _done(lambda: write_text_beside(Path(name), texts[0], sync=True), name)
    for shot in shots:
        if not shot.problem or shot.impact is not None:  # else all there is to say stands on standard error
            print(summary(shot))
    if diagnosis is not None:
        print(f"diagnosis: {diagnosis.verdict.value}: {diagnosis.sentence}")
    if told is not None:
        print(told.sentence)
    if ahead is not None:
        print(f"next: {ahead.words}")
    return ok


def _done(write: Callable[[], object], where: object) -> bool:
    """Return whether something was written; where not, why is one line on standard error."""
    try:
        write()
    except (RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, where)}", file=sys.stderr)
    except Exception as error:  # a fault of the program's own must not cost the other outputs
        print(f"levimass: {in_a_line(_fault(error), where)}", file=sys.stderr)
    else:
        return True
    return False


def _fault(error: Exception) -> Exception:
    return AnalysisError(f"a fault of the program: {type(error).__name__}: {' '.join(str(error).split())}")


def summary(shot: Shot) -> str:
    """Return one shot's numbers for a terminal, with their combined uncertainties where they have a budget."""
    lines, combined = [f"{shot.path or shot.name}"], combined_of(shot)
    if shot.problem:
        lines.append(f"  not analysed: {shot.problem}")
    if shot.impact is not None:
        for number in of_collision(Origin.READ):
            reading = stated(number.find(shot), number.key, combined)
            shown = reading.scaled(number.scale) if isinstance(reading, Quantity) else f"– ({reading.reason})"
            lines.append(f"  {number.title:<27}{shown} {number.shown_unit}".rstrip())
        rests = readings_model(shot)
        if rests is not None and shot.readings_fit is not None:
            model, again = _with_effects(rests.base, rests.effects), ", ".join(rests.readings)
            lines.append(f"  made again with model {model}, which the diagnosis found: {again}")
    if shot.fit is not None and shot.fit.converged:
        lines += fit_lines(shot.fit, combined)
    if shot.flags:
        lines += [f"  {flag}: {flag_words(flag)}" for flag in by_weight(shot.flags)]
    return "\n".join(lines)


def fit_lines(fit: Fit, combined: Mapping[str, float]) -> list[str]:
    """Return a fitted model's numbers for a terminal; those without a combined uncertainty say so."""
    lines = [f"  fit of model {_with_effects(fit.model, fit.effects)}, reduced chi2 {fit.reduced_chi2:.3g}"]
    for name, quantity in fit.parameters.items():
        alone = "" if name in combined else "  (± from noise alone)"
        lines.append(f"    {name:<32} {stated(quantity, name, combined)}{alone}")
    return lines


def _with_effects(base: str, effects: Sequence[str]) -> str:
    return " + ".join((base, *effects))

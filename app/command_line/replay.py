"""``levimass --replay``: the analysis of the window, without the window."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from analysis.diagnosis.diagnose import diagnose as diagnose_motions
from analysis.diagnosis.limit import SECONDS as LONGEST
from analysis.diagnosis.model_file import SavedModel, drift, saved, to_text
from analysis.diagnosis.result import Diagnosis, Verdict
from analysis.diagnosis.verdict.foretold import Foretold
from analysis.diagnosis.verdict.foretold import foretell as foretell_motions
from analysis.fitted.fit_time import SECONDS
from analysis.fitted.fitted_shot import fit_again, read_together, shaking_of
from analysis.fitted.given_up import waited_for
from analysis.fitted.readings_model import readings_model
from analysis.planning.next_shot import Reach
from analysis.report import result
from analysis.shot.fit import Fit
from analysis.shot.one_rig import why_not_together
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError, AnalysisSettings, Shot
from analysis.uncertainty.combined import combined_of, stated
from analysis.uncertainty.series import read
from app.command_line.model_choice import known_model
from app.command_line.outputs import Outputs, check_outputs, in_a_line
from app.command_line.plan_ahead import Ahead, plan_ahead
from app.report.export import export
from app.report.export_foretold import export_foretold
from app.report.export_hdf5 import export_hdf5
from app.report.export_laws import export_laws
from app.report.page import report_of
from app.session.load import complaint, load_and_analyse
from app.session.model_in_use import with_combined
from app.words.flag_words import by_weight, flag_words
from instrument.law_file import read_law
from instrument.recording_error import RecordingError
from instrument.recording_search import find_recordings
from instrument.recording_writer import write_text_beside

DRIFT_SIGMAS = 4.0
NOWHERE = Outputs()


def replay(
    paths: Sequence[Path],
    *,
    outputs: Outputs = NOWHERE,
    diagnose: bool = True,
    model: str | None = None,
    foretell: bool = False,
    laws: Sequence[Path] = (),
    checked: bool = True,
    plan: str | None = None,
    reach: Reach | None = None,
    fit_seconds: float | None = None,
    diagnosis_seconds: float | None = None,
) -> int:
    """Analyse recordings and motion records; return the exit status.

    ``model`` is a base model's name or the path of a model file, whose effects are then part of the model;
    ``foretell`` puts the file's model to the test, as it is.
    ``laws`` are files of a person's own laws, which the diagnosis asks beside its catalogue; ``checked`` compares the
    data with their hash.  ``plan`` asks for the next shots: those that decide (""), or that make a parameter surer;
    ``reach`` is what the rig can do.  ``fit_seconds`` is the longest that the fit of one shot may take,
    ``diagnosis_seconds`` the time after which a diagnosis leaves out what may be left out.  A diagnosis that fails is a
    failure.
    """
    shots: list[Shot] = []
    try:
        own = [read_law(path).key for path in laws]
        known = known_model(model)
        check_outputs(outputs.json, outputs.export, outputs.report, outputs.model)
    except (AnalysisError, RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, model)}", file=sys.stderr)
        return 1
    settings = AnalysisSettings(effects=known.effects if known else (), fit_seconds=fit_seconds or SECONDS)
    for path in find_recordings(paths):
        shot = load_and_analyse(path, known.base if known else model, settings=settings, checked=checked)
        if why := shot.problem or shot.fit_problem:
            print(complaint(shot.path or shot.name, why if shot.problem else f"not fitted: {why}"), file=sys.stderr)
        shots.append(shot)
    diagnosis, failed = _diagnosis(shots, own, diagnosis_seconds or LONGEST) if diagnose else (None, False)
    if diagnosis is not None and diagnosis.fit_after.model == "driven":  # its records have no overlay to compare
        shots = [fit_again(shot, diagnosis.fit_after.effects) for shot in shots]
    elif diagnosis is not None and diagnosis.verdict is Verdict.EFFECT_FOUND:
        shots = read_together(shots, diagnosis.fit_after)
    told = _foretold(shots, known) if foretell and known is not None else None
    tried = known.tried if known is not None else ()
    ahead = plan_ahead(shots, diagnosis, plan, reach) if plan is not None else None
    ok = _write(shots, diagnosis, told, outputs, tried, ahead) and (told is not None or not foretell)
    ok = ok and (ahead is not None or plan is None) and not failed
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
        told = waited_for(lambda: foretell_motions(motions, names, known), SECONDS * (1 + len(seen)))
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
    impact = shot.impact
    if impact is not None:
        rows: list[tuple[str, str, float, str]] = [
            ("v in", "velocity_in_m_per_s", 1.0, "m/s"),
            ("v out", "velocity_out_m_per_s", 1.0, "m/s"),
            ("COR quasi-static", "cor_quasi_static", 1.0, ""),
            ("COR impulse ratio", "cor_impulse", 1.0, ""),
            ("COR kinetic (force peaks)", "cor_kinetic.force_peaks", 1.0, ""),
            ("COR kinetic (contact)", "cor_kinetic.contact", 1.0, ""),
            ("peak force", "force_peak_n", 1.0, "N"),
            ("pulse width (FWHM)", "force_fwhm_s", 1e3, "ms"),
            ("contact", "contact_time_s", 1e3, "ms"),
            ("deflection", "deflection_max_m", 1e3, "mm"),
            ("slope F/deflection", "stiffness_slope_n_per_m", 1.0, "N/m"),
        ]
        for label, key, factor, unit in rows:
            reading = stated(read(shot, key), key, combined)
            shown = reading.scaled(factor) if isinstance(reading, Quantity) else f"– ({reading.reason})"
            lines.append(f"  {label:<27}{shown} {unit}".rstrip())
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

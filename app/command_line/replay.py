"""``levimass --replay``: the analysis of the window, without the window."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from analysis.diagnosis.diagnose import diagnose as diagnose_motions
from analysis.diagnosis.model_file import SavedModel, drift, saved, to_text
from analysis.diagnosis.result import Diagnosis
from analysis.quantity import Quantity, Reading
from analysis.report import result
from analysis.shot import AnalysisError, AnalysisSettings, Shot
from app.command_line.model_choice import known_model
from app.command_line.outputs import check_outputs, in_a_line
from app.report.export import export
from app.report.export_hdf5 import export_hdf5
from app.report.page import report_of
from app.session.load import complaint, load_and_analyse
from instrument.recording_error import RecordingError
from instrument.recording_search import find_recordings
from instrument.recording_writer import write_text_beside

DRIFT_SIGMAS = 4.0


def replay(
    paths: Sequence[Path],
    *,
    json_to: str | None,
    export_to: Path | None,
    diagnose: bool,
    model: str | None,
    report_to: Path | None = None,
    hdf5: bool = False,
    save_model_to: Path | None = None,
) -> int:
    """Analyse recordings and motion records; return the exit status.

    ``model`` is a base model's name or the path of a model file, whose effects are then part of the model.
    """
    shots: list[Shot] = []
    try:
        known = known_model(model)
        check_outputs(json_to, export_to, report_to, save_model_to)
    except (AnalysisError, RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, model)}", file=sys.stderr)
        return 1
    settings = AnalysisSettings(effects=known.effects) if known else None
    for path in find_recordings(paths):
        shot = load_and_analyse(path, known.base if known else model, settings=settings)
        if shot.problem:
            print(complaint(shot.path or shot.name, shot.problem), file=sys.stderr)
        shots.append(shot)
    diagnosis = _diagnosis(shots) if diagnose else None
    ok = _write(shots, diagnosis, json_to, export_to, report_to, hdf5)
    if known is not None and diagnosis is not None:
        _tell_drift(known, diagnosis)
    if save_model_to is not None:
        ok = _save_model(shots, diagnosis, save_model_to) and ok
    return 0 if ok and shots and not any(shot.problem for shot in shots) else 1


def _diagnosis(shots: Sequence[Shot]) -> Diagnosis | None:
    """Return one diagnosis over the shots that can take part in it; None, and one line, where there is none."""
    fitted = [shot for shot in shots if shot.motion is not None and shot.fit is not None]
    if not fitted:
        return None
    models = {shot.settings.model for shot in fitted}
    if len(models) > 1:
        names = ", ".join(sorted(models))
        print(f"levimass: no joint diagnosis: the shots are of different models ({names})", file=sys.stderr)
        return None
    try:
        return diagnose_motions(
            [shot.motion for shot in fitted if shot.motion is not None],
            model=models.pop(),
            accepted=fitted[0].settings.effects,
        )
    except AnalysisError as error:
        print(f"levimass: no diagnosis: {error}", file=sys.stderr)
    except Exception as error:  # a fault of the program's own must not cost the shots their numbers
        cause = " ".join(str(error).split())
        print(f"levimass: no diagnosis: a fault of the program: {type(error).__name__}: {cause}", file=sys.stderr)
    return None


def _tell_drift(known: SavedModel, diagnosis: Diagnosis) -> None:
    """Say which parameters of the model file these shots no longer agree with."""
    for name, deviation in drift(known, diagnosis.fit_after).items():
        if abs(deviation) > DRIFT_SIGMAS:
            print(f"levimass: {name} lies {deviation:+.1f} standard deviations from the model file's", file=sys.stderr)


def _save_model(shots: Sequence[Shot], diagnosis: Diagnosis | None, path: Path) -> bool:
    if diagnosis is None or not diagnosis.fit_after.converged:
        print(f"levimass: {path}: no model to save without a diagnosis whose fit converged", file=sys.stderr)
        return False
    names = [shot.path or shot.name for shot in shots if shot.fit is not None]
    try:
        write_text_beside(path, to_text(saved(diagnosis.fit_after, names, diagnosis)), sync=True)
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        return False
    return True


def _write(
    shots: Sequence[Shot],
    diagnosis: Diagnosis | None,
    json_to: str | None,
    export_to: Path | None,
    report_to: Path | None,
    hdf5: bool,
) -> bool:
    ok = True
    text = json.dumps(result(shots, diagnosis), indent=1, allow_nan=False) + "\n" if json_to else ""
    try:
        if export_to is not None:
            export(shots, export_to)
            if hdf5:
                export_hdf5(shots, export_to)
        if report_to is not None:
            write_text_beside(report_to, report_of(shots, diagnosis), sync=True)
        if json_to and json_to != "-":
            write_text_beside(Path(json_to), text, sync=True)
    except (RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, export_to)}", file=sys.stderr)
        ok = False
    if json_to == "-":
        print(text, end="")
    else:
        for shot in shots:
            if not shot.problem or shot.impact is not None:  # else all there is to say stands on standard error
                print(summary(shot))
        if diagnosis is not None:
            print(f"diagnosis: {diagnosis.verdict.value}: {diagnosis.sentence}")
    return ok


def summary(shot: Shot) -> str:
    """Return one shot's numbers for a terminal."""
    lines = [f"{shot.path or shot.name}"]
    if shot.problem:
        lines.append(f"  not analysed: {shot.problem}")
    impact = shot.impact
    if impact is not None:
        rows: list[tuple[str, Reading, float, str]] = [
            ("v in", impact.velocity_in_m_per_s, 1.0, "m/s"),
            ("v out", impact.velocity_out_m_per_s, 1.0, "m/s"),
            ("COR quasi-static", impact.cor_quasi_static, 1.0, ""),
            ("COR impulse ratio", impact.cor_impulse, 1.0, ""),
            ("COR kinetic (force peaks)", impact.cor_kinetic.force_peaks, 1.0, ""),
            ("peak force", impact.force_peak_n, 1.0, "N"),
            ("pulse width (FWHM)", impact.force_fwhm_s, 1e3, "ms"),
            ("contact", impact.contact_time_s, 1e3, "ms"),
            ("deflection", impact.deflection_max_m, 1e3, "mm"),
            ("slope F/deflection", impact.stiffness_slope_n_per_m, 1.0, "N/m"),
        ]
        for label, reading, factor, unit in rows:
            shown = reading.scaled(factor) if isinstance(reading, Quantity) else f"– ({reading.reason})"
            lines.append(f"  {label:<27}{shown} {unit}".rstrip())
    if shot.fit is not None and shot.fit.converged:
        lines.append(f"  fit of model {shot.fit.model}, reduced chi2 {shot.fit.reduced_chi2:.3g}")
        lines += [f"    {name:<32}{quantity}" for name, quantity in shot.fit.parameters.items()]
    if shot.flags:
        lines.append(f"  flags: {', '.join(shot.flags)}")
    return "\n".join(lines)

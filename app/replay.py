"""``levimass --replay``: the analysis of the window, without the window."""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from analysis.diagnosis.result import Diagnosis
from analysis.pipeline import analyse, analyse_motion
from analysis.quantity import Quantity, Reading
from analysis.report import result
from analysis.shot import AnalysisError, AnalysisSettings, Shot
from analysis.signal.record import motion_from_displacement
from app.export import export
from instrument.motion_file import read_motion
from instrument.recording_error import RecordingError
from instrument.recording_file import read_recording
from instrument.recording_search import find_recordings, is_motion_record
from instrument.recording_writer import write_text_beside

BASE_OF_RECORD = {"plate": "paper", "contact": "contact", "driven": "driven"}  # RECORDING.md's names, the model's


def replay(
    paths: Sequence[Path], *, json_to: str | None, export_to: Path | None, diagnose: bool, model: str | None
) -> int:
    """Analyse recordings and motion records; return the exit status."""
    shots: list[Shot] = []
    for path in find_recordings(paths):
        shot = load_and_analyse(path, model)
        if shot.problem:
            print(f"levimass: {_named(shot)}", file=sys.stderr)
        shots.append(shot)
    diagnosis = _diagnosis(shots) if diagnose else None
    ok = _write(shots, diagnosis, json_to, export_to)
    return 0 if ok and shots and not any(shot.problem for shot in shots) else 1


def load_and_analyse(path: Path, model: str | None = None) -> Shot:
    """Read one recording or motion record and analyse it; a failure is the shot's ``problem``."""
    started = time.perf_counter()
    try:
        if is_motion_record(path):
            record = read_motion(path)
            motion = motion_from_displacement(
                record.time_s,
                record.displacement_m,
                record.velocity_m_per_s,
                record.force_n,
                moving_mass_kg=record.moving_mass_kg,
                moving_mass_u_kg=record.moving_mass_u_kg,
            )
            return analyse_motion(
                motion,
                AnalysisSettings(model=model or BASE_OF_RECORD[record.model]),
                name=path.stem,
                path=str(path),
                load_seconds=time.perf_counter() - started,
            )
        recording = read_recording(path)
    except (RecordingError, AnalysisError) as error:
        return _failed(path, str(error))
    loaded = time.perf_counter() - started
    return analyse(recording, AnalysisSettings(model=model or "paper"), load_seconds=loaded)


def _diagnosis(shots: Sequence[Shot]) -> Diagnosis | None:
    return None


def _write(shots: Sequence[Shot], diagnosis: Diagnosis | None, json_to: str | None, export_to: Path | None) -> bool:
    ok = True
    text = json.dumps(result(shots, diagnosis), indent=1, allow_nan=False) + "\n" if json_to else ""
    try:
        if export_to is not None:
            export(shots, export_to)
        if json_to == "-":
            sys.stdout.write(text)
        elif json_to:
            write_text_beside(Path(json_to), text, sync=True)
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        ok = False
    except OSError as error:
        print(f"levimass: {error.filename or export_to}: {error.strerror or error}", file=sys.stderr)
        ok = False
    if json_to != "-":
        for shot in shots:
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
        lines += [f"    {name:<28}{quantity}" for name, quantity in shot.fit.parameters.items()]
    if shot.flags:
        lines.append(f"  flags: {', '.join(shot.flags)}")
    return "\n".join(lines)


def _failed(path: Path, problem: str) -> Shot:
    return Shot(
        name=path.name.removesuffix(".sigmf-meta").removesuffix(".sigmf-data"),
        path=str(path),
        settings=AnalysisSettings(),
        setup=None,
        sample_rate_hz=None,
        samples=None,
        trigger_time_s=None,
        motion=None,
        impact=None,
        fit=None,
        problem=problem,
    )


def _named(shot: Shot) -> str:
    """Return the problem with the file it belongs to, once."""
    problem = shot.problem or ""
    return problem if shot.path and Path(shot.path).name in problem else f"{shot.path or shot.name}: {problem}"

"""A recording or motion record on disk as an analysed shot, with progress; a failure is the shot's ``problem``."""

import time
from dataclasses import replace
from pathlib import Path

from analysis.pipeline import analyse, analyse_motion
from analysis.shot import AnalysisError, AnalysisSettings, Shot
from analysis.signal.record import motion_from_displacement
from app.jobs import Asked, Report
from instrument.motion_file import read_motion
from instrument.recording_error import RecordingError
from instrument.recording_file import read_recording
from instrument.recording_search import is_motion_record

BASE_OF_RECORD = {"plate": "paper", "contact": "contact", "driven": "driven"}


def read_shot(path: Path, settings: AnalysisSettings, report: Report, cancelled: Asked) -> Shot:
    """Read and analyse; raises Cancelled, nothing else."""
    started = time.perf_counter()
    report(f"reading {path.name}", 0.0)
    try:
        if is_motion_record(path):
            return _motion_record(path, settings, report, cancelled)
        recording = read_recording(path)
        loaded = time.perf_counter() - started
        return analyse(recording, settings, load_seconds=loaded, progress=report, cancelled=cancelled)
    except (RecordingError, AnalysisError) as error:
        return failed(path, settings, str(error))


def _motion_record(path: Path, settings: AnalysisSettings, report: Report, cancelled: Asked) -> Shot:
    record = read_motion(path)
    motion = motion_from_displacement(
        record.time_s,
        record.displacement_m,
        record.velocity_m_per_s,
        record.force_n,
        moving_mass_kg=record.moving_mass_kg,
        moving_mass_u_kg=record.moving_mass_u_kg,
    )
    fitting = replace(settings, model=BASE_OF_RECORD[record.model])
    return analyse_motion(motion, fitting, name=path.stem, path=str(path), progress=report, cancelled=cancelled)


def failed(path: Path, settings: AnalysisSettings, problem: str) -> Shot:
    """Return a shot that could not be read."""
    return Shot(
        name=path.name.removesuffix(".sigmf-meta").removesuffix(".sigmf-data"),
        path=str(path),
        settings=settings,
        setup=None,
        sample_rate_hz=None,
        samples=None,
        trigger_time_s=None,
        motion=None,
        impact=None,
        fit=None,
        problem=problem,
    )

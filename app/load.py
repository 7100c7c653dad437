"""From a path to an analysed shot, whatever lies there; a failure is the shot's ``problem``."""

import time
from pathlib import Path

from analysis.pipeline import analyse, analyse_motion
from analysis.shot import AnalysisError, AnalysisSettings, Shot
from analysis.signal.record import motion_from_displacement
from instrument.motion_file import read_motion
from instrument.recording_error import RecordingError
from instrument.recording_file import read_recording
from instrument.recording_search import is_motion_record

BASE_OF_RECORD = {"plate": "paper", "contact": "contact", "driven": "driven"}  # RECORDING.md's names, the model's


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
        loaded = time.perf_counter() - started
        return analyse(recording, AnalysisSettings(model=model or "paper"), load_seconds=loaded)
    except (RecordingError, AnalysisError) as error:
        return _failed(path, str(error))
    except Exception as error:  # a fault of the program's own must not cost the other shots their analysis
        cause = " ".join(str(error).split())
        return _failed(path, f"a fault of the program: {type(error).__name__}: {cause}")


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


def complaint(path: str, problem: str) -> str:
    """Return the one line for standard error, with the file's name in it once."""
    return f"levimass: {problem}" if Path(path).name in problem else f"levimass: {path}: {problem}"

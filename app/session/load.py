"""Read a recording or motion record and analyse it; an error becomes the shot's ``problem``."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from analysis.collision import Effect
from analysis.pipeline import analyse, analyse_motion
from analysis.shot import SETUP_CORRECTED, AnalysisError, AnalysisSettings, Cancelled, Progress, Recording, Shot, Stop
from analysis.signal import motion_from_displacement
from app.session.entry import Entry
from instrument.files import (
    RecordingError,
    analyse_and_check_hash,
    is_motion_record,
    open_recording,
    open_without_hash,
    read_motion,
    recording_stem,
)


def load_and_analyse(
    path: Path, model: str | None = None, *, settings: AnalysisSettings | None = None, **how: Any
) -> Shot:
    """Return the shot in a file as ``analysed`` does; an error becomes its ``problem``.  Raises Cancelled."""
    try:
        return analysed(path, model, settings=settings, **how)
    except Cancelled:
        raise
    except Exception as error:
        return unanalysed(path, settings or AnalysisSettings(), cause_of(path, error))


def analysed(
    path: Path,
    model: str | None = None,
    *,
    settings: AnalysisSettings | None = None,
    effects_of: Callable[[str], tuple[Effect, ...]] | None = None,
    checked: bool = True,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Shot:
    """Read one recording or motion record and analyse it.

    ``model`` is the base model; default: that of a motion record itself, else that of ``settings``.  ``effects_of``
    maps a base model to the effects in the model, in place of those of ``settings``.  ``checked`` verifies the data's
    hash (flag "data_altered") and takes a third more time.  Raises Cancelled, and any file or analysis error.
    """
    started = time.perf_counter()
    chosen = settings or AnalysisSettings()
    if not is_motion_record(path):
        chosen = _with_model(chosen, model or chosen.model, effects_of)

        def opened(recording: Recording) -> Shot:
            loaded = time.perf_counter() - started
            return analyse(recording, chosen, load_seconds=loaded, progress=progress, cancelled=cancelled)

        return analyse_and_check_hash(path, opened) if checked else opened(open_without_hash(path))
    record = read_motion(path)
    chosen = _with_model(chosen, model or record.base, effects_of)
    right = dict(chosen.corrections)
    mass_u_kg = right.get("moving_mass_u_kg", record.moving_mass_u_kg)
    motion = motion_from_displacement(
        record.time_s,
        record.displacement_m,
        record.velocity_m_per_s,
        record.force_n,
        moving_mass_kg=right.get("moving_mass_kg", record.moving_mass_kg),
        moving_mass_u_kg=mass_u_kg or 0.0,
    )
    if right:
        motion = replace(motion, flags=(*motion.flags, SETUP_CORRECTED))
    return analyse_motion(
        motion,
        chosen,
        name=path.stem,
        path=str(path),
        load_seconds=time.perf_counter() - started,
        progress=progress,
        cancelled=cancelled,
    )


def cause_of(path: Path, error: Exception) -> str:
    """Return one line that says why ``path`` was not analysed."""
    if isinstance(error, RecordingError | AnalysisError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or path}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        return f"{path}: not enough memory"
    return f"a fault of the program: {type(error).__name__}: {' '.join(str(error).split())}"


def _with_model(
    settings: AnalysisSettings, base: str, effects_of: Callable[[str], tuple[Effect, ...]] | None
) -> AnalysisSettings:
    return replace(settings, model=base, effects=settings.effects if effects_of is None else effects_of(base))


def unanalysed(path: Path | None, settings: AnalysisSettings, problem: str, name: str = "") -> Shot:
    """Return a shot without analysis, with the reason as ``problem``; ``path`` is None if it was never saved."""
    return Shot(
        name=name or (recording_stem(path).name if path is not None else ""),
        path=None if path is None else str(path),
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


def raw_of(entry: Entry) -> Recording | None:
    """Return an entry's raw recording, or None if there is none or it cannot be read."""
    if entry.path is None or is_motion_record(entry.path):
        return None
    try:
        return open_recording(entry.path)
    except (RecordingError, OSError):
        return None

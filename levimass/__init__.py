"""Levimass from a script or a notebook: ``read``, ``analyse``, ``diagnose``, ``simulate``.

Results are frozen dataclasses with read-only arrays.  The import is quick; the first call loads the numerics, and the
very first one compiles them (``levimass prepare`` does that beforehand).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from levimass.settings import (
    BASE_MODELS,
    DRIVE,
    ONE_BODY,
    PAPER_MODEL,
    AnalysisChoices,
    AnalysisSettings,
    Setting,
    Value,
    base_model,
    choice,
    declared,
    flag,
    number,
    setting_of,
    settings_of,
)

if TYPE_CHECKING:
    from analysis.diagnosis import Diagnosis
    from analysis.shot import Recording, Shot
    from instrument.files import MotionRecord

__all__ = [
    "BASE_MODELS",
    "DRIVE",
    "ONE_BODY",
    "PAPER_MODEL",
    "AnalysisChoices",
    "AnalysisSettings",
    "Setting",
    "Value",
    "analyse",
    "base_model",
    "choice",
    "declared",
    "diagnose",
    "flag",
    "number",
    "read",
    "setting_of",
    "settings_of",
    "simulate",
]


def read(path: Path | str) -> Recording | MotionRecord:
    """Return the raw recording (counts) or motion record (displacement, velocity, force) at ``path``.

    Raises RecordingError, one line with file and cause.
    """
    from instrument.files import is_motion_record, open_recording, read_motion

    return read_motion(Path(path)) if is_motion_record(Path(path)) else open_recording(path)


def analyse(
    what: Recording | Path | str, *, model: str | None = None, settings: AnalysisSettings | None = None
) -> Shot:
    """Analyse a raw recording, or the recording or motion record at a path.

    ``model`` names the base model ("paper" unless the settings or a motion record say otherwise).  Velocities in m/s,
    force in N, displacement in m, each with its standard deviation: ``shot.motion``; velocities and restitutions:
    ``shot.impact``; the model: ``shot.fit``.  Where a part is missing ``shot.problem`` says why.  Raises
    RecordingError and AnalysisError where nothing can be analysed.
    """
    from dataclasses import replace

    from analysis.pipeline import analyse as analyse_recording
    from app.session import analysed

    if isinstance(what, str | Path):
        return analysed(Path(what), model, settings=settings)
    chosen = settings or AnalysisSettings()
    return analyse_recording(what, replace(chosen, model=model or chosen.model))


def diagnose(shots: Shot | Sequence[Shot], *, accepted: Sequence[str] = ()) -> Diagnosis:
    """Diagnose which effects the model of the shots lacks; several shots of one rig are diagnosed jointly.

    ``accepted`` are effects that are in the model already.  Raises AnalysisError where a shot has no motion, and
    ValueError for an unknown effect or shots of different models.
    """
    from analysis.diagnosis import diagnose as diagnose_shots
    from analysis.shot import Shot

    return diagnose_shots([shots] if isinstance(shots, Shot) else list(shots), accepted=accepted)


def simulate(
    folder: Path | str, shots: int = 3, seed: int = 1, effects: Mapping[str, Mapping[str, float]] | None = None
) -> list[Path]:
    """Write recordings of ``shots`` shots on the simulated bench into ``folder``; return their paths.

    ``effects`` are those of the rig, such as ``{"demodulation_lag": {"time_s": 1e-6}}``.  The same seed gives the same
    counts.  Raises ValueError for an unknown effect, RecordingError where nothing can be written.
    """
    from instrument.bench import simulate as write_simulated

    return write_simulated(folder, shots, seed, effects)


def _main(argv: Sequence[str] | None = None) -> int:
    """Run the command ``levimass``."""
    from app.command_line import main

    return main(argv)


def _window(argv: Sequence[str] | None = None) -> int:
    from app.command_line import window

    return window(argv)

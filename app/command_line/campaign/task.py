"""One shot of a campaign: the task, its analysis in a worker, its outcome, and the check of a worker."""

import os
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.report import shot_result
from analysis.shot import AnalysisSettings, version_and_digest
from app.report import motion_file_names, shot_row, write_motion
from app.session import analysed, cause_of, unanalysed
from instrument.files import FileNotReached, RecordingError, find_mapping, one_line, recording_stem

Entry = dict[str, Any]  # keys: "stamp", "shot" (as in the result file), "row" (of shots.csv)


@dataclass(frozen=True, slots=True)
class ShotTask:
    """One shot to analyse; paths are absolute, because a worker may have another working folder.

    ``stamp`` identifies files, settings, ``checked`` and program; ``sizes`` are the sizes of the shot's files in
    bytes (-1: no such file) on the machine that made the task.
    """

    path: str
    base: str | None
    settings: AnalysisSettings
    motion_csv: str | None
    checked: bool
    stamp: str
    sizes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class NotReached:
    """The outcome of a shot that could not be reached: a missing folder, a full disk, a dead worker.

    It is not written to the journal, so that the next call tries the shot again.
    """

    cause: str


Outcome = Entry | NotReached


def tasks_of(
    found: Sequence[Path],
    base: str | None,
    settings: AnalysisSettings,
    export_to: Path | None,
    *,
    checked: bool = True,
) -> list[ShotTask]:
    """Return a task for each shot; with ``export_to`` the task also writes the shot's motion to that folder."""
    names = motion_file_names([recording_stem(path).stem for path in found])
    tasks = []
    for path, name in zip(found, names, strict=True):
        csv = str(export_to.absolute() / name) if export_to is not None else None
        sizes, dates = _state(path)
        stamp = (version_and_digest(), base, settings, csv, checked, str(path.resolve()), sizes, dates)
        text = "|".join(map(str, stamp))
        tasks.append(ShotTask(str(path.absolute()), base, settings, csv, checked, text, sizes))
    return tasks


def analyse_one(task: ShotTask) -> Outcome:
    """Analyse one shot; runs in a worker."""
    path = Path(task.path)
    if _state(path)[0] != task.sizes:
        return NotReached(f"{path}: the files differ from those of the task (another folder, or still being copied)")
    motion_csv = ""
    try:
        shot = analysed(path, task.base, settings=task.settings, checked=task.checked)
        if task.motion_csv and shot.motion is not None:
            write_motion(shot, Path(task.motion_csv))
            motion_csv = Path(task.motion_csv).name
    except (FileNotReached, OSError, MemoryError) as error:
        return NotReached(one_line(cause_of(path, error), 600))
    except Exception as error:
        if task.motion_csv and isinstance(error, RecordingError) and error.path == task.motion_csv:
            return NotReached(str(error))
        shot = unanalysed(path, task.settings, cause_of(path, error))
    return {"stamp": task.stamp, "shot": shot_result(shot), "row": shot_row(shot, motion_csv)}


def failed_entry(task: ShotTask, cause: str) -> Entry:
    """Return the result entry of a shot that was not reached."""
    name = recording_stem(task.path).name
    shot = {"name": name, "path": task.path, "status": "failed", "problem": cause, "flags": []}
    return {"stamp": task.stamp, "shot": shot, "row": [name, task.path, "", "failed", cause]}


def _state(path: Path) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the sizes in bytes and the modification times in ns of a shot's files, -1 for a missing file."""
    stem = recording_stem(path)
    others = (stem.with_name(stem.name + ".sigmf-data"), path.with_suffix(".toml"), find_mapping(path) or path)
    sizes, dates = [], []
    for file in (path, *others):
        try:
            state = file.stat()
        except (OSError, ValueError):
            sizes.append(-1)
            dates.append(-1)
        else:
            sizes.append(state.st_size)
            dates.append(state.st_mtime_ns)
    return tuple(sizes), tuple(dates)


def why_unusable(wanted_program: str, reads: Iterable[str], writes: str | None) -> str | None:
    """Return why this worker cannot read from and write to these folders, or None; runs in the worker."""
    if (own := version_and_digest()) != wanted_program:
        return f"has levimass {own}, not {wanted_program}"
    for folder in reads:
        if not os.path.isdir(folder):
            return f"does not see the folder {folder}"
        if not os.access(folder, os.R_OK | os.X_OK):
            return f"may not read the folder {folder}"
    if writes is not None:
        trial = Path(writes) / f".levimass-{uuid.uuid4().hex}"
        try:
            trial.write_bytes(b"levimass")
            trial.unlink()
        except OSError as error:
            return f"cannot write to {writes} ({error.strerror or error})"
    return None

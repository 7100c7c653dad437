"""One shot of a campaign, as it is handed out and as it comes back; and who can take it."""

import os
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.report import shot_result
from analysis.shot.shot import AnalysisSettings
from analysis.shot.version import program
from app.report.export import motion_file_names, shot_row, write_motion
from app.session.load import analysed, cause_of, unanalysed
from instrument.files.foreign.mapping import find_mapping
from instrument.files.recording_error import FileNotReached, RecordingError, one_line
from instrument.files.recording_search import recording_stem

Entry = dict[str, Any]  # "stamp", "shot" as in the result file, "row" of shots.csv


@dataclass(frozen=True, slots=True)
class Task:
    """One shot to analyse; its paths are absolute, as a worker may stand in another folder.

    ``stamp`` changes when the files, the settings, whether the data are ``checked``, or the program do; ``sizes`` are
    those of the shot's files (bytes, -1 where there is none) as seen by who hands it out.
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
    """Why a shot was not analysed though nothing is wrong with it: a missing folder, a full disk, a worker that died.

    That is no result: it stands in no journal, and the next call tries again.
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
) -> list[Task]:
    """Return a task for each shot that was found; motion is written to ``export_to`` where that is given."""
    names = motion_file_names([recording_stem(path).stem for path in found])
    tasks = []
    for path, name in zip(found, names, strict=True):
        csv = str(export_to.absolute() / name) if export_to is not None else None
        sizes, dates = _state(path)
        stamp = (program(), base, settings, csv, checked, str(path.resolve()), sizes, dates)
        text = "|".join(map(str, stamp))
        tasks.append(Task(str(path.absolute()), base, settings, csv, checked, text, sizes))
    return tasks


def analyse_one(task: Task) -> Outcome:
    """Analyse one shot, in a worker."""
    path = Path(task.path)
    if _state(path)[0] != task.sizes:
        return NotReached(f"{path}: not here as it was handed out (another folder, or still being copied)")
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


def failed_entry(task: Task, cause: str) -> Entry:
    """Return what stands in the results for a shot that was not reached."""
    name = recording_stem(task.path).name
    shot = {"name": name, "path": task.path, "status": "failed", "problem": cause, "flags": []}
    return {"stamp": task.stamp, "shot": shot, "row": [name, task.path, "", "failed", cause]}


def _state(path: Path) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return sizes and dates of the files that make up a shot."""
    stem = recording_stem(path)
    beside = (stem.with_name(stem.name + ".sigmf-data"), path.with_suffix(".toml"), find_mapping(path) or path)
    sizes, dates = [], []
    for file in (path, *beside):
        try:
            state = file.stat()
        except (OSError, ValueError):
            sizes.append(-1)
            dates.append(-1)
        else:
            sizes.append(state.st_size)
            dates.append(state.st_mtime_ns)
    return tuple(sizes), tuple(dates)


def unfit(wanted_program: str, reads: Iterable[str], writes: str | None) -> str | None:
    """Return why work that reads from and writes to these folders cannot be done here, or None."""
    if (own := program()) != wanted_program:
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

"""Export a session as CSV, HDF5, report or model file; save shots that are only in memory.

The functions run in a subprocess; slow imports are inside those that need them, so that the window starts quickly.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis
from analysis.shot import Progress, Shot, Stop
from app.session.entry import Entry
from app.session.jobs import EventKind, JobQueues, Jobs, Notify
from app.session.model_in_use import predictions_of, save_model
from app.session.session import Session
from app.session.verdict_basis import Diagnoses
from app.words import counted
from instrument.files import SomeShotsNotSaved, write_text_atomic


def write_report(
    path: Path,
    shots: Sequence[Shot],
    diagnosis: Diagnosis | None,
    tried: Sequence[Effect],
    *,
    progress: Progress,
    cancelled: Stop,
) -> str:
    """Write the report as PDF or HTML, by the path's ending; return a message."""
    text = report_text(shots, diagnosis, tried, progress=progress, cancelled=cancelled)
    if path.suffix.lower() == ".pdf":
        from app.report import write_pdf  # only this needs Qt

        write_pdf(text, path)
    else:
        write_text_atomic(path, text, sync=True)
    return f"Report of {counted(len(shots), 'shot')} saved as {path}"


def report_text(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, tried: Sequence[Effect], *, progress: Progress, cancelled: Stop
) -> str:
    """Return the report as HTML; ``tried`` are effects in the model that no diagnosis found."""
    from app.report import report_of

    progress("drawing the report", 0.2)
    return report_of(shots, diagnosis, tried=tried)


def write_hdf5(shots: Sequence[Shot], folder: Path, *, progress: Progress, cancelled: Stop) -> str:
    """Write the motion of each shot as HDF5; return a message."""
    from app.report import export_hdf5

    progress("writing HDF5", 0.1)
    folder.mkdir(parents=True, exist_ok=True)
    written = export_hdf5(shots, folder)
    return f"{counted(len(written), 'shot')} exported to {folder} as HDF5"


def write_csv(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, folder: Path, *, progress: Progress, cancelled: Stop
) -> str:
    """Write these shots and the laws learned by a diagnosis as CSV; return a message."""
    from app.report import export, export_laws

    progress("writing CSV", 0.1)
    written = export(shots, folder)
    if diagnosis is not None:
        written += export_laws(diagnosis, folder)
    return f"{counted(len(shots), 'shot')} exported to {folder} ({counted(len(written), 'file')})"


class Exports:
    """Jobs that write files from the given entries, or from all if none of them is in the session."""

    def __init__(self, session: Session, work: JobQueues, diagnoses: Diagnoses, notify: Notify) -> None:
        self._session, self._work, self._diagnoses, self._notify = session, work, diagnoses, notify

    def export(self, numbers: Sequence[int], folder: Path) -> None:
        """Queue the export of these entries as CSV."""
        shots, diagnosis = self._reported(numbers)
        self._submit("export", partial(write_csv, shots, diagnosis, folder))

    def export_hdf5(self, numbers: Sequence[int], folder: Path) -> None:
        """Queue the export of these entries as HDF5."""
        shots, _ = self._reported(numbers)
        self._submit("export", partial(write_hdf5, shots, folder))

    def test_model(self, numbers: Sequence[int], path: Path) -> None:
        """Queue the test of a model file's predictions, without refitting it, on these entries."""
        shots = [entry.shot for entry in self._entries(numbers) if entry.shot is not None]
        self._submit("test of a model file", partial(predictions_of, path, shots))

    def report(self, numbers: Sequence[int], path: Path) -> None:
        """Queue the report on these entries as one HTML or PDF file."""
        self._submit("report", partial(write_report, path, *self._reported(numbers), self._session.effects.tried))

    def report_to_print(self, numbers: Sequence[int]) -> None:
        """Queue the report's HTML text, which arrives as a PRINT event."""
        making = partial(report_text, *self._reported(numbers), self._session.effects.tried)
        self._submit("report", making, EventKind.PRINT)

    def save_model(self, numbers: Sequence[int], path: Path) -> None:
        """Queue the writing of a model file from a joint fit to these entries."""
        entries = [e for e in self._entries(numbers) if e.shot is not None]
        shots = [entry.shot for entry in entries if entry.shot is not None]
        chosen, effects = {e.number for e in entries}, self._session.effects
        same = (found.diagnosis for found in reversed(self._diagnoses) if set(found.numbers) == chosen)
        self._submit("model file", partial(save_model, path, shots, effects, next(same, None)))

    def _entries(self, numbers: Sequence[int]) -> list[Entry]:
        """Return these entries, or all entries if none of them is in the session."""
        return self._session.entries_with(numbers) or list(self._session.entries)

    def _reported(self, numbers: Sequence[int]) -> tuple[list[Shot], Diagnosis | None]:
        entries = self._entries(numbers)
        there = [(entry, entry.shot) for entry in entries if entry.shot is not None]
        shots = [replace(shot, note=entry.note, plot_notes=entry.plot_notes) for entry, shot in there]
        chosen = {entry.number for entry in entries}
        found = self._diagnoses.within(chosen)
        return shots, found.diagnosis if found is not None else None

    def _submit(self, name: str, write: Callable[..., str], event_kind: EventKind = EventKind.EXPORTED) -> None:
        self._work.submit_long(name, write, "export", partial(self._notify, event_kind))


class UnsavedShots:
    """Saves shots that are only in memory, and keeps their new paths by name."""

    def __init__(self, session: Session, short_jobs: Jobs, notify: Notify) -> None:
        self._session, self._short_jobs, self._notify = session, short_jobs, notify
        self._early_paths: dict[str, str] = {}  # name -> new path of shots whose analysis has not finished

    def save(self, save: Callable[[Path], dict[str, Path]], folder: Path) -> None:
        """Queue the saving; ``save(folder)`` writes the shots and returns their paths by name."""

        def work(_: Progress, __: Stop) -> tuple[dict[str, Path], str | None]:
            try:
                return save(folder), None
            except SomeShotsNotSaved as error:
                return error.saved, str(error)

        self._short_jobs.submit("saving elsewhere", work, "save", partial(self._take, folder))

    def path_of(self, name: str) -> str | None:
        """Return, once, the path to which a shot was saved before its analysis ended, or None."""
        return self._early_paths.pop(name, None)

    def _take(self, folder: Path, saved: tuple[dict[str, Path], str | None]) -> None:
        """Set the new paths in the session and report the outcome."""
        paths, problem = saved
        for name, path in paths.items():
            if not self._session.set_path(name, str(path)):
                self._early_paths[name] = str(path)
        count = len(paths)
        words = f"{counted(count, 'shot')} saved to {folder}" if count else "no shot to save"
        if problem is None:
            self._notify(EventKind.EXPORTED, words)
        else:
            before = f"{words}; " if count else ""
            self._notify(EventKind.PROBLEM, f"{before}the other shots remain in memory: {problem}")

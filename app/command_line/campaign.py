"""``--replay FOLDER --jobs N``: thousands of shots over processes or machines, resumable; no bad shot stops it."""

import json
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any, TextIO

from analysis.report import SCHEMA, program_version, shot_result
from analysis.shot import AnalysisError, AnalysisSettings
from app.command_line.model_choice import known_model
from app.command_line.outputs import check_outputs, in_a_line
from app.report.export import motion_file_names, shot_row, write_motion, write_shots
from app.session.load import complaint, load_and_analyse
from instrument.foreign.remembered import remembered_mapping
from instrument.recording_error import RecordingError
from instrument.recording_search import find_recordings, recording_stem
from instrument.recording_writer import write_text_beside

JOURNAL = "campaign.jsonl"
SCHEDULER_ANSWERS_S = 10.0
AHEAD = 4  # shots handed out for each worker, so that none waits and none hoards


@dataclass(frozen=True, slots=True)
class Task:
    """One shot to analyse; ``stamp`` changes when the files, the model or the program do."""

    path: str
    model: str | None
    motion_csv: str | None
    stamp: str


def campaign(
    paths: Sequence[Path],
    *,
    jobs: int | None,
    scheduler: str | None,
    json_to: str | None,
    export_to: Path | None,
    model: str | None,
) -> int:
    """Analyse every shot under ``paths``; return the exit status.

    What is done stands in a journal in ``export_to`` (or beside ``json_to``) and is not done again by the next call.
    The shots are not joined into one diagnosis: the result's ``diagnosis`` is null.
    """
    found = find_recordings(paths)
    try:
        known_model(model)  # once here, so that a bad file is said once
        check_outputs(json_to, export_to)
    except (AnalysisError, RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, model)}", file=sys.stderr)
        return 1
    tasks = _tasks(found, model, export_to)
    journal = _journal(json_to, export_to)
    try:
        done = _read(journal, {task.stamp for task in tasks})
        todo = [task for task in tasks if task.stamp not in done]
        for task in tasks:
            if task.stamp in done and (problem := done[task.stamp]["shot"]["problem"]):
                print(complaint(task.path, problem), file=sys.stderr)
        with _workers(jobs, scheduler) as (executor, width), _appended(journal) as log:
            done |= _run(executor, width, todo, log, already=len(tasks) - len(todo))
        _write([done[task.stamp] for task in tasks], json_to, export_to)
    except (RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, scheduler or export_to)}", file=sys.stderr)
        return 1
    return _told([done[task.stamp]["shot"] for task in tasks], json_to)


def _tasks(found: Sequence[Path], model: str | None, export_to: Path | None) -> list[Task]:
    names = motion_file_names([recording_stem(path).stem for path in found])
    tasks = []
    for path, name in zip(found, names, strict=True):
        csv = str(export_to / name) if export_to is not None else None
        tasks.append(Task(str(path), model, csv, _stamp(path, model, csv)))
    return tasks


def _stamp(path: Path, model: str | None, motion_csv: str | None) -> str:
    parts = [program_version(), str(model), str(motion_csv), str(path.resolve())]
    stem = recording_stem(path)
    beside = (stem.with_name(stem.name + ".sigmf-data"), path.with_suffix(".toml"), remembered_mapping(path) or path)
    for file in (path, *beside):
        try:
            state = file.stat()
            parts.append(f"{state.st_size}:{state.st_mtime_ns}")
        except OSError:
            parts.append("-")
    return "|".join(parts)


def analyse_one(task: Task) -> dict[str, Any]:
    """Analyse one shot in a worker; return its result entry and its row of ``shots.csv``."""
    known = known_model(task.model)
    settings = AnalysisSettings(effects=known.effects) if known else None
    shot = load_and_analyse(Path(task.path), known.base if known else task.model, settings=settings)
    motion_csv = ""
    if task.motion_csv and shot.motion is not None:
        write_motion(shot, Path(task.motion_csv))
        motion_csv = Path(task.motion_csv).name
    return {"stamp": task.stamp, "shot": shot_result(shot), "row": shot_row(shot, motion_csv)}


def _run(executor: Executor, width: int, todo: Sequence[Task], log: TextIO, already: int) -> dict[str, dict[str, Any]]:
    """Keep the workers fed, write each result to the journal as it comes, say how far it is."""
    done: dict[str, dict[str, Any]] = {}
    waiting = iter(todo)
    running: dict[Future[dict[str, Any]], Task] = {}
    progress = _Progress(len(todo), already)

    def hand_out() -> None:
        while len(running) < AHEAD * width:
            task = next(waiting, None)
            if task is None:
                return
            running[executor.submit(analyse_one, task)] = task

    hand_out()
    while running:
        ready = [future for future in running if future.done()]
        if not ready:
            time.sleep(0.005)
            continue
        for future in ready:
            task = running.pop(future)
            try:
                entry = future.result()
            except Exception as error:  # the worker itself died, or its disk was full: this shot, not the campaign
                entry = _lost(task, error)
            else:
                log.write(json.dumps(entry, allow_nan=False) + "\n")
                log.flush()
            done[task.stamp] = entry
            progress.step()
            if problem := entry["shot"]["problem"]:
                progress.say(complaint(task.path, problem))
        hand_out()
    progress.end()
    return done


def _lost(task: Task, error: Exception) -> dict[str, Any]:
    cause = " ".join(str(error).split()) or type(error).__name__
    shot = {"name": Path(task.path).stem, "path": task.path, "status": "failed", "problem": cause, "flags": []}
    return {"stamp": task.stamp, "shot": shot, "row": [shot["name"], task.path, "", "failed", cause]}


def _write(entries: Sequence[dict[str, Any]], json_to: str | None, export_to: Path | None) -> None:
    if export_to is not None:
        write_shots([entry["row"] for entry in entries], export_to / "shots.csv")
    if json_to and json_to != "-":
        write_text_beside(Path(json_to), _result_text([entry["shot"] for entry in entries]), sync=True)


def _result_text(shots: Sequence[dict[str, Any]]) -> str:
    whole = {"schema": SCHEMA, "version": program_version(), "shots": shots, "diagnosis": None}
    return json.dumps(whole, indent=1, allow_nan=False) + "\n"


def _told(shots: Sequence[dict[str, Any]], json_to: str | None) -> int:
    failed = sum(shot["status"] == "failed" for shot in shots)
    if json_to == "-":
        print(_result_text(shots), end="")
    else:
        print(f"{len(shots)} shots, {len(shots) - failed} analysed, {failed} failed")
    return 1 if failed or not shots else 0


def _journal(json_to: str | None, export_to: Path | None) -> Path | None:
    if export_to is not None:
        return export_to / JOURNAL
    return Path(json_to + ".journal") if json_to and json_to != "-" else None


def _read(journal: Path | None, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Return what an earlier call left, by stamp; a last line cut off by a crash is passed over."""
    done: dict[str, dict[str, Any]] = {}
    if journal is None or not journal.exists():
        return done
    for line in journal.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entry = json.loads(line)
            if entry["stamp"] in wanted and isinstance(entry["shot"]["status"], str):
                done[entry["stamp"]] = entry
        except (ValueError, KeyError, TypeError):
            continue
    return done


@contextmanager
def _appended(journal: Path | None) -> Iterator[TextIO]:
    with open(journal or os.devnull, "a", encoding="utf-8") as log:
        if journal is not None and log.tell():
            log.write("\n")  # whatever a crash left of the last line stays a line of its own
        yield log


@contextmanager
def _workers(jobs: int | None, scheduler: str | None) -> Iterator[tuple[Executor, int]]:
    """Give an executor and how many shots it works on at once; OSError where the scheduler does not answer."""
    if scheduler is None:
        count = jobs or 1
        # spawned, not forked: a forked child of a process with compiled kernels and threads may hang
        with _Pool(count, mp_context=get_context("spawn")) as pool:
            try:
                yield pool, count
            except KeyboardInterrupt:
                for worker in active_children():  # what they have not finished is done by the next call
                    worker.terminate()
                raise
        return
    try:
        from distributed import Client
    except ImportError:
        raise OSError(0, "needs dask.distributed: pip install 'levimass[cluster]'", "--scheduler") from None
    try:
        client = Client(scheduler, timeout=SCHEDULER_ANSWERS_S, set_as_default=False)
    except ValueError as error:  # an address that is none
        raise OSError(0, str(error), scheduler) from None
    with client:
        width = sum(client.nthreads().values()) or 1
        yield client.get_executor(pure=False), width


class _Pool(ProcessPoolExecutor):
    """Processes that leave Ctrl-C to the one that started them: a terminal sends it to all, and each would complain."""

    def submit(self, *work: Any, **more: Any) -> Future[Any]:
        """Hand out work; a process that is started for it inherits that Ctrl-C is held back, for good."""
        if not hasattr(signal, "pthread_sigmask"):
            return super().submit(*work, **more)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(*work, **more)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Progress:
    """A line on a terminal that counts shots; on anything else silence, as logs have no use for it."""

    def __init__(self, total: int, already: int) -> None:
        self._total, self._already, self._done = total, already, 0
        self._shown = sys.stderr.isatty()
        self._started = time.monotonic()
        if already and self._shown:
            self.say(f"levimass: {already} shots were done before and are not done again")

    def step(self) -> None:
        """Count one shot."""
        self._done += 1
        if self._shown:
            spent = time.monotonic() - self._started
            left = spent / self._done * (self._total - self._done)
            sys.stderr.write(f"\r{self._done}/{self._total} shots, {left:.0f} s to go \x1b[K")

    def say(self, line: str) -> None:
        """Print a line without disturbing the count."""
        sys.stderr.write(("\r\x1b[K" if self._shown else "") + line + "\n")

    def end(self) -> None:
        """Leave the terminal on a fresh line."""
        if self._shown and self._total:
            sys.stderr.write("\n")

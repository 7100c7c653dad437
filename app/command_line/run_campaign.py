"""``--replay FOLDER --jobs N | --scheduler ADDRESS``: analyse thousands of shots, with resumption after a stop."""

import contextlib
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from analysis.report import SCHEMA
from analysis.shot import AnalysisError, AnalysisSettings, program_version
from app.command_line.campaign.journal import JOURNAL, Journal
from app.command_line.campaign.task import Entry, NotReached, ShotTask, failed_entry, tasks_of
from app.command_line.campaign.worker_pool import ProcessPool, WorkerPool
from app.command_line.options import known_model
from app.command_line.outputs import Outputs, check_outputs, error_line, problem_line, say
from app.report import shot_columns, write_table
from instrument.files import RecordingError, find_recordings, write_text_atomic

TASKS_PER_WORKER = 4  # tasks queued per worker, so that no worker waits


def campaign(
    paths: Sequence[Path],
    outputs: Outputs,
    *,
    jobs: int | None,
    scheduler: str | None,
    insecure: bool,
    model: str | None,
    settings: AnalysisSettings,
    checked: bool = True,
) -> int:
    """Analyse every shot under ``paths``; return the exit status.

    The workers are ``jobs`` local processes or those of a dask ``scheduler``; ``insecure`` permits one without TLS.
    Finished shots are recorded in a journal in the export folder (or next to the result file), and the next call
    skips them.  Shots that were not reached are not recorded.  There is no joint diagnosis.  ``checked`` compares the
    data with their hash, which takes a third of the time.
    """
    found = find_recordings(paths)
    try:
        known = known_model(model)
        check_outputs(outputs.json, outputs.export)
        settings = replace(settings, effects=known.effects if known else ())
        tasks = tasks_of(found, known.base if known else model, settings, outputs.export, checked=checked)
        with contextlib.closing(_journal(outputs, tasks)) as journal:
            if lines := journal.unreadable_lines:
                which = "a line is" if lines == 1 else f"{lines} lines are"
                say(f"{journal.path}: {which} damaged and ignored; their shots are analysed again")
            todo = [task for task in tasks if task.stamp not in journal]
            _repeat_problems(tasks, journal)
            not_reached: dict[str, str] = {}
            if todo:
                with contextlib.closing(_worker_pool(jobs, scheduler, insecure, todo)) as pool:
                    not_reached = _run(pool, todo, journal, already=len(tasks) - len(todo))
            return _write_results(found, tasks, journal, not_reached, outputs)
    except (AnalysisError, RecordingError, OSError) as error:
        say(error_line(error, model or scheduler or outputs.export))
        return 1


def _journal(outputs: Outputs, tasks: Sequence[ShotTask]) -> Journal:
    by_result = Path(outputs.json + ".journal") if outputs.json and outputs.json != "-" else None
    path = outputs.export / JOURNAL if outputs.export is not None else by_result
    return Journal(path, {task.stamp for task in tasks})


def _worker_pool(jobs: int | None, scheduler: str | None, insecure: bool, todo: Sequence[ShotTask]) -> WorkerPool:
    if scheduler is None:
        return ProcessPool(jobs or 1)
    from app.command_line.campaign.cluster import Cluster  # needs the optional dask.distributed

    return Cluster(scheduler, todo, say, insecure=insecure)


def _repeat_problems(tasks: Sequence[ShotTask], journal: Journal) -> None:
    """Report the problems of shots that an earlier call finished."""
    for task in tasks:
        if task.stamp in journal and (problem := journal.entry(task.stamp)["shot"]["problem"]):
            say(problem_line(task.path, problem))


def _run(pool: WorkerPool, todo: Sequence[ShotTask], journal: Journal, already: int) -> dict[str, str]:
    """Distribute tasks and write their results to the journal; return the causes of shots not reached, by stamp."""
    not_reached: dict[str, str] = {}
    waiting = iter(todo)
    under_way, left = 0, len(todo)
    progress = ProgressLine(left, already)
    try:
        while left:
            while under_way < max(1, TASKS_PER_WORKER * pool.width) and (task := next(waiting, None)) is not None:
                pool.give(task)
                under_way += 1
            for task, outcome in pool.take():
                under_way, left = under_way - 1, left - 1
                progress.step()
                if isinstance(outcome, NotReached):
                    not_reached[task.stamp] = problem = outcome.cause
                else:
                    journal.add(outcome)
                    problem = outcome["shot"]["problem"]
                if problem:
                    progress.say(problem_line(task.path, problem))
    finally:
        progress.end()
    return not_reached


def _write_results(
    found: Sequence[Path],
    tasks: Sequence[ShotTask],
    journal: Journal,
    not_reached: dict[str, str],
    outputs: Outputs,
) -> int:
    """Write the result files, with one shot in memory at a time, and print the counts; return the exit status."""

    def entries() -> Iterator[Entry]:
        for path, task in zip(found, tasks, strict=True):
            done = task.stamp in journal
            entry = journal.entry(task.stamp) if done else failed_entry(task, not_reached[task.stamp])
            entry["shot"]["path"] = entry["row"][1] = str(path)  # as given on the command line
            yield entry

    if outputs.export is not None:
        write_table(shot_columns(), (entry["row"] for entry in entries()), outputs.export / "shots.csv")
    if outputs.json and outputs.json != "-":
        write_text_atomic(Path(outputs.json), _result_text(entries()), sync=True)
    missed = sum(task.stamp not in journal for task in tasks)
    failures = sum(entry["shot"]["status"] == "failed" for entry in entries()) - missed
    if outputs.json == "-":
        for piece in _result_text(entries()):
            print(piece, end="")
    else:
        again = f", {missed} not reached (repeat the command to try them again)" if missed else ""
        analysed = len(tasks) - failures - missed
        print(f"{len(tasks)} shots, {analysed} analysed, {failures} failed{again}")
    return 1 if failures or missed or not tasks else 0


def _result_text(entries: Iterator[Entry]) -> Iterator[str]:
    head = json.dumps({"schema": SCHEMA, "version": program_version()}, indent=1)
    yield head.removesuffix("\n}") + ',\n "shots": ['
    for number, entry in enumerate(entries):
        yield ("," if number else "") + "\n" + json.dumps(entry["shot"], indent=1, allow_nan=False)
    yield '],\n "diagnosis": null\n}\n'


class ProgressLine:
    """A progress counter on the terminal; it shows nothing if standard error is not a terminal."""

    def __init__(self, total: int, already: int) -> None:
        self._total, self._done = total, 0
        self._shown = sys.stderr.isatty()
        self._bare = getattr(sys.stderr, "bare", sys.stderr)  # unescaped, because the counter moves the cursor
        self._started = time.monotonic()
        if already and self._shown:
            self.say(f"{already} shots were analysed by an earlier call")

    def step(self) -> None:
        self._done += 1
        if self._shown:
            spent = time.monotonic() - self._started
            left = spent / self._done * (self._total - self._done)
            self._bare.write(f"\r{self._done}/{self._total} shots, {left:.0f} s left \x1b[K")

    def say(self, line: str) -> None:
        """Print a line above the counter."""
        if self._shown:
            self._bare.write("\r\x1b[K")
        say(line)

    def end(self) -> None:
        """Move the cursor to a new line below the counter."""
        if self._shown and self._total:
            sys.stderr.write("\n")

"""``--replay FOLDER --jobs N | --scheduler ADDRESS``: thousands of shots, resumable; no bad shot stops it."""

import contextlib
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.report import SCHEMA
from analysis.shot.shot import AnalysisError, AnalysisSettings
from analysis.shot.version import program_version
from app.command_line.campaign.crew import Crew, Processes
from app.command_line.campaign.journal import JOURNAL, Journal
from app.command_line.campaign.task import Entry, NotReached, Task, failed_entry, tasks_of
from app.command_line.options import known_model
from app.command_line.outputs import Outputs, check_outputs, in_a_line
from app.report.export import write_shots
from app.session.load import complaint
from instrument.files.atomic_file import write_text_atomic
from instrument.files.recording_error import RecordingError
from instrument.files.recording_search import find_recordings

AHEAD = 4  # shots handed out for each worker, so that none waits and none hoards


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does the work: ``jobs`` processes, or the machines of a dask ``scheduler``.

    ``insecure`` lets a scheduler be elsewhere without TLS.
    """

    jobs: int | None
    scheduler: str | None
    insecure: bool = False


def campaign(
    paths: Sequence[Path],
    workers: Workers,
    outputs: Outputs,
    *,
    model: str | None,
    settings: AnalysisSettings,
    checked: bool = True,
) -> int:
    """Analyse every shot under ``paths``; return the exit status.

    What is done stands in a journal in the folder of the export (or beside the result) and is not done again by the
    next call; a shot that was not reached stands in none.  The shots are not joined into one diagnosis.
    ``checked`` compares the data with their hash, which costs a campaign a third of its time.
    """
    found = find_recordings(paths)
    try:
        known = known_model(model)
        check_outputs(outputs.json, outputs.export)
        settings = replace(settings, effects=known.effects if known else ())
        tasks = tasks_of(found, known.base if known else model, settings, outputs.export, checked=checked)
        with contextlib.closing(_journal(outputs.json, outputs.export, tasks)) as journal:
            if journal.spoilt:
                print(f"levimass: {_spoilt(journal.path, journal.spoilt)}", file=sys.stderr)
            todo = [task for task in tasks if task.stamp not in journal]
            _say_again(tasks, journal)
            not_reached: dict[str, str] = {}
            if todo:
                with contextlib.closing(_crew(workers, todo)) as crew:
                    not_reached = _run(crew, todo, journal, already=len(tasks) - len(todo))
            return _tell(found, tasks, journal, not_reached, outputs.json, outputs.export)
    except (AnalysisError, RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, model or workers.scheduler or outputs.export)}", file=sys.stderr)
        return 1


def _journal(json_to: str | None, export_to: Path | None, tasks: Sequence[Task]) -> Journal:
    beside = Path(json_to + ".journal") if json_to and json_to != "-" else None
    return Journal(export_to / JOURNAL if export_to is not None else beside, {task.stamp for task in tasks})


def _crew(workers: Workers, todo: Sequence[Task]) -> Crew:
    if workers.scheduler is None:
        return Processes(workers.jobs or 1)
    from app.command_line.campaign.cluster import Cluster  # dask.distributed is an extra

    return Cluster(workers.scheduler, todo, insecure=workers.insecure)


def _spoilt(path: Path | None, lines: int) -> str:
    which = "a line is" if lines == 1 else f"{lines} lines are"
    return f"{path}: {which} not as this program writes them: passed over, what they were of is analysed again"


def _say_again(tasks: Sequence[Task], journal: Journal) -> None:
    """Say of what was done before what failed."""
    for task in tasks:
        if task.stamp in journal and (problem := journal.entry(task.stamp)["shot"]["problem"]):
            print(complaint(task.path, problem), file=sys.stderr)


def _run(crew: Crew, todo: Sequence[Task], journal: Journal, already: int) -> dict[str, str]:
    """Keep the crew fed and each result in the journal as it comes; return why which stamps were not reached."""
    not_reached: dict[str, str] = {}
    waiting = iter(todo)
    under_way, left = 0, len(todo)
    progress = Progress(left, already)
    try:
        while left:
            while under_way < max(1, AHEAD * crew.width) and (task := next(waiting, None)) is not None:
                crew.give(task)
                under_way += 1
            for task, outcome in crew.take():
                under_way, left = under_way - 1, left - 1
                progress.step()
                if isinstance(outcome, NotReached):
                    not_reached[task.stamp] = problem = outcome.cause
                else:
                    journal.add(outcome)
                    problem = outcome["shot"]["problem"]
                if problem:
                    progress.say(complaint(task.path, problem))
    finally:
        progress.end()
    return not_reached


def _tell(
    found: Sequence[Path],
    tasks: Sequence[Task],
    journal: Journal,
    not_reached: dict[str, str],
    json_to: str | None,
    export_to: Path | None,
) -> int:
    """Write the results, one shot in memory at a time, and say how many there are; return the exit status."""

    def entries() -> Iterator[Entry]:
        for path, task in zip(found, tasks, strict=True):
            done = task.stamp in journal
            entry = journal.entry(task.stamp) if done else failed_entry(task, not_reached[task.stamp])
            entry["shot"]["path"] = entry["row"][1] = str(path)  # as it was given, whoever did it wherever
            yield entry

    if export_to is not None:
        write_shots((entry["row"] for entry in entries()), export_to / "shots.csv")
    if json_to and json_to != "-":
        write_text_atomic(Path(json_to), _result_text(entries()), sync=True)
    missed = sum(task.stamp not in journal for task in tasks)
    failures = sum(entry["shot"]["status"] == "failed" for entry in entries()) - missed
    if json_to == "-":
        for piece in _result_text(entries()):
            print(piece, end="")
    else:
        again = f", {missed} not reached (the same command tries them again)" if missed else ""
        analysed = len(tasks) - failures - missed
        print(f"{len(tasks)} shots, {analysed} analysed, {failures} failed{again}")
    return 1 if failures or missed or not tasks else 0


def _result_text(entries: Iterator[Entry]) -> Iterator[str]:
    head = json.dumps({"schema": SCHEMA, "version": program_version()}, indent=1)
    yield head.removesuffix("\n}") + ',\n "shots": ['
    for number, entry in enumerate(entries):
        yield ("," if number else "") + "\n" + json.dumps(entry["shot"], indent=1, allow_nan=False)
    yield '],\n "diagnosis": null\n}\n'


class Progress:
    """A line on a terminal that counts shots; on anything else silence, as logs have no use for it."""

    def __init__(self, total: int, already: int) -> None:
        self._total, self._already, self._done = total, already, 0
        self._shown = sys.stderr.isatty()
        self._bare = getattr(sys.stderr, "bare", sys.stderr)  # this line alone moves the cursor
        self._started = time.monotonic()
        if already and self._shown:
            self.say(f"levimass: {already} shots were done before and are not done again")

    def step(self) -> None:
        """Count one shot."""
        self._done += 1
        if self._shown:
            spent = time.monotonic() - self._started
            left = spent / self._done * (self._total - self._done)
            self._bare.write(f"\r{self._done}/{self._total} shots, {left:.0f} s to go \x1b[K")

    def say(self, line: str) -> None:
        """Print a line without disturbing the count."""
        if self._shown:
            self._bare.write("\r\x1b[K")
        sys.stderr.write(line + "\n")

    def end(self) -> None:
        """Leave the terminal on a fresh line."""
        if self._shown and self._total:
            sys.stderr.write("\n")

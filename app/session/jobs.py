"""Background job queues in threads, with progress and cancellation; the window collects their results."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from analysis.shot import Progress, Stop
from app.session.entry import Entry
from instrument.background import Task, Work, WorkerThread
from instrument.process import SubprocessWorker

ESTIMATE_AFTER_S, MIN_FRACTION = 2.0, 0.05  # least elapsed time and fraction done for an estimated remaining time
LOW_PRIORITY = "why"  # kind of the jobs that any other job cancels
OnResult = Callable[[Any], object]
OnFailure = Callable[[str | None], object]  # with the reason; None: the job was cancelled


class EventKind(StrEnum):
    """The kind of an event."""

    SHOT = "shot"  # an analysed shot was added as a new entry
    CHANGED = "changed"  # entries were read or refitted, or diagnoses were loaded
    EXPORTED = "exported"
    PRINT = "print"  # the text of a report, to be printed
    DIAGNOSED = "diagnosed"
    MODEL = "model"  # a model file was loaded
    UNLISTED = "unlisted"  # recordings were found that no session lists
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Event:
    """The outcome of one job in words, with the numbers of the entries concerned."""

    kind: EventKind
    words: str
    numbers: tuple[int, ...] = ()
    paths: tuple[Path, ...] = ()


Notify = Callable[[EventKind, str], object]
Item = TypeVar("Item")


@dataclass(slots=True, eq=False)
class Job(Task):
    """A task of the window, in whose thread either ``take`` is called with the result or ``failed`` with the reason."""

    kind: str = ""
    take: OnResult | None = None
    failed: OnFailure | None = None

    def remaining_s(self) -> float | None:
        """Return the estimated remaining time in s; None while it is unknown."""
        if self.started_s is None or not MIN_FRACTION <= self.fraction < 1.0:
            return None
        gone = time.monotonic() - self.started_s
        return gone * (1.0 - self.fraction) / self.fraction if gone > ESTIMATE_AFTER_S else None

    def discard(self) -> None:
        """Cancel the job, and call neither ``take`` nor ``failed``."""
        self.cancel()
        self.take = self.failed = None


def pop_all(waiting: deque[Item]) -> list[Item]:
    """Remove and return all items of a queue that other threads may be filling."""
    taken = []
    while waiting:
        taken.append(waiting.popleft())
    return taken


class Jobs(WorkerThread[Job]):
    """A worker thread whose jobs have kinds, and whose finished jobs are collected by the window."""

    def __init__(self) -> None:
        self._finished: deque[Job] = deque()
        super().__init__("jobs", self._finish)
        self.start()

    def submit(
        self, name: str, work: Work, kind: str = "", take: OnResult | None = None, failed: OnFailure | None = None
    ) -> Job:
        """Queue a job; ``work`` is called as work(report, cancelled) and returns the result."""
        if kind != LOW_PRIORITY:
            self.cancel(LOW_PRIORITY)  # the window queues it again when needed
        return self.add(Job(name, work, kind=kind, take=take, failed=failed))

    @property
    def open_jobs(self) -> int:
        """Get the number of queued and running jobs."""
        return len(self.tasks)

    def waiting(self, *kinds: str) -> int:
        """Return the number of queued and running jobs of these kinds, without cancelled ones."""
        return sum(job.kind in kinds and not job.cancelled for job in self.tasks)

    def waiting_words(self, job: Job, what: str) -> str:
        """Return "computing ``what`` ..." if ``job`` is next or running, else which job it waits for."""
        current = self.current
        if current is None or current is job:
            return f"computing {what} …"
        return f"waiting for {current.name} to end; then {what} will be computed"

    def finished(self) -> list[Job]:
        """Return the jobs that ended since the last call, including cancelled ones."""
        return pop_all(self._finished)

    def cancel(self, kind: str | None = None, *, ended: bool = False) -> None:
        """Cancel the jobs of a kind, or all; ``ended``: also jobs whose result has not been collected."""
        with self._wake:
            for job in (*self.tasks, *(self._finished if ended else ())):
                if kind is None or job.kind == kind:
                    job.cancel()

    def _finish(self, job: Job) -> None:
        job.error = None  # its traceback refers to what the job worked on; the reason is kept
        self._finished.append(job)


class Saver:
    """Runs save functions in a thread; a newer save replaces a queued one."""

    def __init__(self) -> None:
        self._worker = WorkerThread[Task]("saver")
        self._worker.start()

    def submit(self, save: Callable[[], None]) -> None:
        """Queue a save in place of any queued one.  ``save`` must not raise."""
        for queued in self._worker.tasks:
            queued.cancel()
        self._worker.add(Task("saving", lambda _, __: save()))

    def close(self) -> bool:
        """Run the queued save and end the thread; return whether it ended."""
        return self._worker.close(finish=True)


SESSION_KINDS = ("open", "refit", "diagnosis", "plan", "kept", "model")  # kinds dropped when another session is opened


class JobQueues:
    """Two job queues, for long and short jobs; long work runs in the subprocess, if given, else in the jobs' thread."""

    def __init__(self, subprocess_worker: SubprocessWorker | None) -> None:
        self.jobs, self.short_jobs = Jobs(), Jobs()
        self._subprocess_worker = subprocess_worker

    def submit_long(
        self, name: str, work: Callable[..., Any], kind: str, take: OnResult, failed: OnFailure | None = None
    ) -> Job:
        """Queue long work, which is called with the keywords ``progress`` and ``cancelled``."""

        def run(report: Progress, cancelled: Stop) -> Any:
            if self._subprocess_worker is not None:
                return self._subprocess_worker.run(work, report, cancelled)
            return work(progress=report, cancelled=cancelled)

        return self.jobs.submit(name, run, kind, take, failed)

    def cancel_session_jobs(self) -> None:
        """Cancel all jobs on the shots of this session and discard their results."""
        for kind in SESSION_KINDS:
            self.jobs.cancel(kind, ended=True)
            self.short_jobs.cancel(kind, ended=True)

    def collect_results(self) -> Iterator[str]:
        """Call ``take`` or ``failed`` of each finished job; yield the reason of each failure."""
        for job in (*self.jobs.finished(), *self.short_jobs.finished()):
            if job.cancelled or job.problem is not None:
                if job.failed is not None:
                    job.failed(None if job.cancelled else job.problem)
                if not job.cancelled:
                    yield f"{job.name}: {job.problem}"
            elif job.take is not None:
                job.take(job.result)

    def close(self) -> bool:
        """Cancel all jobs and wait for the threads; return whether they ended."""
        ended = self.jobs.close() & self.short_jobs.close()
        if self._subprocess_worker is not None:
            self._subprocess_worker.close()
        return ended


Result = TypeVar("Result")


class ShotJob(Generic[Result]):
    """A background job on the displayed shot; starting it for another shot cancels the previous job.

    ``take(entry, result)`` is called with the result in the window's thread.
    """

    def __init__(self, jobs: Jobs, kind: str, take: Callable[[Entry, Result], object]) -> None:
        self._jobs, self._kind, self._take = jobs, kind, take
        self.job: Job | None = None  # until its result is taken
        self._number: int | None = None

    def start(self, entry: Entry, work: Callable[[Progress, Stop], Result]) -> bool:
        """Start the work unless it is done or running for this entry; return whether it was started."""
        if self._number == entry.number:
            return False
        self._number = entry.number
        if self.job is not None:
            self.job.discard()
        self.job = self._jobs.submit(
            f"{self._kind} of {entry.name}", work, self._kind, partial(self._taken, entry), self._failed
        )
        return True

    def forget(self) -> None:
        """Let the next ``start`` begin the work even for the same entry."""
        self._number = None

    def _taken(self, entry: Entry, result: Result) -> None:
        self.job = None
        self._take(entry, result)

    def _failed(self, _: str | None) -> None:
        self.job = self._number = None

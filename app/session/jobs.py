"""Background job queues in threads, with progress and cancellation; the window collects their results."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from analysis.shot import Cancelled, Progress, Stop
from app.session.entry import Entry
from instrument.process import SubprocessWorker

ESTIMATE_AFTER_S, MIN_FRACTION = 2.0, 0.05  # least elapsed time and fraction done for an estimated remaining time
PREEMPTED_KINDS = ("why",)  # kinds of low-priority jobs, which any other job cancels
Step = Callable[[Progress, Stop], Any]
OnResult = Callable[[Any], object]


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
class Job:
    """One job; the worker thread writes its progress to ``what`` and ``fraction``, and the window reads them.

    ``take`` is called with the result in the window's thread.
    """

    name: str
    work: Step
    kind: str = ""
    take: OnResult | None = None
    what: str = ""
    fraction: float = 0.0
    result: Any = None
    problem: str | None = None
    cancelled: bool = False
    started_s: float | None = None  # monotonic clock
    done: threading.Event = field(default_factory=threading.Event)

    def remaining_s(self) -> float | None:
        """Return the estimated remaining time in s; None while it is unknown."""
        if self.started_s is None or not MIN_FRACTION <= self.fraction < 1.0:
            return None
        gone = time.monotonic() - self.started_s
        return gone * (1.0 - self.fraction) / self.fraction if gone > ESTIMATE_AFTER_S else None

    def cancel(self) -> None:
        self.cancelled = True


def pop_all(waiting: deque[Item]) -> list[Item]:
    """Remove and return all items of a queue that other threads may be filling."""
    taken = []
    while waiting:
        taken.append(waiting.popleft())
    return taken


class Jobs:
    """A queue of jobs, run one after another in a thread that ``close`` ends."""

    def __init__(self, name: str = "jobs") -> None:
        self._waiting: deque[Job] = deque()
        self._finished: deque[Job] = deque()
        self.current: Job | None = None  # the running job
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name=f"levimass {name}", daemon=True)
        self._thread.start()

    def submit(self, name: str, work: Step, kind: str = "", take: OnResult | None = None) -> Job:
        """Queue a job; ``work`` is called as work(report, cancelled) and returns the result."""
        job = Job(name, work, kind, take)
        with self._wake:
            job.cancelled = self._closing
            for other in self._open():
                if other.kind in PREEMPTED_KINDS and kind not in PREEMPTED_KINDS:
                    other.cancel()  # the window queues it again when needed
            self._waiting.append(job)
            self._wake.notify()
        return job

    def _open(self) -> list[Job]:
        """Return the queued and running jobs."""
        with self._wake:
            return [job for job in (*self._waiting, self.current) if job is not None]

    @property
    def open_jobs(self) -> int:
        """Get the number of queued and running jobs."""
        return len(self._open())

    def waiting(self, *kinds: str) -> int:
        """Return the number of queued and running jobs of these kinds, without cancelled ones."""
        return sum(job.kind in kinds and not job.cancelled for job in self._open())

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
            for job in (*self._open(), *(self._finished if ended else ())):
                if kind is None or job.kind == kind:
                    job.cancel()

    def close(self, timeout_s: float = 10.0, *, finish: bool = False) -> bool:
        """Cancel all jobs, or let them ``finish``, and join the thread; return whether it ended."""
        with self._wake:
            self._closing = True
            if not finish:
                self.cancel()
            self._wake.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._wake:
                while not self._waiting and not self._closing:
                    self._wake.wait()
                if not self._waiting:
                    return
                job = self._waiting.popleft()
                self.current = job
            self._run(job)
            with self._wake:
                self._finished.append(job)
                self.current = None
            job.done.set()

    def _run(self, job: Job) -> None:
        def report(what: str, fraction: float) -> None:
            job.what, job.fraction = what, fraction

        def cancelled() -> bool:
            return job.cancelled

        if job.cancelled:
            return
        job.started_s = time.monotonic()
        try:
            job.result = job.work(report, cancelled)
        except Cancelled:
            job.cancelled = True
        except Exception as error:  # the window shows the reason, and the thread continues
            job.problem = str(error) or type(error).__name__


class Saver:
    """Runs save functions in a thread; a newer save replaces a queued one."""

    def __init__(self) -> None:
        self._jobs = Jobs("saver")

    def submit(self, save: Callable[[], None]) -> None:
        """Queue a save in place of any queued one.  ``save`` must not raise."""
        self._jobs.cancel()
        self._jobs.finished()  # discarded: their results are not needed
        self._jobs.submit("saving", lambda _, __: save())

    def close(self, timeout_s: float = 10.0) -> bool:
        """Run the queued save and end the thread; return whether it ended."""
        return self._jobs.close(timeout_s, finish=True)


SESSION_KINDS = ("open", "refit", "diagnosis", "plan", "kept", "model")  # kinds dropped when another session is opened


class JobQueues:
    """Two job queues, for long and short jobs; long work runs in the subprocess, if given, else in the jobs' thread."""

    def __init__(self, subprocess_worker: SubprocessWorker | None) -> None:
        self.jobs, self.short_jobs = Jobs(), Jobs()
        self._subprocess_worker = subprocess_worker

    def run_long(self, work: Callable[..., Any], report: Progress, cancelled: Stop) -> Any:
        """Run the long part of a job in the subprocess, or here without one; called in the jobs' thread."""
        if self._subprocess_worker is not None:
            return self._subprocess_worker.run(work, report, cancelled)
        return work(progress=report, cancelled=cancelled)

    def submit_long(self, name: str, work: Callable[..., Any], kind: str, take: OnResult) -> None:
        """Queue long work, which is called with the keywords ``progress`` and ``cancelled``."""
        self.jobs.submit(name, partial(self.run_long, work), kind, take)

    def cancel_session_jobs(self) -> None:
        """Cancel all jobs on the shots of this session and discard their results."""
        for kind in SESSION_KINDS:
            self.jobs.cancel(kind, ended=True)
            self.short_jobs.cancel(kind, ended=True)

    def collect_results(self) -> Iterator[str]:
        """Pass each finished job's result to its ``take``; yield the reason of each failure."""
        for job in (*self.jobs.finished(), *self.short_jobs.finished()):
            if job.cancelled:
                continue
            if job.problem is not None:
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
    """A background job on the displayed shot; starting it for another shot cancels the previous job."""

    def __init__(self, jobs: Jobs, kind: str) -> None:
        self._jobs, self._kind = jobs, kind
        self.job: Job | None = None  # the running or queued job
        self._number: int | None = None
        self._entry: Entry | None = None

    def start(self, entry: Entry, work: Callable[[Progress, Stop], Result]) -> bool:
        """Start the work unless it is done or running for this entry; return whether it was started."""
        if self._number == entry.number:
            return False
        self._number, self._entry = entry.number, entry
        self._jobs.cancel(self._kind)
        self.job = self._jobs.submit(f"{self._kind} of {entry.name}", work, self._kind)
        return True

    def forget(self) -> None:
        """Let the next ``start`` begin the work even for the same entry."""
        self._number = None

    def take(self) -> tuple[Entry, Result] | None:
        """Return the entry and its result, once, when the job has finished; else None."""
        job = self.job
        if job is None or not job.done.is_set():
            return None
        self.job = None
        if job.cancelled or job.problem is not None:
            self._number = None
            return None
        assert self._entry is not None
        return self._entry, job.result

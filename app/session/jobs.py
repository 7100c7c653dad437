"""Background work in threads, with progress and cancel, whose results the screen takes; a thread that saves files."""

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

ESTIMATE_AFTER_S, LEAST_FRACTION = 2.0, 0.05  # before that the remaining time is not known
YIELDING = ("why",)  # kinds of work that any other work cancels
Step = Callable[[Progress, Stop], Any]
Take = Callable[[Any], object]


class EventKind(StrEnum):
    """What happened."""

    SHOT = "shot"  # a new entry, analysed
    CHANGED = "changed"  # entries were read again or refitted
    EXPORTED = "exported"
    PRINT = "print"  # the text of a report, to be printed
    DIAGNOSED = "diagnosed"
    MODEL = "model"  # a model file was loaded
    UNLISTED = "unlisted"  # recordings were found that no session lists
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Event:
    """The end of one piece of work, in words, with the entries it concerns."""

    kind: EventKind
    words: str
    numbers: tuple[int, ...] = ()
    paths: tuple[Path, ...] = ()


Tell = Callable[[EventKind, str], object]
Item = TypeVar("Item")


@dataclass(slots=True, eq=False)
class Job:
    """One piece of work; ``what`` and ``fraction`` are written by the worker and read by the screen.

    ``take`` gets the result in the screen's thread.
    """

    name: str
    work: Step
    kind: str = ""
    take: Take | None = None
    what: str = ""
    fraction: float = 0.0
    result: Any = None
    problem: str | None = None
    cancelled: bool = False
    started_s: float | None = None  # of the monotonic clock
    done: threading.Event = field(default_factory=threading.Event)

    def remaining_s(self) -> float | None:
        """Return the estimated remaining time; None while it is not known."""
        if self.started_s is None or not LEAST_FRACTION <= self.fraction < 1.0:
            return None
        gone = time.monotonic() - self.started_s
        return gone * (1.0 - self.fraction) / self.fraction if gone > ESTIMATE_AFTER_S else None

    def cancel(self) -> None:
        self.cancelled = True


def drained(waiting: deque[Item]) -> list[Item]:
    """Take everything out of a queue that other threads may fill meanwhile."""
    taken = []
    while waiting:
        taken.append(waiting.popleft())
    return taken


class Jobs:
    """A queue of jobs, done one after another in a thread that ends with ``close``."""

    def __init__(self, name: str = "jobs") -> None:
        self._waiting: deque[Job] = deque()
        self._finished: deque[Job] = deque()
        self.current: Job | None = None  # the one that runs
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name=f"levimass {name}", daemon=True)
        self._thread.start()

    def submit(self, name: str, work: Step, kind: str = "", take: Take | None = None) -> Job:
        """Queue a job; its function gets (report, cancelled) and returns the result."""
        job = Job(name, work, kind, take)
        with self._wake:
            job.cancelled = self._closing
            for other in (*self._waiting, self.current):
                if other is not None and other.kind in YIELDING and kind not in YIELDING:
                    other.cancel()  # it is queued again when the screen needs it
            self._waiting.append(job)
            self._wake.notify()
        return job

    @property
    def open_jobs(self) -> int:
        """Get how many jobs are waiting or under way."""
        with self._wake:
            return len(self._waiting) + (self.current is not None)

    def waiting(self, *kinds: str) -> int:
        """Return how many jobs of these kinds are waiting or under way and not cancelled."""
        with self._wake:
            jobs = [*self._waiting, *([self.current] if self.current is not None else [])]
        return sum(job.kind in kinds and not job.cancelled for job in jobs)

    def waiting_words(self, job: Job, what: str) -> str:
        """Return "computing ..." for a job about ``what``, or which job comes first."""
        current = self.current
        if current is None or current is job:
            return f"computing {what} …"
        return f"waiting for {current.name} to end; then {what} will be computed"

    def finished(self) -> list[Job]:
        """Return the jobs that ended since the last call, cancelled ones included."""
        return drained(self._finished)

    def cancel(self, kind: str | None = None, *, ended: bool = False) -> None:
        """Cancel the jobs of a kind, or all; ``ended``: also those whose result waits to be taken."""
        with self._wake:
            for job in (*self._waiting, self.current, *(self._finished if ended else ())):
                if job is not None and (kind is None or job.kind == kind):
                    job.cancel()

    def close(self, timeout_s: float = 10.0, *, finish: bool = False) -> bool:
        """Cancel all jobs, or let them ``finish``, and wait for the thread; return whether it ended."""
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
        except Exception as error:  # the window shows the reason, and the thread goes on
            job.problem = str(error) or type(error).__name__


class Saver:
    """Does the newest task it was given, in a thread; a newer task replaces a waiting one."""

    def __init__(self) -> None:
        self._jobs = Jobs("saver")

    def submit(self, save: Callable[[], None]) -> None:
        """Do this soon, in the thread.  ``save`` raises nothing."""
        self._jobs.cancel()
        self._jobs.finished()  # nobody asks for their results
        self._jobs.submit("saving", lambda _, __: save())

    def close(self, timeout_s: float = 10.0) -> bool:
        """Do the waiting task and end the thread; return whether it ended."""
        return self._jobs.close(timeout_s, finish=True)


OF_A_SESSION = ("open", "refit", "diagnosis", "plan", "kept", "model")  # kinds dropped when another session is opened


class Work:
    """``jobs`` are long, ``short_jobs`` short; ``apart`` does the long part of a job, else the jobs' own thread."""

    def __init__(self, apart: SubprocessWorker | None) -> None:
        self.jobs, self.short_jobs = Jobs(), Jobs()
        self._apart = apart

    def do(self, work: Callable[..., Any], report: Progress, cancelled: Stop) -> Any:
        """Do the long part of a job, in the other process where there is one; called in the jobs' thread."""
        if self._apart is not None:
            return self._apart.run(work, report, cancelled)
        return work(progress=report, cancelled=cancelled)

    def aside(self, name: str, work: Callable[..., Any], kind: str, take: Take) -> None:
        """Queue long work, called with ``progress`` and ``cancelled``."""
        self.jobs.submit(name, partial(self.do, work), kind, take)

    def another_session(self) -> None:
        """Cancel the work on the shots of this session, and drop what is done of it."""
        for kind in OF_A_SESSION:
            self.jobs.cancel(kind, ended=True)
            self.short_jobs.cancel(kind, ended=True)

    def take_ended(self) -> Iterator[str]:
        """Hand on the results of jobs that ended since the last call; yield why others failed."""
        for job in (*self.jobs.finished(), *self.short_jobs.finished()):
            if job.cancelled:
                continue
            if job.problem is not None:
                yield f"{job.name}: {job.problem}"
            elif job.take is not None:
                job.take(job.result)

    def close(self) -> bool:
        """Cancel all work and wait for it; return whether the threads ended."""
        ended = self.jobs.close() & self.short_jobs.close()
        if self._apart is not None:
            self._apart.close()
        return ended


Result = TypeVar("Result")


class ShotJob(Generic[Result]):
    """Background work on the shot in view; starting it for another shot cancels the one before."""

    def __init__(self, jobs: Jobs, kind: str) -> None:
        self._jobs, self._kind = jobs, kind
        self.job: Job | None = None  # the one that runs or waits
        self._number: int | None = None
        self._entry: Entry | None = None

    def ask(self, entry: Entry, work: Callable[[Progress, Stop], Result]) -> bool:
        """Start the work unless it is done or running for this shot; return whether it was started."""
        if self._number == entry.number:
            return False
        self._number, self._entry = entry.number, entry
        self._jobs.cancel(self._kind)
        self.job = self._jobs.submit(f"{self._kind} of {entry.name}", work, self._kind)
        return True

    def forget(self) -> None:
        """Do the work again the next time, also for the same shot."""
        self._number = None

    def take(self) -> tuple[Entry, Result] | None:
        """Return the result and its entry once, when it is ready; else None."""
        job = self.job
        if job is None or not job.done.is_set():
            return None
        self.job = None
        if job.cancelled or job.problem is not None:
            self._number = None
            return None
        assert self._entry is not None
        return self._entry, job.result

"""Work that takes longer than a frame: a worker thread, progress and cancel, polled by the screen; and the saver."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from analysis.shot.shot import Cancelled
from app.session.event import InSession
from instrument.process.subprocess_worker import SubprocessWorker

TOLD_AFTER_S, LEAST_TOLD = 2.0, 0.05  # before that a remaining time would be a guess
YIELDING = ("why",)  # kinds of work that make way for any other
Report = Callable[[str, float], None]
Asked = Callable[[], bool]
Step = Callable[[Report, Asked], Any]


@dataclass(slots=True, eq=False)
class Job:
    """One piece of work; ``what`` and ``fraction`` are written by the worker and read by the screen."""

    name: str
    work: Step
    kind: str = ""
    what: str = ""
    fraction: float = 0.0
    result: Any = None
    problem: str | None = None
    cancelled: bool = False
    started_s: float | None = None  # of the monotonic clock
    done: threading.Event = field(default_factory=threading.Event)

    def remaining_s(self) -> float | None:
        """Return how long it will probably still take; None while that is not known."""
        if self.started_s is None or not LEAST_TOLD <= self.fraction < 1.0:
            return None
        gone = time.monotonic() - self.started_s
        return gone * (1.0 - self.fraction) / self.fraction if gone > TOLD_AFTER_S else None

    def cancel(self) -> None:
        """Ask the job to stop at its next look."""
        self.cancelled = True


class Jobs:
    """A queue of jobs worked off one after another in a thread that ends with ``close``."""

    def __init__(self) -> None:
        self._waiting: deque[Job] = deque()
        self._finished: deque[Job] = deque()
        self._current: Job | None = None
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="levimass-jobs", daemon=True)
        self._thread.start()

    def submit(self, name: str, work: Step, kind: str = "") -> Job:
        """Queue a job; its function gets (report, cancelled) and returns the result."""
        job = Job(name, work, kind)
        with self._wake:
            for other in (*self._waiting, self._current):
                if other is not None and other.kind in YIELDING and kind not in YIELDING:
                    other.cancel()  # whoever wants it asks again
            self._waiting.append(job)
            self._wake.notify()
        return job

    @property
    def current(self) -> Job | None:
        """Get the job under way."""
        return self._current

    @property
    def open_jobs(self) -> int:
        """Get how many jobs are waiting or under way."""
        with self._wake:
            return len(self._waiting) + (self._current is not None)

    def waiting(self, *kinds: str) -> int:
        """Return how many jobs of these kinds are waiting or under way and not cancelled."""
        with self._wake:
            jobs = [*self._waiting, *([self._current] if self._current is not None else [])]
        return sum(job.kind in kinds and not job.cancelled for job in jobs)

    def finished(self) -> list[Job]:
        """Return the jobs that ended since the last call, cancelled ones included."""
        ended = []
        while self._finished:
            ended.append(self._finished.popleft())
        return ended

    def cancel(self, kind: str | None = None) -> None:
        """Cancel all jobs, or all of one kind."""
        with self._wake:
            for job in (*self._waiting, self._current):
                if job is not None and (kind is None or job.kind == kind):
                    job.cancel()

    def close(self, timeout_s: float = 10.0) -> bool:
        """Cancel everything and wait for the thread; return whether it ended."""
        self.cancel()
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._wake:
                while not self._waiting and not self._closing:
                    self._wake.wait()
                if self._closing:
                    return
                job = self._waiting.popleft()
                self._current = job
            self._run(job)
            self._finished.append(job)  # first: who sees no open job finds its result
            with self._wake:
                self._current = None
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
        except Exception as error:  # the worker must outlive any one job; the window shows the reason
            job.problem = str(error) or type(error).__name__


class Saver:
    """Does the newest of what it is given, in a thread of its own; what it replaces need not be done any more."""

    def __init__(self) -> None:
        self._wake = threading.Condition()
        self._newest: Callable[[], None] | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="levimass saver", daemon=True)
        self._thread.start()

    def submit(self, save: Callable[[], None]) -> None:
        """Do this soon; returns at once.  ``save`` raises nothing."""
        with self._wake:
            self._newest = save
            self._wake.notify()

    def close(self, timeout_s: float = 10.0) -> bool:
        """Do what waits, end the thread; return whether it ended."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._wake:
                while self._newest is None and not self._closing:
                    self._wake.wait()
                save, self._newest = self._newest, None
            if save is None:
                return
            save()


OF_A_SESSION = ("open", "refit", "diagnosis", "plan", "kept")  # kinds that concern nobody once another session is open


class Work:
    """``jobs`` are long, ``errands`` short; ``apart`` does the long part of a job, else the jobs' own thread."""

    def __init__(self, apart: SubprocessWorker | None) -> None:
        self.jobs, self.errands = Jobs(), Jobs()
        self._apart = apart
        self._turn = 0  # how many sessions were before this one: what was asked in those is not of this

    def do(self, work: Callable[..., Any], report: Report, cancelled: Asked) -> Any:
        """Do the long part of a job where the screen does not feel it; called in the jobs' thread."""
        if self._apart is not None:
            return self._apart.run(work, report, cancelled)
        return work(progress=report, cancelled=cancelled)

    def submit(self, jobs: Jobs, name: str, work: Callable[[Report, Asked], object], kind: str) -> Job:
        """Queue work on the shots of the session now open: once another is, its result concerns nobody."""
        turn = self._turn
        return jobs.submit(name, lambda report, cancelled: InSession(turn, work(report, cancelled)), kind)

    def another_session(self) -> None:
        """Give up what is under way for the shots of this session."""
        self._turn += 1
        for kind in OF_A_SESSION:
            self.jobs.cancel(kind)
            self.errands.cancel(kind)

    def ended(self) -> Iterator[tuple[Job, object]]:
        """Yield each job that ended since the last call, with its result; None where it concerns nobody."""
        for job in (*self.jobs.finished(), *self.errands.finished()):
            result = job.result
            if isinstance(result, InSession):
                result = result.result if result.turn == self._turn else None
            if not job.cancelled:
                yield job, result

    def close(self) -> bool:
        """Cancel all work and wait for it; return whether the threads ended."""
        ended = self.jobs.close() & self.errands.close()
        if self._apart is not None:
            self._apart.close()
        return ended

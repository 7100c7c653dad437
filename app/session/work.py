"""Where the workbench's work is done: jobs in line, errands that must not wait behind them, a process beside."""

from collections.abc import Callable, Iterator
from typing import Any

from app.session.event import InSession
from app.session.jobs import Asked, Job, Jobs, Report
from instrument.process.work import WorkApart

OF_A_SESSION = ("open", "refit", "diagnosis", "plan", "kept")  # kinds that concern nobody once another session is open


class Work:
    """``jobs`` are long, ``errands`` short; ``apart`` does the long part of a job, else the jobs' own thread."""

    def __init__(self, apart: WorkApart | None) -> None:
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

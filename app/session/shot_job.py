"""Background work on the shot in view: started once per shot, its result taken by the screen."""

from collections.abc import Callable
from typing import Generic, TypeVar

from analysis.shot import Progress, Recording, Stop
from app.session.jobs import Job, Jobs
from app.session.session import Entry
from instrument.files import RecordingError, is_motion_record, open_recording

Given = TypeVar("Given")
Result = TypeVar("Result")
Work = Callable[[Entry, Given, Progress, Stop], Result]


class ShotJob(Generic[Given, Result]):
    """Work on one shot at a time; starting it for another shot cancels the one before."""

    def __init__(self, jobs: Jobs, kind: str, work: Work[Given, Result]) -> None:
        self._jobs, self._kind, self._work = jobs, kind, work
        self._job: Job | None = None
        self._number: int | None = None
        self._entry: Entry | None = None

    def ask(self, entry: Entry, given: Given) -> bool:
        """Start the work unless it is done or running for this shot; return whether it was started."""
        if self._number == entry.number:
            return False
        self._number, self._entry = entry.number, entry

        def work(report: Progress, cancelled: Stop) -> Result:
            return self._work(entry, given, report, cancelled)

        self._jobs.cancel(self._kind)
        self._job = self._jobs.submit(f"{self._kind} of {entry.name}", work, self._kind)
        return True

    def forget(self) -> None:
        """Do the work again the next time, also for the same shot."""
        self._number = None

    @property
    def job(self) -> Job | None:
        """Get the job that runs or waits, or None."""
        return self._job

    def take(self) -> tuple[Entry, Result] | None:
        """Return the result and its entry once, when it is ready; else None."""
        job = self._job
        if job is None or not job.done.is_set():
            return None
        self._job = None
        if job.cancelled or job.problem is not None:
            self._number = None
            return None
        assert self._entry is not None
        return self._entry, job.result


def raw_of(entry: Entry) -> Recording | None:
    """Return an entry's raw recording, or None where it has none or it cannot be read."""
    if entry.path is None or is_motion_record(entry.path):
        return None
    try:
        return open_recording(entry.path)
    except (RecordingError, OSError):
        return None

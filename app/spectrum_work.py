"""Asks the jobs for the spectra of the shot in front, once a shot, and hands them to the screen when they are there."""

from analysis.recording import Recording
from app.jobs import Asked, Job, Jobs, Report
from app.panels.spectrum import Spectra, spectra_of
from app.plots.shot_times import time_zero
from app.session import Entry


class SpectrumWork:
    """Keeps the spectra of the last shot asked for."""

    def __init__(self, jobs: Jobs) -> None:
        self._jobs = jobs
        self._job: Job | None = None
        self._number: int | None = None

    def ask(self, entry: Entry, recording: Recording) -> bool:
        """Start the work unless it is done or under way for this shot; return whether it was started."""
        if self._number == entry.number:
            return False
        self._number = entry.number
        zero = time_zero(entry.shot)[0] if entry.shot is not None else 0.0

        def work(report: Report, cancelled: Asked) -> Spectra:
            return spectra_of(recording, zero, report, cancelled)

        self._jobs.cancel("spectrum")
        self._job = self._jobs.submit(f"spectrum of {entry.name}", work, "spectrum")
        return True

    def take(self) -> Spectra | None:
        """Return the spectra once, when they are there."""
        job = self._job
        if job is None or not job.done.is_set():
            return None
        self._job = None
        if job.cancelled or job.problem is not None:
            self._number = None
            return None
        return job.result if isinstance(job.result, Spectra) else None

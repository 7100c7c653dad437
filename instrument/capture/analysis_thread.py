"""The thread that analyses shots, behind a bounded queue, so that a slow analysis never delays a capture."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from analysis.fitted import fit_pending, unfitted
from analysis.shot import AnalysisError, Cancelled, Progress, Recording, Shot, Stop
from instrument.background import Task, WorkerThread
from instrument.files import one_line

Analyse = Callable[[Recording, Progress, Stop], Shot]  # (recording, progress, cancelled?) -> shot
Fit = Callable[[Shot, Progress, Stop], Shot]
Done = Callable[[int, Shot | None, str | None], None]  # (key, shot, problem)


def fit_here(shot: Shot, progress: Progress, cancelled: Stop) -> Shot:
    """Fit a shot that was read, in this process."""
    from analysis.pipeline import fitted  # imports the model, which recording without analysis does not need

    return fitted(shot, progress=progress, cancelled=cancelled)


@dataclass(frozen=True, slots=True)
class ShotAnalysis:
    """The functions that analyse a recorded shot; both are called in the analysis thread.

    ``analyse`` may return a shot that still awaits its fit; ``fit`` then completes it.
    """

    analyse: Analyse
    fit: Fit = fit_here
    queue_length: int = 32  # shots that may wait; further ones are saved without an analysis


class AnalysisThread:
    """Analyses one recording after another; ``done(key, shot, problem)`` is called in this thread.

    For a shot that awaits its fit, ``done`` is called twice: with the readings, then with the fit or with the reason
    why there is none.
    """

    def __init__(self, analysis: ShotAnalysis, done: Done) -> None:
        self._analysis = analysis
        self._done = done
        self._worker = WorkerThread[Task]("analysis")
        self.start, self.close = self._worker.start, self._worker.close
        self.steps = 0  # how often progress was reported

    @property
    def doing(self) -> tuple[str, float] | None:
        """Get what is in progress and its share done."""
        task = self._worker.current
        return None if task is None else (task.what or task.name, task.fraction)

    def submit(self, key: int, recording: Recording) -> bool:
        """Queue a recording; return False at once if the queue is full."""
        if self._worker.queued >= self._analysis.queue_length:
            return False
        self._worker.add(Task("analysing", partial(self._analyse, key, [recording])))
        return True

    def cancel(self) -> None:
        """Stop the analysis under way at its next check; the queued ones follow."""
        task = self._worker.current
        if task is not None:
            task.cancel()

    def _analyse(self, key: int, held: list[Recording], report: Progress, cancelled: Stop) -> None:
        """Analyse the recording; ``held`` is emptied: a file closes with its last reference."""

        def progress(what: str, share: float) -> None:
            report(what, share)
            self.steps += 1

        shot, problem, _ = _attempt(partial(self._analysis.analyse, held.pop(), progress, cancelled))
        if shot is not None and fit_pending(shot):
            self._done(key, shot, problem)
            whole, why, stopped = _attempt(partial(self._analysis.fit, shot, progress, cancelled))
            shot = whole or unfitted(shot, why or "the fit failed", stopped=stopped)
        self._done(key, shot, problem)


def _attempt(step: Callable[[], Shot]) -> tuple[Shot | None, str | None, bool]:
    """Run one step of an analysis; return (shot, one line on why it failed, whether it was stopped)."""
    try:
        return step(), None, False
    except Cancelled:
        return None, "the analysis was stopped", True
    except AnalysisError as error:
        return None, one_line(str(error)), False
    except Exception as error:  # a shot that crashes the analysis must not end the session
        return None, f"the analysis failed: {one_line(repr(error))}", False

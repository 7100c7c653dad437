"""The thread that analyses shots, behind a bounded queue, so that a slow analysis never delays a capture."""

import contextlib
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from analysis.fitted import fit_pending
from analysis.shot import AnalysisError, Cancelled, Progress, Recording, Shot, Stop
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
        self._waiting: queue.Queue[tuple[int, Recording] | None] = queue.Queue(analysis.queue_length)
        self._cancelled = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="levimass analysis", daemon=True)
        self.start = self._thread.start
        self.doing: tuple[str, float] | None = None  # what is in progress and its share done
        self.steps = 0  # how often progress was reported

    def submit(self, key: int, recording: Recording) -> bool:
        """Queue a recording; return False at once if the queue is full."""
        try:
            self._waiting.put_nowait((key, recording))
        except queue.Full:
            return False
        return True

    def cancel(self) -> None:
        """Stop the analysis under way at its next check; the queued ones follow."""
        if self.doing is not None:
            self._cancelled.set()

    def close(self, timeout_s: float) -> bool:
        """Cancel everything and end the thread.  Returns whether it ended."""
        self._closing = True
        while True:
            try:
                self._waiting.put_nowait(None)
                break
            except queue.Full:
                with contextlib.suppress(queue.Empty):
                    self._waiting.get_nowait()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            if self._closing:
                continue
            key, recording = item
            self._cancelled.clear()
            self.doing = ("analysing", 0.0)  # from here on it can be cancelled
            shot, problem, _ = self._attempt(partial(self._analysis.analyse, recording))
            del recording, item  # the file closes with the last reference to its recording
            if shot is not None and fit_pending(shot):
                self._done(key, shot, problem)
                shot = self._fitted(shot)
            self.doing = None
            self._done(key, shot, problem)

    def _fitted(self, shot: Shot) -> Shot:
        fitted, why, stopped = self._attempt(partial(self._analysis.fit, shot))
        if fitted is not None:
            return fitted
        from analysis.fitted import unfitted  # imported late, as in fit_here

        return unfitted(shot, why or "the fit failed", stopped=stopped)

    def _attempt(self, step: Callable[[Progress, Stop], Shot]) -> tuple[Shot | None, str | None, bool]:
        """Run one step of an analysis; return (shot, one line on why it failed, whether it was stopped)."""

        def progress(what: str, share: float) -> None:
            self.doing = (what, share)
            self.steps += 1

        def cancelled() -> bool:
            return self._closing or self._cancelled.is_set()

        try:
            return step(progress, cancelled), None, False
        except Cancelled:
            return None, "the analysis was stopped", True
        except AnalysisError as error:
            return None, one_line(str(error)), False
        except Exception as error:  # a shot that crashes the analysis must not end the session
            return None, f"the analysis failed: {one_line(repr(error))}", False

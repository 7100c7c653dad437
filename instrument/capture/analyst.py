"""The thread that analyses shots, behind a bounded queue: however slow, it never holds up a capture.

A shot's readings are told as soon as they are there, its fit after them.
"""

import queue
import threading
from collections.abc import Callable
from functools import partial

from analysis.fitted.fitted_shot import awaits_fit
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisError, Cancelled, Progress, Shot
from instrument.files.recording_error import one_line

STOPPED = "the analysis was stopped"

Stop = Callable[[], bool]
Analyse = Callable[[Recording, Progress, Stop], Shot]  # (recording, progress, cancelled?) -> shot
Fit = Callable[[Shot, Progress, Stop], Shot]


def fit_here(shot: Shot, progress: Progress, cancelled: Stop) -> Shot:
    """Return a shot that was read with its fit, made in this process."""
    from analysis.pipeline import fitted  # brings the model, which a recording without analysis never needs

    return fitted(shot, progress=progress, cancelled=cancelled)


class Analyst:
    """Analyses one recording after another; ``done(key, shot, problem)`` is called in this thread.

    Where ``analyse`` leaves a shot to await its fit, ``done`` is called twice: with the readings, and with what ``fit``
    made of them, be it only the reason why there is none.
    """

    def __init__(
        self, analyse: Analyse, done: Callable[[int, Shot | None, str | None], None], longest: int, fit: Fit
    ) -> None:
        self._analyse, self._fit = analyse, fit
        self._done = done
        self._waiting: queue.Queue[tuple[int, Recording] | None] = queue.Queue(longest)
        self._cancelled = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="levimass analysis", daemon=True)
        self.doing: tuple[str, float] | None = None  # what is in progress and how far
        self.steps = 0  # how often that was told

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def submit(self, key: int, recording: Recording) -> bool:
        """Queue a recording; False, at once, where too many wait."""
        try:
            self._waiting.put_nowait((key, recording))
        except queue.Full:
            return False
        return True

    def cancel(self) -> None:
        """Stop the analysis under way as soon as it looks; those that wait are done after it."""
        if self.doing is not None:
            self._cancelled.set()

    def close(self, timeout_s: float = 30.0) -> bool:
        """Cancel everything and end the thread.  Returns whether it ended."""
        self._closing = True
        self._cancelled.set()
        while True:
            try:
                self._waiting.put_nowait(None)
                break
            except queue.Full:
                self._drop_one()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _drop_one(self) -> None:
        try:
            self._waiting.get_nowait()
        except queue.Empty:
            return

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            if self._closing:
                continue
            key, recording = item
            self.doing = ("analysing", 0.0)
            self._cancelled.clear()
            shot, problem = self._one(partial(self._analyse, recording))
            del recording, item  # a recording that nobody looks at closes its file
            if shot is not None and awaits_fit(shot):
                self._done(key, shot, problem)
                shot = self._fitted(shot)
            self.doing = None
            self._done(key, shot, problem)

    def _fitted(self, shot: Shot) -> Shot:
        fitted, why = self._one(partial(self._fit, shot))
        if fitted is not None:
            return fitted
        from analysis.fitted.fitted_shot import unfitted  # likewise

        return unfitted(shot, why or "the fit failed")

    def _one(self, step: Callable[[Progress, Stop], Shot]) -> tuple[Shot | None, str | None]:
        def progress(what: str, share: float) -> None:
            self.doing = (what, share)
            self.steps += 1

        def cancelled() -> bool:
            return self._closing or self._cancelled.is_set()

        try:
            return step(progress, cancelled), None
        except Cancelled:
            return None, STOPPED
        except AnalysisError as error:
            return None, one_line(str(error))
        except Exception as error:  # a shot that breaks the analysis must not end the session
            return None, f"the analysis failed: {one_line(repr(error))}"

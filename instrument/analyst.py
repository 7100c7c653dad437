"""The thread that analyses shots, behind a bounded queue: however slow, it never holds up a capture."""

import queue
import threading
from collections.abc import Callable

from analysis.recording import Recording
from analysis.shot import AnalysisError, Cancelled, Progress, Shot
from instrument.recording_error import one_line

Analyse = Callable[[Recording, Progress, Callable[[], bool]], Shot]  # (recording, progress, cancelled?) -> shot


class Analyst:
    """Analyses one recording after another; ``done(key, shot, problem)`` is called in this thread."""

    def __init__(self, analyse: Analyse, done: Callable[[int, Shot | None, str | None], None], longest: int) -> None:
        self._analyse = analyse
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
            shot, problem = self._one(recording)
            self.doing = None
            del recording, item  # a recording that nobody looks at closes its file
            self._done(key, shot, problem)

    def _one(self, recording: Recording) -> tuple[Shot | None, str | None]:
        def progress(what: str, share: float) -> None:
            self.doing = (what, share)
            self.steps += 1

        def cancelled() -> bool:
            return self._closing or self._cancelled.is_set()

        try:
            return self._analyse(recording, progress, cancelled), None
        except Cancelled:
            return None, "the analysis was stopped"
        except AnalysisError as error:
            return None, one_line(str(error))
        except Exception as error:  # a shot that breaks the analysis must not end the session
            return None, f"the analysis failed: {one_line(repr(error))}"

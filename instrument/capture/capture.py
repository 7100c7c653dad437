"""The running instrument: takes shots from a digitizer, saves and analyses them, and shows the live signal.

Four threads: ``CaptureThread`` reads the digitizer and owns the state machine; ``Recorder`` writes a shot to disk while
its samples arrive; ``AnalysisThread`` analyses behind a bounded queue; ``LiveThread`` demodulates for the screen.  The
screen polls ``latest()`` for an immutable Snapshot; no thread calls into the screen.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

from instrument.capture.acquisition import Acquisition, Deadlines, State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture_thread import CaptureThread
from instrument.capture.snapshot import SignalLine, Snapshot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices import Digitizer
from instrument.files import disk_free_bytes
from instrument.live import LiveThread, empty_view, warm

_NO_ANSWER_S = 5.0  # a driver that blocks the capture thread for longer counts as not answering,
_NO_START_S = 60.0  # or for longer than this before its first sample, as firmware may load and kernels compile


def _to_standard_error(line: str) -> None:
    print(f"levimass: {line}", file=sys.stderr)


class Capture:
    """The running instrument: ``start`` it, ``arm`` it, poll ``latest()``, ``close`` it.

    All methods may be called from any thread and return at once, except ``close`` and ``save_pending``.  Without
    ``analysis`` shots are only saved.  ``warm(given_up)`` returns once the kernels that a stream needs are compiled.
    ``say`` gets one line for every fault (default: standard error).
    """

    def __init__(
        self,
        digitizer: Digitizer,
        options: CaptureOptions,
        *,
        analysis: ShotAnalysis | None = None,
        warm: Callable[[Callable[[], bool]], None] = lambda given_up: warm(),
        live: bool = True,
        deadlines: Deadlines | None = None,
        clock: Callable[[], float] = time.monotonic,
        say: Callable[[str], None] = _to_standard_error,
    ) -> None:
        self._digitizer = digitizer
        self._clock = clock
        machine = Acquisition(clock, deadlines or Deadlines())
        self._capture = capture = CaptureThread(digitizer, options, machine, analysis, warm, say)
        self._orders, self._finished = capture.orders, capture.finished
        self.digitizer_held = False  # after ``close``: a call of the digitizer has not returned
        self._live = LiveThread(lambda: capture.run.stream, lambda: capture.options.folder) if live else None
        self._others = [part for part in [self._finished.analysis, self._live] if part is not None]

    def start(self) -> None:
        """Start all threads; the digitizer is first touched in the capture thread."""
        self._capture.recorder.start()
        for part in self._others:
            part.start()
        self._capture.thread.start()

    def arm(self, *, automatic: bool = False) -> None:
        """Arm: wait for the light switch; ``automatic``: re-arm after every shot until aborted."""
        self._orders.put(("arm", automatic))

    def set_automatic(self, on: bool) -> None:
        """Re-arm after the present shot, or stop re-arming."""
        self._orders.put(("automatic", on))

    def abort(self) -> None:
        """Return to idle from any state; samples received after a trigger are saved."""
        self._orders.put(("abort", None))

    def watch(self, on: bool) -> None:
        """Set whether the live curves are in view; if not, they are not computed, which saves most of the idle work."""
        if self._live is not None:
            self._live.watched = on

    def trigger_now(self) -> None:
        """Trigger now, in place of the light switch."""
        self._orders.put(("fire", None))

    def set_options(self, options: CaptureOptions) -> None:
        """Change the options; they apply from the next arming on."""
        self._orders.put(("options", options))

    def save_pending(self, folder: Path) -> list[Path]:
        """Save the shots that are only in memory to ``folder`` and return their paths.

        Raises RecordingError at the first that cannot be saved; it stays in memory.  Waits for the disk.
        """
        return self._finished.save_pending(folder)

    def latest(self) -> Snapshot:
        capture, live = self._capture, self._live
        status, stream, folder = capture.machine.status, capture.run.stream, capture.options.folder
        state, message, remedy = status.state, status.message, status.remedy
        streaming = stream is not None and stream.ring.total > stream.start and not capture.run.starting
        limit_s = _NO_ANSWER_S if streaming and not capture.run.simulated else _NO_START_S
        if capture.thread.is_alive() and self._clock() - (capture.alive_s or self._clock()) > limit_s:
            state, message, remedy = State.FAULT, "the digitizer does not answer", "re-plug it, then choose it again"
        doing, progress = self._progress(state)
        return Snapshot(
            state=state,
            since_s=status.since_s,
            automatic=status.automatic,
            message=message,
            remedy=remedy,
            signal=SignalLine(
                channels=live.channels if live is not None else (),
                switch_level=capture.run.switch_level,
                switch_toggles=capture.run.toggles,
                switch_thresholds_v=capture.run.thresholds_v,
                disk_free_bytes=live.disk_free_bytes if live is not None else disk_free_bytes(folder),
                folder=folder,
                folder_problem=capture.folder_problem,
                samples_lost=stream.lost if stream is not None else 0,
                losses=stream.losses if stream is not None else 0,
                samples_read=stream.ring.total - stream.start if stream is not None else 0,
            ),
            live=live.view if live is not None else empty_view(),
            doing=doing,
            progress=progress,
            waiting=self._finished.waiting,
            shots=self._finished.taken,
            finished=self._finished.newest,
            unsaved=self._finished.unsaved,
        )

    def close(self, timeout_s: float = 30.0) -> bool:
        """Stop, save what was recorded, end all threads, close the digitizer.  Returns whether all threads ended."""
        capture = self._capture
        capture.closing = True
        self._digitizer.stop()  # makes a read under way return
        if capture.thread.is_alive():
            capture.thread.join(timeout_s)
        ended = not capture.thread.is_alive()
        self.digitizer_held = capture.prepared and not ended
        if not ended and capture.shot is not None and not capture.shot.complete:
            capture.shot.finish("the digitizer did not answer")
        ended &= capture.recorder.close(timeout_s)
        for part in self._others:
            ended &= part.close(timeout_s)
        if not capture.thread.is_alive():
            capture.take_orders()  # the recorder's last report
            capture.release_folder()
        if not (capture.thread.is_alive() and capture.touched):
            self._digitizer.close()
        return ended

    def __enter__(self) -> "Capture":
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _progress(self, state: State) -> tuple[str | None, float | None]:
        shot = self._capture.shot
        if shot is not None and state is State.TRIGGERED:
            return "recording", shot.filled / shot.settings.samples
        if shot is not None and state is State.TRANSFERRING:
            return "saving", shot.written / max(1, shot.filled)  # a device may end at once
        analysis = self._finished.analysis
        doing = analysis.doing if analysis is not None else None
        return doing if doing is not None else (None, None)

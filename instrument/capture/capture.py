"""The running instrument: takes shots from a digitizer, saves and analyses them, and shows the live signal.

Four threads: ``CaptureThread`` reads the digitizer and owns the state machine; ``Recorder`` writes a shot to disk while
its samples arrive; ``AnalysisThread`` analyses behind a bounded queue; ``LiveThread`` demodulates for the screen.  The
screen polls ``latest()`` for an immutable Snapshot; no thread calls into the screen.  ``acquire`` records without one.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from analysis.shot import Setup
from instrument.capture.acquisition import CAN_ARM, Acquisition, Deadlines, State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture_thread import CaptureThread
from instrument.capture.snapshot import CapturedShot, SignalLine, Snapshot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices import CaptureSettings, Digitizer
from instrument.files import RecordingError, disk_free_bytes
from instrument.live import LiveThread, Stream, empty_view, warm

_NO_ANSWER_S = 5.0  # a driver that blocks the capture thread for longer counts as not answering,
_NO_START_S = 60.0  # or for longer than this before its first sample, as firmware may load and kernels compile
_LOOK_S = 0.01
RESCUED = "levimass-rescued"  # a folder in the user's home, or with the temporary files


def _to_standard_error(line: str) -> None:
    print(f"levimass: {line}", file=sys.stderr)


class Capture:
    """The running instrument: ``start`` it, ``arm`` it, poll ``latest()``, ``close`` it.

    All methods may be called from any thread and return at once, except ``close`` and ``save_pending``.  Without
    ``analysis`` shots are only saved.  ``warm(given_up)`` returns once the kernels that a stream needs are compiled.
    ``say`` gets one line for every fault (default: standard error).  ``numbers`` gives the shots' numbers, from 1 by
    default; ``machine`` has the clock and the deadlines.
    """

    def __init__(
        self,
        digitizer: Digitizer,
        options: CaptureOptions,
        *,
        analysis: ShotAnalysis | None = None,
        warm: Callable[[Callable[[], bool]], None] = lambda given_up: warm(),
        live: bool = True,
        machine: Acquisition | None = None,
        say: Callable[[str], None] = _to_standard_error,
        numbers: Iterator[int] | None = None,
    ) -> None:
        self._digitizer = digitizer
        machine = machine or Acquisition(time.monotonic)
        self._clock = machine.clock
        self._capture = capture = CaptureThread(digitizer, options, machine, analysis, warm, say, numbers)
        self._orders, self._shots = capture.orders, capture.captured
        self.digitizer_held = False  # after ``close``: a call of the digitizer has not returned
        self._live = LiveThread(lambda: capture.run.stream, lambda: capture.options.folder) if live else None
        self._others = [part for part in [self._shots.analysis, self._live] if part is not None]

    def start(self) -> None:
        """Start all threads; the digitizer is first touched in the capture thread."""
        self._capture.recorder.start()
        for part in self._others:
            part.start()
        self._capture.start()

    def arm(self, *, automatic: bool = False) -> None:
        """Arm: wait for the light switch; ``automatic``: re-arm after every shot until aborted."""
        self._capture.arm_pressed_s = self._clock()
        self._orders.put(("arm", automatic))

    def set_automatic(self, on: bool) -> None:
        """Re-arm after the present shot, or stop re-arming."""
        self._orders.put(("automatic", on))

    def abort(self) -> None:
        """Return to idle from any state; samples received after a trigger are saved."""
        self._orders.put(("abort", None))

    def watch(self, curves: bool, *, switch: bool) -> None:
        """Set whether the live curves are computed, and whether each step of the light switch is counted.

        Both together are most of the work while no shot is taken.
        """
        self._capture.counts_steps = switch
        if self._live is not None:
            self._live.watched = curves

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
        return self._shots.save_pending(folder)

    def latest(self) -> Snapshot:
        capture = self._capture
        pressed_s = capture.arm_pressed_s  # read before the state, which changes before this is cleared
        status, stream, folder = capture.machine.status, capture.run.stream, capture.options.folder
        if pressed_s is not None and status.state in CAN_ARM:
            status = replace(status, state=State.ARMING, since_s=pressed_s)
        if self._unanswered(stream):
            what, remedy = "the digitizer does not answer", "re-plug it, then choose it again"
            status = replace(status, state=State.FAULT, message=what, remedy=remedy, save_failed=False)
        doing, progress = self._progress(status.state)
        return Snapshot(
            state=status.state,
            since_s=status.since_s,
            automatic=status.automatic,
            message=status.message,
            remedy=status.remedy,
            save_failed=status.save_failed,
            signal=self._signal(stream, folder),
            live=self._live.view if self._live is not None else empty_view(),
            doing=doing,
            progress=progress,
            shots=self._shots.taken,
            captured=self._shots.shown,
            unsaved=self._shots.unsaved,
        )

    def close(self, timeout_s: float = 30.0) -> bool:
        """Stop, save what was recorded, end all threads, close the digitizer.  Returns whether all threads ended."""
        capture = self._capture
        capture.closing = True
        self._digitizer.stop()  # makes a read under way return
        ended = capture.thread.close(timeout_s)
        self.digitizer_held = capture.prepared and not ended
        if not ended and capture.shot is not None and not capture.shot.complete:
            capture.shot.finish("the digitizer did not answer")
        ended &= capture.recorder.close(timeout_s)
        for part in self._others:
            ended &= part.close(timeout_s)
        if not capture.thread.alive:
            capture.take_orders()  # the recorder's last report
            capture.release_folder()
        if not (capture.thread.alive and capture.touched):
            self._digitizer.close()
        return ended

    def __enter__(self) -> "Capture":
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _unanswered(self, stream: Stream | None) -> bool:
        """Return whether a call of the digitizer has lasted too long."""
        capture = self._capture
        streaming = stream is not None and stream.ring.total > stream.start and not capture.run.starting
        limit_s = _NO_ANSWER_S if streaming and not capture.run.simulated else _NO_START_S
        return capture.thread.alive and self._clock() - (capture.alive_s or self._clock()) > limit_s

    def _signal(self, stream: Stream | None, folder: Path) -> SignalLine:
        run, live = self._capture.run, self._live
        return SignalLine(
            channels=live.channels if live is not None else (),
            switch_level=run.switch_level,
            switch_toggles=run.toggles,
            switch_thresholds_v=run.thresholds_v,
            disk_free_bytes=live.disk_free_bytes if live is not None else disk_free_bytes(folder),
            folder=folder,
            folder_problem=self._capture.folder_problem,
            samples_lost=stream.lost if stream is not None else 0,
            losses=stream.losses if stream is not None else 0,
            samples_read=stream.ring.total - stream.start if stream is not None else 0,
        )

    def _progress(self, state: State) -> tuple[str | None, float | None]:
        shot = self._capture.shot
        if shot is not None and state is State.TRIGGERED:
            return "recording", shot.filled / shot.settings.samples
        if shot is not None and state is State.TRANSFERRING:
            return "saving", shot.written / max(1, shot.filled)  # a device may end at once
        analysis = self._shots.analysis
        doing = analysis.doing if analysis is not None else None
        return doing if doing is not None else (None, None)


class AcquireError(Exception):
    """The reason why recording ended, in one line; ``saved`` are the recordings made before."""

    def __init__(self, what: str, saved: list[Path]) -> None:
        super().__init__(what)
        self.saved = saved


def acquire(
    digitizer: Digitizer,
    out: Path,
    shots: int,
    settings: CaptureSettings | None = None,
    timeout_s: float = 60.0,
    report: Callable[[str], None] = lambda line: None,
    *,
    setup: Setup | None = None,
) -> list[Path]:
    """Record ``shots`` shots into ``out`` and return the paths of their metadata.

    ``settings`` None: ``usual_settings`` before each shot; ``setup`` None: the digitizer's own.  ``timeout_s`` is the
    longest wait for each trigger; ``report`` gets one line per shot.  Raises AcquireError.  Closes the digitizer.
    """
    saved: list[Path] = []
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        digitizer.close()
        raise AcquireError(f"{out}: {error.strerror}", saved) from None
    faults: list[str] = []
    capture = Capture(
        digitizer,
        CaptureOptions(out, settings, setup),
        live=False,
        machine=Acquisition(time.monotonic, Deadlines(armed_s=timeout_s)),
        say=faults.append,
    )
    try:
        with capture:
            for number in range(shots):
                capture.arm()
                shot = _wait(capture, number + 1, timeout_s, faults)
                assert shot.path is not None
                saved.append(shot.path)
                cut = f" ({shot.problem})" if shot.problem else ""
                report(f"shot {number + 1} of {shots}: {shot.path}{cut}")
    except AcquireError as failed:
        now = capture.latest()  # after close: a shot in progress is saved, or only in memory
        saved += [shot.path for shot in now.finished if shot.path is not None and shot.path not in saved]
        what = f"{now.message}: {_rescued(capture)}" if now.unsaved else str(failed)
        raise AcquireError(what, saved) from None
    return saved


def _rescued(capture: Capture) -> str:
    """Save the shots that are only in memory wherever there is room; return one line that says where they are."""
    left = list(capture.latest().unsaved)
    for place in (Path.home(), Path(tempfile.gettempdir())):
        folder = place / RESCUED
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
            paths = capture.save_pending(folder)
        except (OSError, RecordingError):
            continue
        return f"the shot was saved to {', '.join(map(str, paths))} instead; make room, then go on"
    return f"{', '.join(left)} is lost: there is no room in the home folder or the temporary one either"


def _wait(capture: Capture, number: int, timeout_s: float, faults: list[str]) -> CapturedShot:
    while True:
        now = capture.latest()
        for shot in now.finished:
            if shot.number >= number and shot.path is not None and now.state is State.IDLE:
                return shot
        if now.state is State.FAULT:
            raise AcquireError(faults[-1] if faults else now.message, [])
        if now.state is State.IDLE and now.message:
            raise AcquireError(f"{now.message} ({timeout_s:g} s): {now.remedy}", [])
        time.sleep(_LOOK_S)

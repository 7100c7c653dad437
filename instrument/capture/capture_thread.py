"""The thread that reads the digitizer, finds the trigger and cuts shots from the stream; it never waits for a disk."""

import queue
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from itertools import count
from typing import Any

import numpy as np

from analysis.fitted import fit_pending
from analysis.shot import Gap
from instrument.background import Task, WorkerThread
from instrument.capture.acquisition import Acquisition, Action, Event, State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.captured_shots import CapturedShots
from instrument.capture.recorder import GrowingShot, Recorded, Recorder
from instrument.capture.stream_reader import CaptureOptions, ReadBlock, StreamReader, check_settings
from instrument.devices import Digitizer, DigitizerError, Overwritten, usual_settings
from instrument.files import FolderLock, RecordingError, disk_free_bytes, one_line

MAX_UNSAVED = 4  # shots that are only in memory; no further shot is taken until one is saved
_DISK_RESERVE_BYTES = 64 * 2**20
_ORDERS_S = 0.02


class CaptureThread:
    """Reads the digitizer block by block, and carries out ``orders`` between two blocks."""

    def __init__(
        self,
        digitizer: Digitizer,
        options: CaptureOptions,
        machine: Acquisition,
        analysis: ShotAnalysis | None,
        warm: Callable[[Callable[[], bool]], None],
        say: Callable[[str], None],
        numbers: Iterator[int] | None = None,
    ) -> None:
        orders: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self.orders = orders  # callbacks hold the queue, not self: a reference cycle would keep the ring in memory
        self.recorder = Recorder(lambda recorded: orders.put(("recorded", recorded)))
        self.captured = CapturedShots(analysis, lambda *made: orders.put(("analysed", made)), numbers or count(1))
        self.machine = machine
        self.run = StreamReader(digitizer, machine.clock)
        self.options = options
        self.shot: GrowingShot | None = None  # being received, or being written to disk
        self.folder_problem: str | None = None
        self.alive_s: float | None = None
        self.arm_pressed_s: float | None = None  # when ARM was pressed, until the thread has taken the order
        self.closing = False
        self.counts_steps = True  # whether each step of the light switch is counted also while no shot can begin
        self.touched = False  # while True only this thread may call the digitizer
        self.prepared = False  # while True every call of the digitizer returns soon
        self._digitizer = digitizer
        self._warm, self._say = warm, say
        self._fire = False
        self._lock: FolderLock | None = None
        self._progress: tuple[int | None, ...] = ()  # samples of the shot received and written, steps of the analysis
        self._awaited: int | None = None  # number of the shot whose analysis will end the state ANALYSING
        self.thread = WorkerThread[Task]("capture")

    def start(self) -> None:
        self.thread.add(Task("capture", lambda _, __: self._main()))
        self.thread.start()

    def take_orders(self) -> None:
        """Carry out all queued orders; called by the thread itself, and once more after its end."""
        while True:
            try:
                order = self.orders.get_nowait()
            except queue.Empty:
                return
            self._take(order)

    def release_folder(self) -> None:
        """Release the lock on the folder; after the thread's end."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _main(self) -> None:
        self.touched = True  # set before ``closing`` is read: ``Capture.close`` reads them in the other order
        if self.closing:
            return
        self._guarded(self._digitizer.prepare)
        self.touched = False
        self._guarded(lambda: self._warm(lambda: self.closing))
        self.touched = True
        if self.closing:
            return
        self.prepared = True
        if self.orders.empty():  # a queued order starts the stream itself, or reports why not
            self._guarded(self._watch)
        while not self.closing:
            self.alive_s = self.machine.clock()
            self._guarded(self._turn)
        self._keep("the program was closed")
        self._quietly_stop()

    def _guarded(self, part: Callable[[], None]) -> None:
        try:
            part()
        except DigitizerError as error:
            self._fail(error.what, error.remedy)
        except RecordingError as error:
            self.folder_problem = str(error)
            self._fail(str(error), "choose another folder, then arm again")
        except Exception as error:  # a driver fault ends a shot and is reported; it must not end the session
            self._fail(f"unexpected: {one_line(repr(error))}", "arm again; report this if it happens again")

    def _turn(self) -> None:
        self.take_orders()
        self._look_for_progress()
        self._do(self.machine.tick())
        if self.run.running:
            self._read()
        else:
            try:
                self._take(self.orders.get(timeout=_ORDERS_S))
            except queue.Empty:
                return

    def _look_for_progress(self) -> None:
        """Restart the deadline after progress in receiving, writing or analysing a shot."""
        shot, analysis = self.shot, self.captured.analysis
        now = getattr(shot, "filled", None), getattr(shot, "written", None), getattr(analysis, "steps", None)
        if now != self._progress:
            self._progress = now
            if self.machine.status.state is not State.ARMED:
                self.machine.progressed()

    # orders and what they lead to ---------------------------------------------------------------------------------

    def _take(self, order: tuple[str, Any]) -> None:
        kind, what = order
        if self.closing and kind in ("arm", "options", "fire"):
            self.arm_pressed_s = None
            return
        if kind == "arm":
            action = self.machine.handle(Event.ARM, automatic=what)
            self.arm_pressed_s = None  # only now, so that ``latest`` shows ARMING throughout
            self._do(action)
        elif kind == "automatic":
            self.machine.set_automatic(what)
        elif kind == "abort":
            self._do(self.machine.handle(Event.ABORT))
            if self.machine.status.state is State.IDLE:
                self._watch()
        elif kind == "fire":
            self._fire = self.machine.status.state is State.ARMED
        elif kind == "options":
            self.options = what
            if self.machine.status.state is State.IDLE:
                self._watch()
        elif kind == "recorded":
            self._recorded(what)
        elif kind == "analysed":
            number, shot, problem = what
            self.captured.analysed(number, shot, problem)
            if number == self._awaited and not (shot is not None and fit_pending(shot)):
                self._do(self.machine.handle(Event.ANALYSED))

    def _do(self, action: Action) -> None:
        if action is Action.START:
            if not self.closing:
                self._guarded(self._start)
        elif action is Action.FINISH:
            assert self.shot is not None
            self.shot.finish(None if self.shot.room == 0 else "the stream ended")
            self._stop_unless_wanted()
        elif action is Action.KEEP:
            aborted = self.machine.status.state is State.IDLE  # a fault keeps the shot, too
            self._keep(self.machine.status.message or "aborted", aborted=aborted)
            self._stop_unless_wanted()
        elif action is Action.STOP:
            self._stop_unless_wanted()
        elif action is Action.CANCEL:
            assert self.captured.analysis is not None  # it is what is being done
            self.captured.analysis.cancel()

    def _start(self) -> None:
        self._fire = False
        if len(self.captured.unsaved) >= MAX_UNSAVED:
            raise DigitizerError(f"{len(self.captured.unsaved)} shots are only in memory", "save them first")
        settings = self.options.settings or usual_settings(self._digitizer)
        check_settings(settings, len(self._digitizer.capabilities.channels))
        if not self.run.continues(settings, self.options):
            self.run.start(settings, self.options)
        stream = self.run.stream
        assert stream is not None
        self._check_folder(2 * len(stream.channels) * settings.samples)
        stream.settings = settings
        self._do(self.machine.handle(Event.STARTED))

    def _check_folder(self, shot_bytes: int) -> None:
        folder = self.options.folder
        if self._lock is None or self._lock.folder != folder or not self._lock.valid():
            self.release_folder()
            self._lock = FolderLock(folder)
        free = disk_free_bytes(folder)
        if free is not None and free < shot_bytes + _DISK_RESERVE_BYTES:
            needed = f"a shot takes {shot_bytes / 1e6:.0f} MB, and a disk reserve is required"
            raise RecordingError(folder, f"only {free / 1e6:.0f} MB free, {needed}")
        self.folder_problem = None

    def _watch(self) -> None:
        """Start an endless stream before arming, so that its signals can be checked."""
        able = self._digitizer.capabilities
        if able.max_samples is not None or able.hardware_trigger:
            return
        settings = self.options.settings or usual_settings(self._digitizer)
        if not self.run.continues(settings, self.options):
            self.run.start(settings, self.options)

    def _stop_unless_wanted(self) -> None:
        """Stop the digitizer, unless its stream is endless: its signals are still checked."""
        if self.machine.status.state is State.FAULT or not self.run.endless:
            self._quietly_stop()

    def _quietly_stop(self) -> None:
        try:
            self.run.stop()
        except Exception as error:  # an unplugged device cannot even be stopped
            self.run.running = False
            if self.machine.status.state is not State.FAULT and not self.closing:
                self.machine.handle(Event.FAIL, one_line(str(error)), "re-plug the digitizer")

    def _fail(self, what: str, remedy: str, *, save_failed: bool = False) -> None:
        self._say(f"{what}: {remedy}" if remedy else what)
        self._do(self.machine.handle(Event.FAIL, what, remedy, save_failed=save_failed))

    # samples and shots --------------------------------------------------------------------------------------------

    def _read(self) -> None:
        state = self.machine.status.state
        awaited = state is State.ARMED or (state is State.TRIGGERED and self.shot is None)
        block = self.run.read(closely=awaited or self.counts_steps)
        if block is None:
            return
        if block.fired:
            self._do(self.machine.handle(Event.TRIGGER))
        elif awaited:
            self._look_for_trigger(block)
        elif state is State.TRIGGERED:
            assert self.shot is not None
            self._append(self.shot, block)
        state = self.machine.status.state
        if state is State.TRIGGERED and self.shot is not None and (self.shot.room == 0 or block.ended):
            self._do(self.machine.handle(Event.COMPLETE))
        elif block.ended and self.shot is None and not self.closing:
            self._refuse_early_end(state)

    def _append(self, shot: GrowingShot, block: ReadBlock) -> None:
        if block.lost_before != 0:
            shot.lost(block.lost_before)
        if block.step is not None and self.run.hardware_trigger:
            shot.trigger_sample = shot.filled + block.step
        shot.append(block.counts)

    def _refuse_early_end(self, state: State) -> None:
        """Raise DigitizerError if a stream that ended without a shot should have brought one."""
        if state is State.TRIGGERED:
            raise DigitizerError("the light switch fired, but no sample of the shot came", "arm again")
        if state is State.ARMED:
            never = self.run.why_no_step()
            what = "the stream ended before the light switch fired" + (f": {never}" if never else "")
            raise DigitizerError(what, "check it and its thresholds")

    def _look_for_trigger(self, block: ReadBlock) -> None:
        stream = self.run.stream
        assert stream is not None
        step = block.step
        if len(block.counts) == 0:
            return
        if step is not None:
            self._begin_shot(block, block.first + step)
        elif self.run.hardware_trigger:
            # the device sends the shot from its first sample on, and may report the trigger's place later
            self._begin_shot(block, stream.start + stream.settings.pre_trigger_samples)
        elif self._fire:
            self._begin_shot(block, block.first + len(block.counts) - 1)

    def _begin_shot(self, block: ReadBlock, at: int) -> None:
        """Begin a shot triggered at sample ``at`` of the ring, with the samples that the ring holds of it."""
        stream = self.run.stream
        assert stream is not None
        settings, ring = stream.settings, stream.ring
        end = block.first + len(block.counts)
        first = max(stream.start, ring.oldest, at - settings.pre_trigger_samples)
        age = timedelta(seconds=(end - first) / settings.sample_rate_hz)
        shot = GrowingShot(
            settings=settings,
            channels=stream.channels,
            setup=stream.setup,
            source=stream.source,
            started_at=(datetime.now(UTC) - age).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            trigger_sample=at - first,
            counts=np.empty((settings.samples, ring.channels), np.int16),
            unseen_loss_s=stream.unseen_loss_s,
            doubtful_rate_hz=stream.doubtful_rate_hz,
        )
        length = min(end - first, shot.room)
        try:
            ring.copy_into(first, shot.counts[:length])
        except Overwritten as error:
            raise DigitizerError("the part before the trigger is gone", "ask for a shorter one") from error
        shot.filled = length
        shot.gaps += [Gap(n - first, lost) for n, lost in stream.gaps if first < n < first + length]
        self.shot = shot
        self._do(self.machine.handle(Event.TRIGGER))
        self.recorder.begin(shot, self.options.folder)

    def _keep(self, reason: str, *, aborted: bool = False) -> None:
        if self.shot is not None and not self.shot.complete:
            self.shot.finish(reason, aborted=aborted)

    def _recorded(self, recorded: Recorded) -> None:
        number = self.captured.recorded(recorded)
        awaited = recorded.shot is self.shot
        if awaited:
            self.shot = None
            self._awaited = number
        if recorded.problem is not None:
            self._fail(recorded.problem, "the shot is kept in memory: save it to another folder", save_failed=True)
        elif awaited:
            self._do(self.machine.handle(Event.SAVED))
            if number is None:
                self._do(self.machine.handle(Event.ANALYSED))

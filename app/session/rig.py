"""The window's access to the digitizer: one source at a time, opened and closed in a separate thread."""

import contextlib
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.pipeline import read
from analysis.shot import AnalysisSettings, Cancelled, Channel, Progress, Recording, Shot, Stop
from app.session.jobs import pop_all
from app.session.kernels import Stage
from instrument.background import Task, Work, WorkerThread
from instrument.capture import (
    CAN_ARM,
    Acquisition,
    CapturedShot,
    CaptureOptions,
    Deadlines,
    ShotAnalysis,
    SignalLine,
    Snapshot,
    State,
    fit_here,
)
from instrument.devices import (
    CaptureSettings,
    Digitizer,
    DigitizerError,
    FoundDevice,
    found_devices,
    listed_sources,
    network_name,
)
from instrument.live import empty_view
from instrument.process import SubprocessAnalysis, open_in_subprocess

if TYPE_CHECKING:
    from instrument.capture import Capture

Open = Callable[[str], Digitizer]
AwaitKernels = Callable[[Stage, Callable[[], bool]], None]  # returns once the kernels are ready, or raises Cancelled
Change = Callable[[CaptureOptions], CaptureOptions]
BENCH = "bench"
CLOSE_S = 40.0  # longest wait for the end of a capture


@dataclass(frozen=True, slots=True)
class _OpenSource:
    source: str
    digitizer: Digitizer
    capture: "Capture"
    channels: tuple[Channel, ...]
    rate_hz: float | None


class Rig:
    """Opens sources, arms, aborts and returns snapshots; only ``close`` and ``save_pending`` wait.

    A thread opens and closes devices, which may take seconds; ``latest`` reports this.  ``analyst`` analyses shots
    in a subprocess; without one they are analysed in a thread of this process.
    """

    def __init__(
        self,
        options: Callable[[str, Digitizer], CaptureOptions],
        analysis: Callable[[], AnalysisSettings],
        kernels: AwaitKernels,
        *,
        source: str = BENCH,
        deadlines: Deadlines | None = None,
        open_digitizer: Open = open_in_subprocess,
        analyst: SubprocessAnalysis | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._options, self._analysis, self._kernels = options, analysis, kernels
        self._deadlines, self._open, self._clock = deadlines or Deadlines(), open_digitizer, clock
        self._analyst = analyst
        self._running: _OpenSource | None = None
        self._fault: tuple[str, str] | None = None
        self._since_s = clock()
        self._numbers = count(1)  # of the shots, over all sources
        self._taken: dict[int, tuple[bool, bool]] = {}  # what each shot awaited when it was last returned
        self._problems: deque[str] = deque()
        self._found: tuple[tuple[str, str], ...] = ()
        self._network: tuple[str, ...] = ()
        self.rearm = False
        self._planned: Change | None = None
        self._thread = WorkerThread[Task]("source")
        self._thread.add(Task("looking for devices", lambda _, __: self._find_devices()))
        self._opening: Task | None = None
        self.open(source)
        self._thread.start()

    # commands of the operator ---------------------------------------------------------------------------------------

    def open(self, source: str, planned: Change | None = None) -> None:
        """Close the present source and open another; ``latest`` reports the outcome.

        For a ``planned`` shot it is armed at once, with options changed until the next call.
        """
        self.source = source
        self._request(f"opening {source}", partial(self._open_source, source, planned))

    def sources(self) -> list[tuple[str, str]]:
        """Return (name, words) of each source: bench, found devices, known network addresses, replay of a recording."""
        network = [(source, network_name(source)) for source in self._network]
        listed = [*listed_sources(), *self._found, *network]
        return sorted(listed, key=lambda source: source[0].endswith(":"))  # those that lack an address come last

    def remember_found(self, found: Sequence[FoundDevice]) -> None:
        """List these devices as sources."""
        self._found = tuple((device.source, f"{device.name}, {device.where}") for device in found)

    def remember_network(self, sources: Sequence[str]) -> None:
        """List these network oscilloscopes as sources."""
        self._network = tuple(sources)

    def arm(self) -> None:
        """Arm for the light switch; a source that failed to open is opened again."""
        if self._running is not None:
            self._running.capture.arm(automatic=self.rearm)
        elif self._fault is not None:
            self.open(self.source)

    def abort(self) -> None:
        if self._running is not None:
            self._running.capture.abort()
        elif not self._thread.queued:
            self._fault = None

    def trigger_now(self) -> None:
        """Trigger manually, in place of the light switch."""
        if self._running is not None:
            self._running.capture.trigger_now()

    def set_rearm(self, on: bool) -> None:
        """Set whether to arm automatically after each shot, the present one included."""
        self.rearm = on
        if self._running is not None:
            self._running.capture.set_automatic(on)

    def options_changed(self) -> None:
        """Apply the changed settings from the next arming on."""
        running = self._running
        if running is not None:
            try:
                running.capture.set_options(self._chosen(running.source, running.digitizer))
            except OSError as error:
                self._problems.append(f"the settings were not applied: {error}")

    def save_pending(self, folder: Path) -> dict[str, Path]:
        """Save shots that are only in memory to ``folder``; return their paths by name.  Waits for the disk.

        Raises RecordingError at the first shot that cannot be saved; that shot stays in memory.
        """
        running = self._running
        if running is None:
            return {}
        names = running.capture.latest().unsaved
        return dict(zip(names, running.capture.save_pending(folder), strict=False))

    # state for the window ------------------------------------------------------------------------------------------

    @property
    def opened(self) -> str | None:
        """Get the open source, None while there is none."""
        return self._running.source if self._running is not None else None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Get the channels of the open source."""
        return self._running.channels if self._running is not None else ()

    @property
    def rate_hz(self) -> float | None:
        """Get the sample rate at which the open source takes shots."""
        return self._running.rate_hz if self._running is not None else None

    def latest(self) -> Snapshot:
        """Return the newest snapshot of the instrument."""
        running = self._running
        if running is not None:
            return running.capture.latest()
        state = State.FAULT if self._fault is not None else State.IDLE
        message, remedy = self._fault or ("opening the source", "")
        return Snapshot(state, self._since_s, False, message, remedy, SignalLine(), empty_view())

    def watch(self, curves: bool, *, switch: bool) -> None:
        """Set whether the live curves are computed, and whether each step of the light switch is counted."""
        if self._running is not None:
            self._running.capture.watch(curves, switch=switch)

    def can_arm(self, snapshot: Snapshot) -> bool:
        """Return whether ARM is possible now."""
        if self._running is None:
            return self._fault is not None
        return snapshot.state in CAN_ARM

    def can_abort(self, snapshot: Snapshot) -> bool:
        """Return whether Abort is possible now."""
        return snapshot.state is not State.IDLE

    def take_shots(self, snapshot: Snapshot) -> list[CapturedShot]:
        """Return each shot once when captured, when its readings are ready or failed, and when it is fitted."""
        new = []
        for shot in snapshot.captured:
            known, awaits = self._taken.get(shot.number), (shot.waits, shot.awaits_fit)
            if awaits != known:
                self._taken[shot.number] = awaits
                new.append(replace(shot, fitted_later=known is not None and not known[0]))
        return new

    def take_problems(self) -> list[str]:
        """Return the problems outside the capture since the last call."""
        return pop_all(self._problems)

    def close(self) -> bool:
        """End all threads, including the capture's; return whether they ended."""
        self._request("closing the source", lambda _, __: self._close_running())
        ended = self._thread.close(CLOSE_S, finish=True)
        if self._analyst is not None:
            self._analyst.close()
        return ended

    def _request(self, name: str, work: Work) -> None:
        """Queue an opening or the closing in place of one that has not begun."""
        if self._opening is not None:
            self._opening.cancel()
        self._opening = self._thread.add(Task(name, work))

    # run in the thread -------------------------------------------------------------------------------------------

    def _find_devices(self) -> None:
        try:
            self.remember_found(found_devices())
        except DigitizerError:
            self._found = ()  # the USB library is missing, which ``levimass doctor`` reports

    def _close_running(self) -> None:
        running, self._running = self._running, None
        self._since_s = self._clock()
        if running is not None and not running.capture.close() and running.capture.digitizer_held:
            self._problems.append(f"{running.source} did not close in time; unplug it and plug it in again before use")

    def _open_source(self, source: str, planned: Change | None, _: Progress, cancelled: Stop) -> None:
        from instrument.capture import Capture  # slow to import

        self._close_running()
        self._fault, self._planned = None, planned
        try:
            digitizer = self._open(source)
            able = digitizer.capabilities
            options = self._chosen(source, digitizer)
            capture = Capture(
                digitizer,
                options,
                analysis=ShotAnalysis(self._read, self._fit),
                warm=self._warm,
                machine=Acquisition(self._clock, self._deadlines),
                numbers=self._numbers,
            )
            capture.start()
        except DigitizerError as error:
            self._fault = (error.what, error.remedy or "choose another source")
            return
        except Exception as error:  # a driver may raise anything
            self._fault = (f"{source} could not be opened: {error!r}", "choose another source")
            return
        settings: CaptureSettings | None = options.settings or digitizer.default_settings()
        rate = settings.sample_rate_hz if settings is not None else None
        self._running = _OpenSource(source, digitizer, capture, able.channels, rate)
        if planned is not None and not cancelled():  # no newer request came meanwhile
            self.arm()

    def _chosen(self, source: str, digitizer: Digitizer) -> CaptureOptions:
        options = self._options(source, digitizer)
        return options if self._planned is None else self._planned(options)

    def _warm(self, given_up: Callable[[], bool]) -> None:
        with contextlib.suppress(Cancelled):
            self._kernels(Stage.READINGS, given_up)

    def _read(self, recording: Recording, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
        self._await(Stage.READINGS, progress, cancelled)
        if self._analyst is not None:
            return self._analyst.read(recording, self._analysis(), progress, cancelled)
        return read(recording, self._analysis(), progress=progress, cancelled=cancelled)

    def _fit(self, shot: Shot, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
        self._await(Stage.FIT, progress, cancelled)
        if self._analyst is not None:
            return self._analyst.fit(shot, progress, cancelled)
        return fit_here(shot, progress, cancelled)

    def _await(self, stage: Stage, progress: Progress, cancelled: Callable[[], bool]) -> None:
        def given_up() -> bool:
            progress("first start: compiling", 0.0)  # repeated, so that the wait does not count as a stall
            return cancelled()

        self._kernels(stage, given_up)

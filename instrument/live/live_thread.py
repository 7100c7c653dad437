"""The thread that demodulates the running stream for the screen, checks its signals, and measures the site at rest."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.reading import MIN_S, PlannedShot, SiteFloor, read_site
from analysis.shot import DEFAULT_WAVELENGTH_AIR_M, AnalysisError, Role, Setup
from analysis.signal import LiveChunk, LiveDemodulator
from instrument.background import Task, WorkerThread
from instrument.devices import CaptureSettings, Overwritten, Ring
from instrument.files import disk_free_bytes, one_line
from instrument.live.live_view import ChannelSignal, LiveWindow, empty_view
from instrument.live.setup_check import CHECKED_SAMPLES, check_signals
from instrument.live.stream import Stream
from instrument.trigger import LightSwitch, MotionTrigger, TriggerSettings

OUTPUT_HZ = 10e3  # rate of the curves' points; a digitizer's rate allows it within a few percent
WINDOW_S = 2.0
RAW_SAMPLES = 2000
_CHUNK = 1 << 19  # samples demodulated at a time: shorter ones cost more calls, longer ones leave the caches
_EVERY_S = 0.1  # ten pictures a second are as readable as 30, for a third of the work
_SIGNALS_EVERY_S = 0.2  # between two checks of the signals: faster changes cannot be read
_UNWATCHED_EVERY_S = 0.5  # the same while neither the curves nor the set-up are in view
_DISK_EVERY_S = 1.0
KEPT_S = 4.0  # of rest kept: enough to resolve motors a tenth of a hertz from the mains
EVERY_S = 4.0  # of rest between two readings of the site; less while fewer than KEPT_S are there
AT_REST_M_PER_S = 2e-3  # a hand that holds the block moves it more slowly, a push faster
_AVERAGED = 4  # points of the live curve averaged to one sample of rest
_SWITCH_S = 2.6e-3  # from light switch to plate at a usual speed


class LiveThread:
    """Follows the newest stream; if it cannot keep up it skips samples and counts them."""

    def __init__(self, stream: Callable[[], Stream | None], folder: Callable[[], Path]) -> None:
        self._newest = stream
        self._folder = folder
        self._worker = WorkerThread[Task]("live")
        self._ending = self._worker.closing
        self.close = self._worker.close
        self._window = LiveWindow(round(WINDOW_S * OUTPUT_HZ))
        self._stream: Stream | None = None
        self._demodulator: LiveDemodulator | None = None
        self._rest: RestWatch | None = None
        self._at: int  # ring number of the next sample
        self._gaps_seen: int
        self._unwatched = False  # whether the curves were out of view at the last check
        self._problem: str | None = None
        self._most: int  # samples demodulated at a time
        self._signals_s: float
        self._disk_s = -np.inf
        self.skipped: int
        self.watched = True  # whether the curves are in view; otherwise signals are checked, but nothing is demodulated
        self.view = empty_view()
        self.channels: tuple[ChannelSignal, ...] = ()
        self.disk_free_bytes: int | None = None

    def start(self) -> None:
        self._worker.add(Task("live", lambda _, __: self._run()))
        self._worker.start()

    def _run(self) -> None:
        while not self._ending.is_set():
            begun = time.monotonic()
            try:
                self._look(begun)
            except Exception as error:  # a failure of the live curves must not end the capture
                self._problem = f"the live picture failed: {one_line(repr(error))}"
                self._demodulator = None
                self.view = self._window.view(np.empty(0), np.empty((0, 0), np.float32), self._problem, 0)
            every_s = _EVERY_S if self.watched else _UNWATCHED_EVERY_S
            # leaves the interpreter to the capture between checks, however long they take
            self._ending.wait(max(0.002, every_s - (time.monotonic() - begun)))

    def _look(self, now: float) -> None:
        if now - self._disk_s > _DISK_EVERY_S:
            self._disk_s = now
            self.disk_free_bytes = disk_free_bytes(self._folder())
        newest = self._newest()
        if newest is None:
            return
        if newest is not self._stream:
            self._begin(newest)
        if not self.watched:
            self._unwatched = True
        elif self._unwatched:
            self._unwatched = False
            self._skip_to(max(self._at, newest.ring.total - self._most // 4))
        if self.watched and self._follow(newest):
            self._draw(newest)
        if newest.ring.total - newest.start >= 64 and now - self._signals_s > 0.9 * _SIGNALS_EVERY_S:
            self._signals_s = now
            with contextlib.suppress(Overwritten):
                counts, _ = newest.newest(CHECKED_SAMPLES)
                self.channels = check_signals(
                    counts, newest.channels, newest.settings.sample_rate_hz, newest.setup.digitizer_bits
                )

    def _begin(self, stream: Stream) -> None:
        self._stream = stream
        self._signals_s = -np.inf
        self._at = stream.start
        self._gaps_seen = stream.start
        self._window.clear()
        self._problem = self._demodulator = None
        self.skipped = 0
        self._most = min(_CHUNK, stream.ring.capacity // 4)
        self._rest = None
        measurement = stream.column(Role.MEASUREMENT)
        try:
            if measurement is None:
                raise AnalysisError("no measurement channel (PD1)")
            self._demodulator = LiveDemodulator(
                stream.settings.sample_rate_hz, measurement, stream.column(Role.REFERENCE), stream.setup, OUTPUT_HZ
            )
        except AnalysisError as error:
            self._problem = str(error)

    def _follow(self, stream: Stream) -> bool:
        """Demodulate the new samples; return whether there were any."""
        ring = stream.ring
        moved = False
        while (waiting := ring.total - self._at) > 0 and not self._ending.is_set():
            if self._demodulator is None:
                self._at = ring.total
                return True
            if waiting > ring.capacity // 2:
                self._skip_to(ring.total - self._most)
            stop = min(ring.total, self._at + self._most)
            gap = next((g for g in stream.gaps if self._gaps_seen < g[0] <= stop), None)
            if gap is not None:
                stop = gap[0]
            try:
                self._feed(ring, stop - self._at)
            except Overwritten:
                self._skip_to(ring.total - self._most // 4)
                continue
            moved = True
            self._at = stop
            if gap is not None:
                self._gaps_seen = gap[0]
                self._demodulator.gap(gap[1])
        return moved

    def _feed(self, ring: Ring, length: int) -> None:
        """Demodulate the next ``length`` samples.  Raises Overwritten."""
        assert self._demodulator is not None and self._stream is not None
        if length == 0:
            return
        counts = np.empty((length, ring.channels), np.int16)
        ring.copy_into(self._at, counts)
        chunk = self._demodulator.feed(counts)
        self._problem = chunk.problem
        self._window.add(chunk)
        rate_hz = self._demodulator.rate_hz
        if self._rest is None and rate_hz is not None:
            self._rest = RestWatch(rate_hz, planned_shot(self._stream.settings))
        if self._rest is not None:
            self._rest.add(chunk)

    def _skip_to(self, sample: int) -> None:
        skipped = max(0, sample - self._at)
        self.skipped += skipped
        self._at += skipped
        self._gaps_seen = max(self._gaps_seen, self._at)
        if self._demodulator is not None and skipped:
            self._demodulator.gap(skipped)

    def _draw(self, stream: Stream) -> None:
        try:
            counts, first = stream.newest(RAW_SAMPLES)
        except Overwritten:
            return
        scale = np.array([c.volts_per_count for c in stream.channels], np.float32)
        offset = np.array([c.offset_v for c in stream.channels], np.float32)
        time_s = (first - stream.start + np.arange(len(counts))) / stream.settings.sample_rate_hz
        view = self._window.view(time_s, counts * scale + offset, self._problem, self.skipped)
        self.view = replace(view, floor=self._rest.floor if self._rest is not None else None)


def warm() -> None:
    """Compile or load the kernels of a running stream before its first samples."""
    rate = 1e6
    counts = np.resize(np.array([0, 951, 588, -588, -951], np.int16), (2, 8192)).T.copy()
    LightSwitch(TriggerSettings(), 0, 12).first_step(counts)
    MotionTrigger(0, 1, rate, DEFAULT_WAVELENGTH_AIR_M, 0.05).first_step(counts)
    live = LiveDemodulator(rate, 0, 1, Setup(0.01), OUTPUT_HZ)
    live.feed(counts)
    live.feed(counts)


class RestWatch:
    """Measures the motion of the site from a live curve of ``rate_hz`` while the block is at rest.

    ``floor`` is the newest result, None before the first one.
    """

    def __init__(self, rate_hz: float, planned: PlannedShot) -> None:
        self._rate_hz, self._planned = rate_hz / _AVERAGED, planned
        self._kept = np.empty(0)
        self._left = np.empty(0)
        self._due = 0
        self.floor: SiteFloor | None = None

    def add(self, chunk: LiveChunk) -> None:
        """Add a chunk's velocity; a motion or a gap discards what was collected, but not the last floor."""
        velocity = np.concatenate((self._left, chunk.velocity_m_per_s))
        whole = velocity.size - velocity.size % _AVERAGED
        self._left = velocity[whole:]
        means = velocity[:whole].reshape(-1, _AVERAGED).mean(axis=1)
        moved = np.flatnonzero(~(np.abs(means) < AT_REST_M_PER_S))
        if moved.size:
            self._kept = np.empty(0)
            means = means[moved[-1] + 1 :]
        self._due -= means.size
        self._kept = np.concatenate((self._kept, means))[-round(KEPT_S * self._rate_hz) :]
        if self._due <= 0 and self._kept.size >= MIN_S * self._rate_hz:
            self._due = min(round(EVERY_S * self._rate_hz), self._kept.size)
            self.floor = read_site(self._kept, self._rate_hz, self._planned)


def planned_shot(settings: CaptureSettings) -> PlannedShot:
    """Return the lengths of the two flights in a shot of these settings, at a usual speed."""
    usual = PlannedShot()
    before = settings.pre_trigger_samples / settings.sample_rate_hz + _SWITCH_S
    after = settings.samples / settings.sample_rate_hz - before - usual.contact_s
    least = 2e-3
    return PlannedShot(before_s=max(before, least), after_s=max(after, least))

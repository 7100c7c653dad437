"""The simulated rig as a digitizer, which can lose samples like a real one."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Setup
from instrument.bench.effects import parse
from instrument.bench.rig import Bench, SimulatedStream
from instrument.bench.site import QUIET, site_named
from instrument.devices import (
    Block,
    Capabilities,
    CaptureSettings,
    Digitizer,
    DigitizerError,
    SourceOptions,
    block_samples,
)

RATES_HZ = (10e6, 15e6, 20e6, 30e6)
_CHUNK = 200_000  # samples computed at a time
_SET_SPREAD = 0.02  # relative deviation of a push from the speed that was set
_LOWEST_HZ, _HIGHEST_HZ = 8e6, 60e6  # a lower rate does not resolve the beat of a fast block


class BenchDigitizer(Digitizer):
    """A stream of the simulated rig; the block is pushed after each ``arm`` and again every few seconds.

    If ``real_time``, samples arrive at the sample rate and are lost when more than ``memory_s`` of them are unread;
    otherwise they arrive as fast as they are read.  The counts depend only on the rig's seed, the settings and the
    number of earlier pushes.  ``stop`` may be called from any thread.
    """

    def __init__(
        self,
        rig: Bench | None = None,
        *,
        real_time: bool = True,
        memory_s: float = 0.5,
        first_push_s: float = 0.8,
        push_every_s: float = 3.0,
        clock: Callable[[], float] = time.monotonic,
        patient: bool = False,
        first_shot: int = 0,
    ) -> None:
        """With ``push_every_s`` 0 the block is never pushed; ``first_shot`` is the number of the first push.

        If ``patient``, a computer that is too slow makes the rig's clock slow down instead of losing samples.
        """
        self._patient = patient
        self._rig = rig or Bench()
        self._real_time = real_time
        self._memory_s = memory_s
        self._first_push_s, self._push_every_s = first_push_s, push_every_s
        self._clock = clock
        self._stop = threading.Event()
        self._closed = False
        self._stage: SimulatedStream | None = None
        self._shots = first_shot
        self._rate_hz: float  # this and the next three are set by ``arm``
        self._started: float
        self._next_sample: int
        self._next_push_s: float | None
        self._chunk = np.empty((_CHUNK, len(self._rig.optics.channels)), np.int16)
        self._chunk_at: int | None  # first sample of the kept chunk; None: no chunk is kept

    @property
    def capabilities(self) -> Capabilities:
        optics = self._rig.optics
        return Capabilities(
            name="Simulated bench",
            channels=optics.channels,
            bits=optics.bits,
            rates_hz=RATES_HZ,
            max_samples=None,
            hardware_trigger=False,
            real_time=self._real_time,
            simulated=True,
        )

    @property
    def setup(self) -> Setup:
        return self._rig.setup

    def prepare(self) -> None:
        """Compile or load the bench's kernels, so that the first push loses no samples."""
        rate_hz, *_ = RATES_HZ
        stage = SimulatedStream(self._rig, rate_hz)
        pushed = stage.push(self._first_push_s)
        stage.fill(round(pushed.release_s * rate_hz), self._chunk)

    def arm(self, settings: CaptureSettings) -> None:
        """Start a new stream, with the block held by the hand."""
        if self._closed:
            raise DigitizerError("the simulated bench was closed", "select the source again")
        rate = settings.sample_rate_hz
        if not _LOWEST_HZ <= rate <= _HIGHEST_HZ:
            raise DigitizerError(
                f"the simulated bench cannot sample at {rate / 1e6:g} MS/s",
                f"choose {_LOWEST_HZ / 1e6:g} to {_HIGHEST_HZ / 1e6:g} MS/s",
            )
        if settings.samples < 1 or not 0 <= settings.pre_trigger_samples <= settings.samples:
            raise DigitizerError("the pre-trigger part does not fit the shot", "choose fewer pre-trigger samples")
        if self._stage is not None:
            self._shots = self._stage.shots
        self._stage = SimulatedStream(self._rig, rate, self._shots)
        self._rate_hz = rate
        self._next_sample = 0
        self._chunk_at = None
        self._next_push_s = self._first_push_s if self._push_every_s > 0 else None
        self._stop.clear()
        self._started = self._clock()

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        channels = self._chunk.shape[1]
        if buffer.ndim != 2 or buffer.shape[1] != channels or buffer.dtype != np.int16:
            raise DigitizerError(f"a buffer of shape {buffer.shape}, {buffer.dtype} for {channels} channels of int16")
        if self._stage is None:
            raise DigitizerError("the simulated bench is not armed", "arm it first")
        wanted, lost = buffer.shape[0], 0
        if self._stop.is_set():
            return Block(0, ended=True)
        if self._real_time:
            # wait for a whole block, so that reading does not become a busy loop
            deadline = self._clock() + timeout_s
            least = min(wanted, block_samples(self._rate_hz))
            while (missing := least - self._waiting()) > 0:
                left = deadline - self._clock()
                if left <= 0.0:
                    break
                if self._stop.wait(min(left, (missing + 1) / self._rate_hz)):
                    return Block(0, ended=True)
            waiting = self._waiting()
            memory = int(self._memory_s * self._rate_hz)
            if waiting > memory:
                if self._patient:
                    self._started += (waiting - memory) / self._rate_hz
                else:
                    lost = waiting - memory
                    self._next_sample += lost
                waiting = memory
            wanted = min(wanted, waiting)
        return self._deliver(buffer, wanted, lost)

    def stop(self) -> None:
        self._stop.set()

    def close(self) -> None:
        self.stop()
        self._closed = True

    def _waiting(self) -> int:
        return int((self._clock() - self._started) * self._rate_hz) - self._next_sample

    def _deliver(self, buffer: NDArray[np.int16], wanted: int, lost: int) -> Block:
        done = 0
        while done < wanted and not self._stop.is_set():
            inside = self._next_sample % _CHUNK
            base = self._next_sample - inside
            if base != self._chunk_at:
                self._make(base, self._chunk)
                self._chunk_at = base
            n = min(wanted - done, _CHUNK - inside)
            buffer[done : done + n] = self._chunk[inside : inside + n]
            done += n
            self._next_sample += n
        return Block(done, lost_before=lost, ended=self._stop.is_set())

    def _make(self, base: int, out: NDArray[np.int16]) -> None:
        """Compute the samples from ``base`` on."""
        stage = self._stage
        assert stage is not None
        now_s = base / self._rate_hz
        ahead_s = now_s + 2 * _CHUNK / self._rate_hz  # so that a push starts in a chunk not yet computed
        if self._next_push_s is not None and ahead_s >= self._next_push_s:
            pushed = stage.push(max(self._next_push_s, now_s))
            self._next_push_s = pushed.end_s + self._push_every_s if self._push_every_s > 0 else None
        stage.fill(base, out)


def open_digitizer(_: str, options: SourceOptions) -> BenchDigitizer:
    """Open the simulated bench described by a source's options."""
    try:
        effects = parse(options.text("effect", "")) if "effect" in options else {}
    except ValueError as error:
        raise DigitizerError(f"source bench: {error}", "leave the effect out, or name one of these") from error
    try:
        site = site_named(options.text("site", QUIET.name))
    except ValueError as error:
        raise DigitizerError(f"source bench: {error}", "leave the site out, or name another") from error
    push: dict[str, Any] = {}
    if "speed" in options:
        push = {"velocity_m_per_s": options.number("speed", ""), "velocity_spread": _SET_SPREAD}
    if "added" in options:
        push["added_kg"] = options.number("added", "", "added mass")
    try:
        rig = Bench(effects=effects, site=site, seed=options.whole("seed", "1"), **push)
    except ValueError as error:
        raise DigitizerError(f"source bench: {error}", "set another speed or less weight") from error
    # patient: a simulated shot with gaps caused only by a busy computer would be useless
    return BenchDigitizer(rig, patient=True, first_shot=options.whole("first", "0", "first push"))

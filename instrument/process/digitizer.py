"""Any digitizer, living in a process of its own, behind the contract every digitizer honours.

The child has an interpreter of its own and a ring of a second or more: whatever the window or an analysis does, the
device is read in time.  Where the parent falls behind by the whole ring the child waits, the device's own memory
fills, and the device reports what it lost, which is recorded as a gap as anywhere else.
"""

import contextlib
import threading
import time
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Setup
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError
from instrument.devices.sources import open_source, source_of
from instrument.process.child import Opener, block_samples
from instrument.process.conversation import Conversation, error_of
from instrument.process.messages import Came
from instrument.process.shared_ring import SharedRing

HELD_S = 1.5  # of the stream, for a parent that stands still
MOST_RING_BYTES = 320 * 2**20
MOST_TRANSFER_BYTES = 32 * 2**20  # where the device keeps the shot and waits
ANSWERS_S = 5.0  # a driver that keeps the child longer than this does not answer
SIMULATES_S = 60.0  # and one that is simulated: longer than any computer is that busy
ARMS_S = 60.0  # to open or arm a device: firmware may have to be loaded
PREPARES_S = 300.0  # kernels may have to be compiled


def open_apart(source: str, *, setup: Setup | None = None, arms_s: float = ARMS_S) -> Digitizer:
    """Open the digitizer that ``source`` names, as ``open_source`` does, in a process of its own.

    A device that takes longer than ``arms_s`` to open, or to arm, does not answer; the bench takes what it needs.
    A recording played back is opened here: it waits for its reader, so there is nothing to lose.
    """
    kind = source_of(source)
    if not kind.apart:
        return open_source(source, setup=setup)
    patience_s = ARMS_S if kind.simulated else min(arms_s, ARMS_S)
    return DigitizerApart(partial(open_source, source, setup=setup), patience_s)


class DigitizerApart(Digitizer):
    """The parent's end.  ``opener`` opens the digitizer in the child and must be picklable (a function, a partial).

    A child that dies or hangs is told as a DigitizerError; the next ``arm`` starts another one.
    """

    def __init__(self, opener: Opener, arms_s: float = ARMS_S) -> None:
        """Start the child and open the digitizer in it.  Raises DigitizerError."""
        self._arms_s = arms_s
        self._opener = opener
        self._talk = threading.RLock()  # one talk at a time
        self._ring: SharedRing | None = None
        self._run: int | None = None
        self._came: Came | None = None  # begun and not yet taken whole
        self._taken = 0  # samples of it
        self._blocks = 0
        self._turns = 0
        self._turned_s = 0.0
        self._stopped = threading.Event()
        self._closed = False
        self._child = Conversation(opener, lambda: False, arms_s)

    @property
    def capabilities(self) -> Capabilities:
        """Get what the device can do, as it said last."""
        able = self._child.about.capabilities
        assert able is not None
        return able

    @property
    def setup(self) -> Setup:
        """Get what the device knows of the rig, as it said last."""
        setup = self._child.about.setup
        assert setup is not None
        return setup

    @property
    def child_id(self) -> int | None:
        """Get the child's process number, None where there is none."""
        return None if self._child.over else self._child.child_id

    def prepare(self) -> None:
        """Let the child do what takes long; a ``stop`` ends the waiting."""
        with self._talk:
            self._child.ask("prepare", PREPARES_S, give_up=self._stopped.is_set)

    def default_settings(self) -> CaptureSettings | None:
        """Return what the device is best given next."""
        with self._talk:
            if self._child.over:
                self._child = Conversation(self._opener, lambda: False, self._arms_s)
            answer = self._child.ask("defaults", self._arms_s)
        return answer.settings if answer is not None else None

    def arm(self, settings: CaptureSettings) -> None:
        """Start sampling, in a new child where the last one is gone.  Raises DigitizerError."""
        if self._closed:
            raise DigitizerError("the digitizer was closed", "select the source again")
        with self._talk:
            self._forget_stream()
            self._stopped.clear()
            give_up = self._stopped.is_set
            if self._child.over:
                self._forget_ring()
                self._child = Conversation(self._opener, give_up, self._arms_s)
                self._child.ask("prepare", PREPARES_S, give_up=give_up, patience_s=ANSWERS_S)
            ring = self._fitting_ring(settings)
            try:
                answer = self._child.ask("arm", self._arms_s, settings, ring, give_up=give_up, patience_s=ANSWERS_S)
            finally:
                if ring is not None and self._ring is not None:
                    self._ring.unlink()  # both have it, or neither will: it goes with them, however they end
            assert answer is not None
            self._run, self._blocks = answer.serial, answer.blocks
            self._turns, self._turned_s = -1, time.monotonic()

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill ``buffer`` with what the child has brought."""
        with self._talk:
            try:
                if self._came is None and not self._next(timeout_s):
                    return Block(0, ended=self._run is None)
            except DigitizerError:
                self._forget_stream()
                if self._child.over:
                    self._forget_ring()
                raise
            came, ring = self._came, self._ring
            assert came is not None and ring is not None
            if came.fault is not None:
                self._forget_stream()
                raise error_of(came.fault)
            return self._part(came, ring, buffer)

    def stop(self) -> None:
        """Stop sampling; from any thread."""
        self._stopped.set()
        with contextlib.suppress(DigitizerError):  # who reads or arms next says that it is gone
            self._child.send("stop")

    def close(self) -> None:
        """End the child."""
        self._closed = True
        self._stopped.set()
        with self._talk:
            with contextlib.suppress(DigitizerError):
                self._child.send("close")
            self._child.end()
            self._forget_stream()
            self._forget_ring()

    def _fitting_ring(self, settings: CaptureSettings) -> tuple[str, int, int] | None:
        """Return what the child attaches to, None where the present memory will do."""
        able = self.capabilities
        channels = len(able.channels)
        block = block_samples(settings.sample_rate_hz)
        most = (MOST_RING_BYTES if able.real_time else MOST_TRANSFER_BYTES) // (2 * channels)
        blocks = max(4, min(round(HELD_S * settings.sample_rate_hz), most) // block)
        present = self._ring
        if present is not None and (present.capacity, present.channels) == (blocks * block, channels):
            return None
        self._forget_ring()
        self._ring = SharedRing.create(blocks * block, channels)
        return self._ring.name, self._ring.capacity, channels

    # the stream ---------------------------------------------------------------------------------------------------

    def _next(self, timeout_s: float) -> bool:
        """Take the next block of this stream from the pipe, waiting at most ``timeout_s``; return whether one came."""
        end = time.monotonic() + timeout_s
        while self._run is not None:
            if self._stopped.is_set():
                self._forget_stream()
                break
            now = time.monotonic()
            message = self._child.hear(max(0.0, end - now))
            if isinstance(message, Came) and message.run == self._run:
                self._came, self._taken = message, 0
                return True
            if message is None and time.monotonic() >= end:
                self._look_for_life(now)
                break
        return False

    def _look_for_life(self, now: float) -> None:
        ring = self._ring
        assert ring is not None
        if ring.turns != self._turns:
            self._turns, self._turned_s = ring.turns, now
        elif now - self._turned_s > (SIMULATES_S if self.capabilities.simulated else ANSWERS_S):
            raise self._child.hangs()

    def _part(self, came: Came, ring: SharedRing, buffer: NDArray[np.int16]) -> Block:
        block, begun = came.block, self._taken
        length = min(block.samples - begun, buffer.shape[0])
        ring.copy_into(came.first + begun, buffer[:length])
        self._taken += length
        whole = self._taken == block.samples
        if whole:
            self._came = None
            self._blocks += 1
            if block.ended:
                self._run = None
        self._turned_s = time.monotonic()
        ring.give_free(came.first + self._taken, self._blocks)
        at = None if block.trigger_sample is None else block.trigger_sample - begun
        return Block(
            length,
            lost_before=block.lost_before if begun == 0 else 0,
            clipped=block.clipped if begun == 0 else (0,) * len(block.clipped),
            ended=whole and block.ended,
            trigger_sample=at if at is not None and 0 <= at < max(1, length) else None,
            fired=block.fired,
        )

    def _forget_stream(self) -> None:
        self._run = self._came = None
        self._taken = 0

    def _forget_ring(self) -> None:
        ring, self._ring = self._ring, None
        if ring is not None:
            ring.unlink()
            ring.close()

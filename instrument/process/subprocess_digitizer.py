"""A digitizer in a subprocess, behind the same contract as any digitizer.

The child process has its own interpreter and fills the ring a second or more ahead of its reader, so the device is read
in time even if the window or an analysis is busy.  If the parent lags by more, the child waits, the device's own memory
fills, and the device reports what it lost, which is recorded as a gap.
"""

import contextlib
import threading
import time
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Setup
from instrument.devices import (
    Block,
    Capabilities,
    CaptureSettings,
    Digitizer,
    DigitizerError,
    Ring,
    block_samples,
    open_source,
    source_of,
)
from instrument.process.child import BlockReady, Opener
from instrument.process.device_process import DeviceProcess
from instrument.process.shared_ring import SharedRing

AHEAD_S = 1.5  # of the stream that the child may be ahead of a slow parent
SIMULATED_AHEAD_S = 0.5  # the same for a simulated device, which waits and loses nothing
MAX_AHEAD_BYTES = 320 * 2**20
MAX_TRANSFER_BYTES = 32 * 2**20  # the same for a device that keeps the shot until it is read
ANSWER_S = 5.0  # a driver that blocks the child for longer does not answer
SIMULATED_ANSWER_S = 60.0  # the same for a simulated device, which a busy computer delays
ARM_S = 60.0  # to open or arm a device: firmware may have to be loaded
PREPARE_S = 300.0  # kernels may have to be compiled


def open_in_subprocess(source: str, *, arm_s: float = ARM_S) -> Digitizer:
    """Open the digitizer that ``source`` names, as ``open_source`` does, in a subprocess.

    A device that takes longer than ``arm_s`` to open or to arm does not answer; the bench may take longer.
    A replay is opened in this process, because it waits for its reader and loses nothing.
    """
    kind = source_of(source)
    if not kind.in_subprocess:
        return open_source(source)
    patience_s = ARM_S if kind.simulated else min(arm_s, ARM_S)
    return SubprocessDigitizer(partial(open_source, source), patience_s)


class SubprocessDigitizer(Digitizer):
    """The parent's end.  ``opener`` opens the digitizer in the child and must be picklable (a function, a partial).

    A child that dies or hangs raises a DigitizerError; the next ``arm`` starts another one.
    """

    def __init__(self, opener: Opener, arm_s: float = ARM_S) -> None:
        """Start the child and open the digitizer in it.  Raises DigitizerError."""
        self._arm_s = arm_s
        self._opener = opener
        self._exchange = threading.RLock()  # one request or read at a time
        self._ring: SharedRing | None = None
        self._attached: DeviceProcess | None = None  # the child that fills the ring
        self._run: int | None = None
        self._block: BlockReady | None = None  # partly read
        self._read_of_block: int  # samples already read
        self._blocks: int  # these three of the stream that was armed last
        self._beats: int | None  # None: not seen yet
        self._alive_s: float
        self._stopped = threading.Event()
        self._closed = False
        self._child = DeviceProcess(opener, lambda: False, arm_s)

    @property
    def capabilities(self) -> Capabilities:
        return self._child.device.capabilities

    @property
    def setup(self) -> Setup:
        return self._child.device.setup

    def prepare(self) -> None:
        """Prepare the device in the child; ``stop`` ends the waiting."""
        with self._exchange:
            self._child.answer_to(self._child.send("prepare"), PREPARE_S, self._stopped.is_set)

    def default_settings(self) -> CaptureSettings | None:
        with self._exchange:
            if self._child.over:
                self._child = DeviceProcess(self._opener, lambda: False, self._arm_s)
            answer = self._child.answer_to(self._child.send("defaults"), self._arm_s)
        return answer.settings if answer is not None else None

    def arm(self, settings: CaptureSettings) -> None:
        """Start sampling, in a new child if the last one is gone.  Raises DigitizerError."""
        if self._closed:
            raise DigitizerError("the digitizer was closed", "select the source again")
        with self._exchange:
            self._forget_stream()
            self._stopped.clear()
            give_up = self._stopped.is_set
            if self._child.over:
                self._child = DeviceProcess(self._opener, give_up, self._arm_s)
                self._child.answer_to(self._child.send("prepare"), PREPARE_S, give_up, ANSWER_S)
            ring = self._ring_for(settings)
            where, self._attached = None if self._attached is self._child else ring.key, self._child
            try:
                order = self._child.send("arm", settings, where, ring.total)
                answer = self._child.answer_to(order, self._arm_s, give_up, ANSWER_S)
            finally:
                ring.unlink()  # both processes have attached it, or never will: it is freed when they end
            assert answer is not None and answer.blocks is not None
            self._run, self._blocks = answer.serial, answer.blocks
            self._beats, self._alive_s = None, time.monotonic()

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        with self._exchange:
            try:
                if self._block is None and not self._next_block(timeout_s):
                    return Block(0, ended=self._run is None)
            except DigitizerError:
                self._forget_stream()
                if self._child.over:
                    self._forget_ring()
                raise
            ready, ring = self._block, self._ring
            assert ready is not None and ring is not None
            if ready.fault is not None:
                self._forget_stream()
                raise ready.fault
            return self._part(ready, ring, buffer)

    def stop(self) -> None:
        self._stopped.set()
        with contextlib.suppress(DigitizerError):  # the next read or arm reports that the child is gone
            self._child.send("stop")

    def close(self) -> None:
        self._closed = True
        self._stopped.set()
        with self._exchange:
            with contextlib.suppress(DigitizerError):
                self._child.send("close")
            self._child.end()
            self._forget_stream()
            self._forget_ring()

    def ring(self, capacity: int, settings: CaptureSettings, present: Ring | None) -> Ring:
        """Return the ring that the child fills: what is read into its ``space`` is not copied."""
        with self._exchange:
            return self._ring_for(settings, capacity)

    def _ring_for(self, settings: CaptureSettings, capacity: int | None = None) -> SharedRing:
        """Return the present ring where it suits, else a new one, which the child must attach.

        ``capacity`` None: any, for a reader with a buffer of its own.
        """
        able, block = self.capabilities, block_samples(settings.sample_rate_hz)
        channels = len(able.channels)
        most = (MAX_AHEAD_BYTES if able.real_time else MAX_TRANSFER_BYTES) // (2 * channels)
        lag_s = SIMULATED_AHEAD_S if able.simulated else AHEAD_S
        ahead = block * max(4, min(round(lag_s * settings.sample_rate_hz), most) // block)
        present = self._ring
        if (
            present is not None
            and (self._attached is None or (self._attached is self._child and not self._child.over))
            and (present.channels, present.ahead) == (channels, ahead)
            and (capacity is None or present.suits(capacity, channels))
        ):
            return present
        self._forget_ring()
        self._ring = SharedRing.create(capacity or 0, channels, ahead)
        return self._ring

    # the stream ---------------------------------------------------------------------------------------------------

    def _next_block(self, timeout_s: float) -> bool:
        """Receive the next block of this stream, waiting at most ``timeout_s``; return whether one came."""
        end = time.monotonic() + timeout_s
        while self._run is not None:
            if self._stopped.is_set():
                self._forget_stream()
                break
            now = time.monotonic()
            message = self._child.receive(max(0.0, end - now))
            if isinstance(message, BlockReady) and message.run == self._run:
                self._block, self._read_of_block = message, 0
                return True
            if message is None and time.monotonic() >= end:
                self._check_alive(now)
                break
        return False

    def _check_alive(self, now: float) -> None:
        ring = self._ring
        assert ring is not None
        if ring.beats != self._beats:
            self._beats, self._alive_s = ring.beats, now
        elif now - self._alive_s > (SIMULATED_ANSWER_S if self.capabilities.simulated else ANSWER_S):
            raise self._child.end_silent()

    def _part(self, ready: BlockReady, ring: SharedRing, buffer: NDArray[np.int16]) -> Block:
        """Copy as much of a block as ``buffer`` holds."""
        block, begun = ready.block, self._read_of_block
        length = min(block.samples - begun, buffer.shape[0])
        ring.fetch(ready.first + begun, buffer[:length])
        self._read_of_block += length
        whole = self._read_of_block == block.samples
        if whole:
            self._block = None
            self._blocks += 1
            if block.ended:
                self._run = None
        self._alive_s = time.monotonic()
        ring.mark_read(ready.first + self._read_of_block, self._blocks)
        at = None if block.trigger_sample is None else block.trigger_sample - begun
        return Block(
            length,
            lost_before=block.lost_before if begun == 0 else 0,
            ended=whole and block.ended,
            trigger_sample=at if at is not None and 0 <= at < max(1, length) else None,
            fired=block.fired,
        )

    def _forget_stream(self) -> None:
        self._run = self._block = None

    def _forget_ring(self) -> None:
        """Free the ring's memory as soon as no reader has the ring any more."""
        ring, self._ring, self._attached = self._ring, None, None
        if ring is not None:
            ring.unlink()

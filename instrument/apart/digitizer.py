"""Any digitizer, living in a process of its own, behind the contract every digitizer honours.

The child has an interpreter of its own and a ring of a second or more: whatever the window or an analysis does, the
device is read in time.  Where the parent falls behind by the whole ring the child waits, the device's own memory
fills, and the device reports what it lost, which is recorded as a gap as anywhere else.
"""

import contextlib
import multiprocessing
import threading
import time
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

import numpy as np
from numpy.typing import NDArray

from analysis.recording import Setup
from instrument.apart.child import OPENED, Opener, block_samples, serve
from instrument.apart.messages import About, Answer, Came, Fault, Order
from instrument.apart.shared_ring import SharedRing
from instrument.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError
from instrument.sources import open_source

HELD_S = 1.5  # of the stream, for a parent that stands still
MOST_RING_BYTES = 320 * 2**20
MOST_TRANSFER_BYTES = 32 * 2**20  # where the device keeps the shot and waits
ANSWERS_S = 5.0  # a driver that keeps the child longer than this does not answer
SIMULATES_S = 60.0  # and one that is simulated: longer than any computer is that busy
OPENS_S = ARMS_S = 60.0  # firmware may have to be loaded
PREPARES_S = 300.0  # kernels may have to be compiled
_LOOK_S = 0.1
_ENDS_S = 8.0


def open_apart(source: str, *, setup: Setup | None = None) -> Digitizer:
    """Open the digitizer that ``source`` names, as ``open_source`` does, in a process of its own.

    A recording played back is opened here: it waits for its reader, so there is nothing to lose.
    """
    if source.strip().lower().startswith("replay"):
        return open_source(source, setup=setup)
    return DigitizerApart(partial(open_source, source, setup=setup))


class DigitizerApart(Digitizer):
    """The parent's end.  ``opener`` opens the digitizer in the child and must be picklable (a function, a partial).

    A child that dies or hangs is told as a DigitizerError; the next ``arm`` starts another one.
    """

    def __init__(self, opener: Opener) -> None:
        """Start the child and open the digitizer in it.  Raises DigitizerError."""
        self._opener = opener
        self._arming = False
        self._talk = threading.RLock()  # one conversation at a time
        self._sending = threading.Lock()
        self._process: SpawnProcess | None = None
        self._orders: Connection | None = None
        self._answers: Connection | None = None
        self._about: About | None = None
        self._ring: SharedRing | None = None
        self._serial = OPENED
        self._run: int | None = None
        self._came: Came | None = None  # begun and not yet taken whole
        self._taken = 0  # samples of it
        self._at = self._blocks = 0
        self._turns = 0
        self._turned_s = 0.0
        self._stopped = threading.Event()
        self._closed = False
        self._start()

    @property
    def capabilities(self) -> Capabilities:
        """Get what the device can do, as it said last."""
        about = self._known()
        assert about.capabilities is not None
        return about.capabilities

    @property
    def setup(self) -> Setup:
        """Get what the device knows of the rig, as it said last."""
        about = self._known()
        assert about.setup is not None
        return about.setup

    @property
    def child_id(self) -> int | None:
        """Get the child's process number, None where there is none."""
        return self._process.pid if self._process is not None else None

    def prepare(self) -> None:
        """Let the child do what takes long; a ``stop`` ends the waiting."""
        with self._talk:
            self._ask("prepare", PREPARES_S, until_stopped=True)

    def default_settings(self) -> CaptureSettings | None:
        """Return what the device is best given next."""
        with self._talk:
            if self._process is None:
                self._start()
            answer = self._ask("defaults", ARMS_S)
        return answer.settings if answer is not None else None

    def arm(self, settings: CaptureSettings) -> None:
        """Start sampling, in a new child where the last one is gone.  Raises DigitizerError."""
        if self._closed:
            raise DigitizerError("the digitizer was closed", "select the source again")
        with self._talk:
            self._forget_stream()
            self._stopped.clear()
            self._arming = True
            try:
                if self._process is None:
                    self._start()
                    self._ask("prepare", PREPARES_S)
                ring = self._fitting_ring(settings)
                answer = self._ask("arm", ARMS_S, settings, ring)
            finally:
                self._arming = False
            assert answer is not None and self._ring is not None
            if ring is not None:
                self._ring.unlink()  # both have it: it goes with them, however they end
            self._run, self._at, self._blocks = answer.serial, answer.first, answer.blocks
            self._turns, self._turned_s = -1, time.monotonic()

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill ``buffer`` with what the child has brought."""
        with self._talk:
            if self._came is None and not self._next(timeout_s):
                return Block(0, ended=self._run is None)
            came, ring = self._came, self._ring
            assert came is not None and ring is not None
            if came.fault is not None:
                self._forget_stream()
                raise _error(came.fault)
            return self._part(came, ring, buffer)

    def stop(self) -> None:
        """Stop sampling; from any thread."""
        self._stopped.set()
        with contextlib.suppress(DigitizerError):  # who reads or arms next says that it is gone
            self._send("stop")

    def close(self) -> None:
        """End the child."""
        self._closed = True
        self._stopped.set()
        with self._talk:
            with contextlib.suppress(DigitizerError):
                self._send("close")
            self._end(_ENDS_S)

    # the child ----------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        theirs, orders = context.Pipe(duplex=False)
        answers, said = context.Pipe(duplex=False)
        process = context.Process(
            target=serve, args=(self._opener, theirs, said), name="levimass digitizer", daemon=True
        )
        self._serial = OPENED
        try:
            process.start()
        except (OSError, ValueError) as error:
            raise DigitizerError(f"the digitizer's process did not start: {error}", "close other programs") from error
        theirs.close()  # with the child's copies alone, its end is seen as the pipe's
        said.close()
        self._process, self._orders, self._answers = process, orders, answers
        answer = self._wait_for(OPENED, OPENS_S)
        assert answer is not None
        if answer.fault is not None:
            self._end(_ENDS_S)
            raise _error(answer.fault)

    def _end(self, patience_s: float) -> int | None:
        """End the child, by force where it takes longer, and return its exit code."""
        process, self._process = self._process, None
        code = None
        if process is not None:
            process.join(patience_s)
            if process.is_alive():
                process.kill()
                process.join(_ENDS_S)
            code = process.exitcode
            process.close()
        with self._sending:
            for pipe in (self._orders, self._answers):
                if pipe is not None:
                    pipe.close()
            self._orders = self._answers = None
        self._forget_stream()
        ring, self._ring = self._ring, None
        if ring is not None:
            ring.unlink()
            ring.close()
        return code

    def _died(self) -> DigitizerError:
        code = self._end(1.0)
        how = f"killed by signal {-code}" if code is not None and code < 0 else f"status {code}"
        return DigitizerError(f"the digitizer's process ended by itself ({how})", "arm again: it is started anew")

    def _hangs(self) -> DigitizerError:
        self._end(0.0)
        return DigitizerError("the digitizer does not answer", "arm again; if it stays silent, re-plug it first")

    def _given_up(self) -> DigitizerError:
        self._end(0.0)
        return DigitizerError("the arming was given up", "arm again: the digitizer's process is started anew")

    def _fitting_ring(self, settings: CaptureSettings) -> tuple[str, int, int] | None:
        """Return what the child attaches to, None where the present memory will do."""
        able = self.capabilities
        channels = len(able.channels)
        block = block_samples(settings.sample_rate_hz)
        most = (MOST_RING_BYTES if able.real_time else MOST_TRANSFER_BYTES) // (2 * channels)
        blocks = max(4, min(round(HELD_S * settings.sample_rate_hz), most) // block)
        present = self._ring
        if present is not None:
            if (present.capacity, present.channels) == (blocks * block, channels):
                return None
            self._ring = None
            present.close()
        self._ring = SharedRing.create(blocks * block, channels)
        return self._ring.name, self._ring.capacity, channels

    # the conversation ---------------------------------------------------------------------------------------------

    def _send(
        self, kind: str, settings: CaptureSettings | None = None, ring: tuple[str, int, int] | None = None
    ) -> int:
        with self._sending:
            if self._orders is None:
                raise DigitizerError("the digitizer's process is gone", "arm again: it is started anew")
            self._serial += 1
            try:
                self._orders.send(Order(kind, self._serial, settings, ring))
            except OSError as error:
                raise DigitizerError("the digitizer's process is gone", "arm again: it is started anew") from error
            return self._serial

    def _ask(
        self,
        kind: str,
        limit_s: float,
        settings: CaptureSettings | None = None,
        ring: tuple[str, int, int] | None = None,
        *,
        until_stopped: bool = False,
    ) -> Answer | None:
        answer = self._wait_for(self._send(kind, settings, ring), limit_s, until_stopped=until_stopped)
        if answer is not None and answer.fault is not None:
            raise _error(answer.fault)
        return answer

    def _wait_for(self, serial: int, limit_s: float, *, until_stopped: bool = False) -> Answer | None:
        end = time.monotonic() + limit_s
        given_up = False
        while not (until_stopped and self._stopped.is_set()):
            message = self._hear(min(_LOOK_S, limit_s))
            if self._arming and self._stopped.is_set() and not given_up:
                given_up, end = True, min(end, time.monotonic() + ANSWERS_S)  # whoever closes does not wait for it
            if isinstance(message, Answer):
                self._about = message.about or self._about
                if message.serial == serial:
                    return message
            elif time.monotonic() > end:
                raise self._given_up() if given_up else self._hangs()
        return None

    def _hear(self, timeout_s: float) -> Answer | Came | None:
        answers = self._answers
        if answers is None:
            raise DigitizerError("the digitizer's process is gone", "arm again: it is started anew")
        try:
            if not answers.poll(timeout_s):
                return None
            message: Answer | Came = answers.recv()
            return message
        except (EOFError, OSError):
            raise self._died() from None

    def _known(self) -> About:
        about = self._about
        assert about is not None
        if about.fault is not None:
            raise _error(about.fault)
        return about

    # the stream ---------------------------------------------------------------------------------------------------

    def _next(self, timeout_s: float) -> bool:
        """Take the next block of this stream from the pipe, waiting at most ``timeout_s``; return whether one came."""
        end = time.monotonic() + timeout_s
        while self._run is not None:
            if self._stopped.is_set():
                self._forget_stream()
                break
            now = time.monotonic()
            message = self._hear(max(0.0, end - now))
            if isinstance(message, Answer):
                self._about = message.about or self._about
            elif message is not None and message.run == self._run:
                self._about = message.about or self._about
                self._came, self._taken = message, 0
                return True
            elif message is None and time.monotonic() >= end:
                self._look_for_life(now)
                break
        return False

    def _look_for_life(self, now: float) -> None:
        ring = self._ring
        assert ring is not None
        if ring.turns != self._turns:
            self._turns, self._turned_s = ring.turns, now
        elif now - self._turned_s > (SIMULATES_S if self.capabilities.simulated else ANSWERS_S):
            raise self._hangs()

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
        )

    def _forget_stream(self) -> None:
        self._run = self._came = None
        self._taken = 0


def _error(fault: Fault) -> DigitizerError:
    return DigitizerError(fault.what, fault.remedy)

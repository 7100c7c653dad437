"""The child process of a device: opens the digitizer, fills the shared ring, executes orders, ends with its parent.

Also the messages between both processes: orders to the child, answers and blocks to the parent.
"""

import contextlib
import gc
import os
import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from analysis.shot import Setup
from instrument.background import lower_priority, start_thread
from instrument.devices import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError, block_samples
from instrument.files import one_line
from instrument.process.shared_ring import RingKey, SharedRing

Opener = Callable[[], Digitizer]

STARTED, OPENED = range(2)  # serial numbers of the two answers without an order; the orders follow
READ_TIMEOUT_S = 0.05
_END_S = 3.0  # a driver that blocks for longer after the parent's end is abandoned
_RING_FULL_S = 0.002


@dataclass(frozen=True, slots=True)
class Order:
    """A request to the device's process; ``serial`` numbers the orders of one process."""

    kind: str  # prepare, defaults, arm, stop, close
    serial: int
    settings: CaptureSettings | None = None
    ring: RingKey | None = None  # of a new ring
    at: int = 0  # number of the stream's first sample in the ring


@dataclass(frozen=True, slots=True)
class DeviceState:
    """Capabilities and setup of the device."""

    capabilities: Capabilities
    setup: Setup


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to the order ``serial``; ``blocks`` is the number of blocks announced so far."""

    serial: int
    device: DeviceState | DigitizerError | None  # an error: the state cannot be read
    fault: DigitizerError | None = None
    settings: CaptureSettings | None = None
    blocks: int | None = None  # of an order


@dataclass(frozen=True, slots=True)
class BlockReady:
    """A block in the ring, or a fault in its place, of the stream that the order ``run`` began."""

    run: int
    first: int
    block: Block
    fault: DigitizerError | None = None
    device: DeviceState | DigitizerError | None = None  # at a stream's end: the next shot may have others


# how many announced blocks may be unread: the capacity of the pipe, on Linux 64 KiB, on macOS 16, on Windows 8
MAX_BLOCKS_LINUX, MAX_BLOCKS_ELSEWHERE = 200, 40
MAX_BLOCKS = MAX_BLOCKS_LINUX if sys.platform == "linux" else MAX_BLOCKS_ELSEWHERE


def serve(opener: Opener, orders: Connection, answers: Connection) -> None:
    """Open the digitizer and serve it until ``close`` or the parent's end; the main function of the process."""
    with contextlib.suppress(ConnectionError):
        answers.send(Answer(STARTED, None))
    try:
        digitizer = opener()
    except Exception as error:
        with contextlib.suppress(ConnectionError):  # the parent is gone
            answers.send(Answer(OPENED, None, _fault_of(error)))
        return
    _Child(digitizer, orders, answers).work()


class _Child:
    """Two threads: one receives orders, so that ``stop`` reaches a reading driver; the other does all other work."""

    def __init__(self, digitizer: Digitizer, orders: Connection, answers: Connection) -> None:
        self._digitizer = digitizer
        self._orders = orders
        self._answers = answers
        self._received: queue.SimpleQueue[Order | None] = queue.SimpleQueue()  # None: the parent is gone
        self._stopped = OPENED  # serial of the last stop
        self._ending = threading.Event()
        self._ring: SharedRing | None = None
        self._run: int | None = None  # serial of the order that began the stream
        self._at: int  # number of the next sample, from the arming on
        self._blocks = 0
        self._length: int  # of a block, from the arming on

    def work(self) -> None:
        start_thread("orders", self._receive_orders)
        status = 0
        try:
            device = self._device_state()
            if isinstance(device, DeviceState) and device.capabilities.simulated:
                lower_priority(5)  # a simulated device must not slow the screen; a real one needs little processor time
            self._answers.send(Answer(OPENED, device))
            while not self._ending.is_set():
                self._turn()
        except ConnectionError:
            status = 1  # the parent is gone
        except Exception:
            traceback.print_exc()
            status = 2
        with contextlib.suppress(Exception):
            self._digitizer.close()
        os._exit(status)  # a driver's thread must not keep the process and the shared memory alive

    def _receive_orders(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while not self._ending.is_set():
                order: Order = self._orders.recv()
                if order.kind in ("stop", "close"):
                    self._stopped = order.serial
                    with contextlib.suppress(Exception):  # an unplugged device cannot even be stopped
                        self._digitizer.stop()
                self._received.put(order)
                if order.kind == "close":
                    break
        self._ending.set()
        self._received.put(None)
        with contextlib.suppress(Exception):
            self._digitizer.stop()
        time.sleep(_END_S)
        os._exit(1)

    def _turn(self) -> None:
        try:
            order = self._received.get_nowait() if self._run is not None else self._received.get()
        except queue.Empty:
            self._read()
            return
        if order is not None and order.kind not in ("stop", "close"):
            self._carry_out(order)

    def _carry_out(self, order: Order) -> None:
        settings: CaptureSettings | None = None
        fault = None
        try:
            if order.kind == "prepare":
                self._digitizer.prepare()
                gc.freeze()  # objects loaded so far are never freed: the garbage collector skips them
            elif order.kind == "defaults":
                settings = self._digitizer.default_settings()
            elif order.kind == "arm":
                self._arm(order)
        except Exception as error:
            fault = _fault_of(error)
        self._answers.send(Answer(order.serial, self._device_state(), fault, settings, self._blocks))

    def _arm(self, order: Order) -> None:
        assert order.settings is not None
        self._run = None
        if order.ring is not None:
            if self._ring is not None:
                self._ring.close()
            self._ring = SharedRing.attach(*order.ring)
            self._blocks = 0
        ring, self._at = self._ring, order.at
        assert ring is not None
        ring.mark_read(self._at, self._blocks)  # the rest of the previous stream is never read
        gc.collect()  # now, when no message waits
        self._length = min(block_samples(order.settings.sample_rate_hz), ring.ahead)
        self._digitizer.arm(order.settings)
        self._run = order.serial
        if self._stopped > order.serial:
            self._digitizer.stop()  # the order to stop came during arming

    def _read(self) -> None:
        ring, run = self._ring, self._run
        assert ring is not None and run is not None
        ring.beat()
        view = ring.view(self._at, self._length)
        if ring.room(self._at) < view.shape[0] or self._blocks - ring.blocks_read >= MAX_BLOCKS:
            # the parent lags by a whole ring: the device's own memory fills, and the device reports its losses,
            # as for any slow reader
            time.sleep(_RING_FULL_S)
            if self._stopped > run:
                self._run = None
            return
        try:
            block = self._digitizer.read_into(view, READ_TIMEOUT_S)
            if not 0 <= block.samples <= view.shape[0]:
                raise DigitizerError("the digitizer sent nonsense", "stop it, re-plug it, and report this")
        except Exception as error:
            self._run = None
            self._answers.send(BlockReady(run, self._at, Block(0, ended=True), _fault_of(error)))
            return
        if block.samples == 0 and not block.ended and not block.fired:
            return
        ended = block.ended or self._stopped > run
        if ended:
            self._run = None
        self._answers.send(BlockReady(run, self._at, block, device=self._device_state() if ended else None))
        self._at += block.samples
        self._blocks += 1

    def _device_state(self) -> DeviceState | DigitizerError:
        try:
            return DeviceState(self._digitizer.capabilities, self._digitizer.setup)
        except Exception as error:
            return _fault_of(error)


def _fault_of(error: Exception) -> DigitizerError:
    if isinstance(error, DigitizerError):
        return error
    return DigitizerError(f"unexpected: {one_line(repr(error))}", "arm again; report this if it happens again")

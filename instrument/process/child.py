"""The child process: it owns the device, fills the shared ring and does what it is told; it ends with its parent."""

import contextlib
import gc
import os
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection

from instrument.devices.digitizer import Block, CaptureSettings, Digitizer, DigitizerError
from instrument.files.recording_error import one_line
from instrument.process.messages import About, Answer, Came, Fault, Order, give_way
from instrument.process.shared_ring import SharedRing

Opener = Callable[[], Digitizer]

STARTED, OPENED = -1, 0  # the serial numbers of the answers to being started
READ_TIMEOUT_S = 0.05
_ENDS_S = 3.0  # a driver that keeps the process longer than this after its parent's end is left behind
_FULL_S = 0.002


def most_blocks(system: str) -> int:
    """Return how many blocks may be announced and not taken on a system (``sys.platform``): what its pipe holds."""
    return 200 if system == "linux" else 40  # Windows: 8 KiB, macOS: 16, Linux: 64


MOST_BLOCKS = most_blocks(sys.platform)


def block_samples(sample_rate_hz: float) -> int:
    """Return how many samples a channel are read at a time: 10 ms of them."""
    return max(256, min(1 << 18, int(0.01 * sample_rate_hz)))


def serve(opener: Opener, orders: Connection, answers: Connection) -> None:
    """Open the digitizer and serve it until ``close`` or the parent's end; the whole life of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches the whole group: the parent ends in good order
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
    """Two threads: one hears orders, so that a ``stop`` reaches a driver that is reading; the other does the rest."""

    def __init__(self, digitizer: Digitizer, orders: Connection, answers: Connection) -> None:
        self._digitizer = digitizer
        self._orders = orders
        self._answers = answers
        self._heard: queue.SimpleQueue[Order | None] = queue.SimpleQueue()  # None: the parent is gone
        self._stopped = 0  # serial of the last stop
        self._ending = threading.Event()
        self._ring: SharedRing | None = None
        self._run: int | None = None  # serial of the order that began the stream
        self._at = 0
        self._blocks = 0
        self._length = 0

    def work(self) -> None:
        """Do what is ordered, until the end."""
        threading.Thread(target=self._hear, name="orders", daemon=True).start()
        status = 0
        try:
            about = self._about()
            if about.capabilities is not None and about.capabilities.simulated:
                give_way(5)  # a real device computes elsewhere: its twin gives way to the screen
            self._answers.send(Answer(OPENED, about))
            while not self._ending.is_set():
                self._turn()
        except ConnectionError:
            status = 1  # the parent is gone
        except Exception:
            traceback.print_exc()
            status = 2
        with contextlib.suppress(Exception):
            self._digitizer.close()
        os._exit(status)  # no thread of a driver may keep the process, and the memory it shares, any longer

    def _hear(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while not self._ending.is_set():
                order: Order = self._orders.recv()
                if order.kind in ("stop", "close"):
                    self._stopped = order.serial
                    with contextlib.suppress(Exception):  # an unplugged device cannot even be stopped
                        self._digitizer.stop()
                self._heard.put(order)
                if order.kind == "close":
                    break
        self._ending.set()
        self._heard.put(None)
        with contextlib.suppress(Exception):
            self._digitizer.stop()
        time.sleep(_ENDS_S)
        os._exit(1)

    def _turn(self) -> None:
        try:
            order = self._heard.get_nowait() if self._run is not None else self._heard.get()
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
                gc.freeze()  # what is loaded by now stays to the end: looking through it for garbage only takes time
            elif order.kind == "defaults":
                settings = self._digitizer.default_settings()
            elif order.kind == "arm":
                self._arm(order)
        except Exception as error:
            fault = _fault_of(error)
        self._answers.send(Answer(order.serial, self._about(), fault, settings, self._at, self._blocks))

    def _arm(self, order: Order) -> None:
        assert order.settings is not None
        self._run = None
        if order.ring is not None:
            if self._ring is not None:
                self._ring.close()
            self._ring = SharedRing.attach(*order.ring)
            self._at = self._blocks = 0
        ring = self._ring
        assert ring is not None
        ring.give_free(self._at, self._blocks)  # what is left of the stream before is nobody's
        gc.collect()  # now, when nothing waits for it
        self._length = min(block_samples(order.settings.sample_rate_hz), ring.capacity)
        self._digitizer.arm(order.settings)
        self._run = order.serial
        if self._stopped > order.serial:
            self._digitizer.stop()  # it came while the device was being armed

    def _read(self) -> None:
        ring, run = self._ring, self._run
        assert ring is not None and run is not None
        ring.turn()
        view = ring.view(self._at, self._length)
        if ring.room(self._at) < view.shape[0] or self._blocks - ring.blocks_taken >= MOST_BLOCKS:
            # the parent lags by a whole ring: from here on the device's own memory fills, and the device says when
            # it lost something, as it does where nobody reads it in time
            time.sleep(_FULL_S)
            if self._stopped > run:
                self._run = None
            return
        try:
            block = self._digitizer.read_into(view, READ_TIMEOUT_S)
            if not 0 <= block.samples <= view.shape[0]:
                raise DigitizerError("the digitizer sent nonsense", "stop it, re-plug it, and report this")
        except Exception as error:
            self._run = None
            self._answers.send(Came(run, self._at, Block(0, ended=True), _fault_of(error)))
            return
        if block.samples == 0 and not block.ended and not block.fired:
            return
        ended = block.ended or self._stopped > run
        if ended:
            self._run = None
        self._answers.send(Came(run, self._at, block, about=self._about() if ended else None))
        self._at += block.samples
        self._blocks += 1

    def _about(self) -> About:
        try:
            setup = self._digitizer.setup
            return About(self._digitizer.capabilities, replace(setup, extra=dict(setup.extra)))  # a view cannot travel
        except Exception as error:
            return About(None, None, _fault_of(error))


def _fault_of(error: Exception) -> Fault:
    if isinstance(error, DigitizerError):
        return Fault(error.what, error.remedy)
    return Fault(f"unexpected: {one_line(repr(error))}", "arm again; report this if it happens again")

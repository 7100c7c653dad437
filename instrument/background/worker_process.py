"""A worker process: spawned, reached by messages, noticed when it dies, and ended by force if it does not end."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from multiprocessing.connection import _ConnectionBase as Connection  # a pipe's end is another class on Windows
from multiprocessing.reduction import ForkingPickler
from types import MappingProxyType
from typing import Any

END_S = 5.0  # after a kill
_DIES_S = 1.0  # between the end of the pipe and that of the process
_BELOW_NORMAL = 0x4000  # BELOW_NORMAL_PRIORITY_CLASS of SetPriorityClass


def _read_only(values: dict[Any, Any]) -> Mapping[Any, Any]:
    return MappingProxyType(values)


# a mapping view's class cannot be pickled by name, so a function rebuilds the view in the other process
ForkingPickler.register(MappingProxyType, lambda view: (_read_only, (dict(view),)))


class ProcessEnded(Exception):
    """The process has ended; the message says how."""


class WorkerProcess:
    """One process, from its start to its end; it ends with this program.

    ``main(*args, orders, messages)`` runs in it: it receives what ``send`` sends, and sends what ``receive`` returns.
    A closed ``orders`` tells it to end.
    """

    def __init__(self, name: str, main: Callable[..., object], *args: object) -> None:
        """Start the process; returns at once.  ``main`` and ``args`` must be picklable.  Raises OSError."""
        context = multiprocessing.get_context("spawn")  # a fork of a program with threads and kernels may hang
        (orders, self._orders), (self.messages, messages) = (context.Pipe(duplex=False) for _ in range(2))
        ends = main, args, orders, messages
        self._process = context.Process(target=_run, args=ends, name=f"levimass {name}")
        self._process.daemon = True
        self._sending, self._ending = threading.Lock(), threading.Lock()
        self._exit_code: int | None = None
        self.over = False
        with _ctrl_c_blocked():
            self._process.start()
        orders.close()  # now only the child holds these ends, so its end closes the pipes
        messages.close()

    @property
    def exit_code(self) -> int | None:
        """Get the exit code, negative for a signal; None while the process runs."""
        return self._exit_code if self.over else self._process.exitcode

    def send(self, message: object) -> None:
        """Send a message; from any thread.  Raises ProcessEnded."""
        with self._sending:
            try:
                self._orders.send(message)
            except OSError as error:
                raise ProcessEnded(str(error)) from error

    def receive(self, timeout_s: float) -> Any:
        """Return the next message, None if none comes in time.  Raises ProcessEnded, after ending what is left."""
        try:
            return self.messages.recv() if self.messages.poll(timeout_s) else None
        except (EOFError, OSError):
            self.end(_DIES_S)
            code = self._exit_code
            how = f"killed by signal {-code}" if code is not None and code < 0 else f"status {code}"
            raise ProcessEnded(how) from None

    def end(self, patience_s: float) -> None:
        """Tell the process to end and wait, killing it after ``patience_s``; harmless when it has ended."""
        if not self._ending.acquire(blocking=False):
            return
        self._close_orders(patience_s)
        process = self._process
        process.join(patience_s)
        if process.is_alive():
            process.kill()
            process.join(END_S)
        self._exit_code, self.over = process.exitcode, True
        process.close()
        self._close_orders(END_S)
        self.messages.close()

    def _close_orders(self, patience_s: float) -> None:
        """Close the pipe to the process, unless a message is being sent, which may block until the process ends."""
        if self._sending.acquire(timeout=patience_s):
            self._orders.close()
            self._sending.release()


def _run(main: Callable[..., object], args: tuple[object, ...], orders: Connection, messages: Connection) -> None:
    """Run ``main`` in the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches all processes of the group: the parent handles it
    main(*args, orders, messages)


@contextlib.contextmanager
def _ctrl_c_blocked() -> Iterator[None]:
    """Block Ctrl+C, for a process that starts to inherit this; on Windows it may still be interrupted at its start."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def lower_priority(steps: int) -> None:
    """Lower this process' priority by ``steps`` (Windows: to below normal); on Linux also its scheduling class."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), _BELOW_NORMAL)
    else:
        os.nice(steps)
    if sys.platform == "linux":
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))

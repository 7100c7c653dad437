"""The interface of a campaign's worker pool, and the pool of processes on this machine."""

import signal
import sys
import time
from collections import deque
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import Any, Protocol

from app.command_line.campaign.task import NotReached, Outcome, Task, analyse_one
from instrument.files import error_words

LOOK_S = 0.1
_BROKEN_S = 5.0  # longest wait for the futures of a broken pool, which end within milliseconds


class WorkersLost(OSError):
    """No worker is usable any more; finished shots are in the journal."""


class WorkerPool(Protocol):
    """Takes tasks and returns each one's outcome once, in any order, or raises WorkersLost."""

    @property
    def width(self) -> int:
        """Get the number of shots analysed at once; 0 while no worker is ready."""

    def give(self, task: Task) -> None:
        """Queue a task."""

    def take(self) -> list[tuple[Task, Outcome]]:
        """Return finished tasks, or wait briefly if there are none.  Raises WorkersLost."""

    def close(self) -> None:
        """Stop the workers; unfinished tasks are dropped."""


def most_processes(system: str) -> int:
    """Return the most processes that a system (``sys.platform``) lets one process wait for."""
    return 61 if system == "win32" else 4096


_MOST = most_processes(sys.platform)


class ProcessPool:
    """Worker processes on this machine.

    A process that dies breaks the pool.  The shots under way are then repeated one at a time; a shot during which a
    process dies again is given up as not reached.
    """

    def __init__(self, count: int) -> None:
        self._count = min(count, _MOST)
        self._pool = self._started()
        self._running: dict[Future[Outcome], Task] = {}
        self._waiting: deque[Task] = deque()
        self._suspects: deque[Task] = deque()

    @property
    def width(self) -> int:
        return self._count

    def give(self, task: Task) -> None:
        self._waiting.append(task)

    def take(self) -> list[tuple[Task, Outcome]]:
        self._hand_on()
        if not self._running:
            time.sleep(LOOK_S)
            return []
        ready, _ = wait(self._running, timeout=LOOK_S, return_when=FIRST_COMPLETED)
        out: list[tuple[Task, Outcome]] = []
        died: list[Task] = []
        if any(isinstance(future.exception(), BrokenProcessPool) for future in ready):
            wait(self._running, timeout=_BROKEN_S)
            ready = set(self._running)
        for future in ready:
            task = self._running.pop(future)
            if not future.done() or isinstance(error := future.exception(), BrokenProcessPool):
                died.append(task)
            else:
                out.append((task, future.result() if error is None else NotReached(error_words(error))))
        if len(died) == 1:
            out.append((died[0], NotReached("the process that analysed it died")))
        else:
            self._suspects.extend(died)
        if died:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = self._started()
        return out

    def close(self) -> None:
        """End the processes; the next call analyses the unfinished shots."""
        if self._running:
            for worker in active_children():
                worker.terminate()
        self._pool.shutdown(cancel_futures=True)

    def _hand_on(self) -> None:
        try:
            if self._suspects:
                if not self._running:
                    task = self._suspects.popleft()
                    self._running[self._pool.submit(analyse_one, task)] = task
                return
            while self._waiting:
                task = self._waiting.popleft()
                self._running[self._pool.submit(analyse_one, task)] = task
        except BrokenProcessPool:  # a worker died since the last look
            self._suspects.append(task)
            if not self._running:
                self._pool = self._started()

    def _started(self) -> "_Pool":
        # spawned, because a forked child of a process with compiled kernels and threads may hang
        ignore = signal.signal, (signal.SIGINT, signal.SIG_IGN)
        return _Pool(self._count, get_context("spawn"), *ignore)


class _Pool(ProcessPoolExecutor):
    """Processes that ignore Ctrl-C, which a terminal sends to all processes; except on Windows even at their start."""

    def submit(self, *work: Any, **more: Any) -> Future[Any]:
        """Submit work with Ctrl-C blocked; a process started for it inherits the blocked signal."""
        if sys.platform == "win32":
            return super().submit(*work, **more)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(*work, **more)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

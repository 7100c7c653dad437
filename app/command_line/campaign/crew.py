"""Who does a campaign's work: what is asked of them, and the processes of this machine."""

import signal
import sys
import time
from collections import deque
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import Any, Protocol

from app.command_line.campaign.task import NotReached, Outcome, Task, analyse_one

LOOK_S = 0.1
_BROKEN_S = 5.0  # the futures of a broken pool are told of it within milliseconds


class CrewLost(OSError):
    """Nobody is left to do the work; what was done stands in the journal."""


class Crew(Protocol):
    """Takes tasks and gives outcomes, in any order.  A task given comes back once, or CrewLost is raised."""

    @property
    def width(self) -> int:
        """Get how many shots are worked on at once, at this moment; 0 where nobody can yet."""

    def give(self, task: Task) -> None:
        """Hand out a task."""

    def take(self) -> list[tuple[Task, Outcome]]:
        """Return what is ready, waiting a moment where nothing is.  Raises CrewLost."""

    def close(self) -> None:
        """End the work; what was given and not taken is dropped."""


def most_processes(system: str) -> int:
    """Return how many processes one can wait for at a time on a system (``sys.platform``)."""
    return 61 if system == "win32" else 4096


_MOST = most_processes(sys.platform)


class Processes:
    """Worker processes of this machine.

    One that dies takes the pool with it: all shots under way are then tried again, one at a time, and one whose
    process dies under it alone is not reached.
    """

    def __init__(self, count: int) -> None:
        self._count = min(count, _MOST)
        self._pool = self._started()
        self._running: dict[Future[Outcome], Task] = {}
        self._waiting: deque[Task] = deque()
        self._suspects: deque[Task] = deque()

    @property
    def width(self) -> int:
        """Get the number of processes."""
        return self._count

    def give(self, task: Task) -> None:
        """Hand out a task."""
        self._waiting.append(task)

    def take(self) -> list[tuple[Task, Outcome]]:
        """Return what is ready, waiting a moment where nothing is."""
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
                out.append((task, future.result() if error is None else NotReached(_in_words(error))))
        if len(died) == 1:
            out.append((died[0], NotReached("the process that analysed it died")))
        else:
            self._suspects.extend(died)
        if died:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = self._started()
        return out

    def close(self) -> None:
        """End the processes; what they have not finished is done by the next call."""
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
        except BrokenProcessPool:  # a worker died while none of its futures was looked at
            self._suspects.append(task)
            if not self._running:
                self._pool = self._started()

    def _started(self) -> "_Pool":
        # spawned, not forked: a forked child of a process with compiled kernels and threads may hang
        ignore = signal.signal, (signal.SIGINT, signal.SIG_IGN)
        return _Pool(self._count, get_context("spawn"), *ignore)


class _Pool(ProcessPoolExecutor):
    """Processes that leave Ctrl-C to the one that started them: a terminal sends it to all, and each would complain.

    They ignore it; where the system can hold it back they do not even hear it while they start.
    """

    def submit(self, *work: Any, **more: Any) -> Future[Any]:
        """Hand out work; a process that is started for it inherits that Ctrl-C is held back, for good."""
        if sys.platform == "win32":
            return super().submit(*work, **more)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(*work, **more)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _in_words(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__

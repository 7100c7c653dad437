"""The interface of a campaign's worker pool, and the pool of processes on this machine."""

import contextlib
import sys
import time
from collections import deque
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from typing import Protocol

from app.command_line.campaign.task import NotReached, Outcome, ShotTask, analyse_one
from instrument.background import ProcessEnded, WorkerProcess
from instrument.files import error_words

LOOK_S = 0.1


class WorkersLost(OSError):
    """No worker is usable any more; finished shots are in the journal."""


class WorkerPool(Protocol):
    """Takes tasks and returns each one's outcome once, in any order, or raises WorkersLost."""

    @property
    def width(self) -> int:
        """Get the number of shots analysed at once; 0 while no worker is ready."""

    def give(self, task: ShotTask) -> None:
        """Queue a task."""

    def take(self) -> list[tuple[ShotTask, Outcome]]:
        """Return finished tasks, or wait briefly if there are none.  Raises WorkersLost."""

    def close(self) -> None:
        """Stop the workers; unfinished tasks are dropped."""


def most_processes(system: str) -> int:
    """Return the most processes that a system (``sys.platform``) lets one process wait for."""
    return 61 if system == "win32" else 4096


_MOST = most_processes(sys.platform)


class ProcessPool:
    """Worker processes on this machine, started when they are first needed.

    A shot during which its process dies is repeated while no other is analysed; if its process dies again, it is given
    up as not reached.
    """

    def __init__(self, count: int) -> None:
        self._count = min(count, _MOST)
        self._idle: list[WorkerProcess] = []
        self._running: dict[WorkerProcess, ShotTask] = {}
        self._waiting: deque[ShotTask] = deque()
        self._suspects: deque[ShotTask] = deque()  # during which a process died
        self._suspected: set[str] = set()  # their stamps, also later

    @property
    def width(self) -> int:
        return self._count

    def give(self, task: ShotTask) -> None:
        self._waiting.append(task)

    def take(self) -> list[tuple[ShotTask, Outcome]]:
        self._hand_on()
        if not self._running:
            time.sleep(LOOK_S)
            return []
        out: list[tuple[ShotTask, Outcome]] = []
        ready = set(wait([process.messages for process in self._running], LOOK_S))
        for process in [process for process in self._running if process.messages in ready]:
            task = self._running.pop(process)
            try:
                out.append((task, process.receive(0.0)))
                self._idle.append(process)
            except ProcessEnded:
                if task.stamp in self._suspected:
                    out.append((task, NotReached("the process that analysed it died")))
                else:
                    self._suspected.add(task.stamp)
                    self._suspects.append(task)
        self._hand_on()
        return out

    def close(self) -> None:
        """End the processes; the next call analyses the unfinished shots."""
        for process in (*self._idle, *self._running):
            process.end(0.0)

    def _hand_on(self) -> None:
        while waiting := self._suspects or self._waiting:
            alone = bool(self._suspects) or any(task.stamp in self._suspected for task in self._running.values())
            if len(self._running) >= (1 if alone else self._count):
                return
            process = self._idle.pop() if self._idle else WorkerProcess("shots", _serve, analyse_one)
            try:
                process.send(waiting[0])
            except ProcessEnded:  # it died since its last shot
                process.end(0.0)
            else:
                self._running[process] = waiting.popleft()


def _serve(analyse: Callable[[ShotTask], Outcome], tasks: Connection, outcomes: Connection) -> None:
    """Analyse shots until the parent is gone; the main function of a process."""
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            task: ShotTask = tasks.recv()
            try:
                outcome = analyse(task)
            except Exception as error:
                outcome = NotReached(error_words(error))
            outcomes.send(outcome)

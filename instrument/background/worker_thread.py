"""A worker thread: it runs queued tasks one after another, with progress, cancellation and their errors."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from analysis.shot import Cancelled, Progress, Stop

CLOSE_S = 10.0

Work = Callable[[Progress, Stop], Any]


def start_thread(name: str, target: Callable[..., object], *args: object) -> threading.Thread:
    """Start a thread that does not keep the program running, even if it never returns."""
    thread = threading.Thread(target=target, args=args, name=name, daemon=True)
    thread.start()
    return thread


@dataclass(slots=True, eq=False)
class Task:
    """A task, called as ``work(report, cancelled)``; its thread writes ``what`` and ``fraction``, any other reads them.

    ``problem`` is the message of ``error``.  Both are None unless the work raised an exception.
    """

    name: str
    work: Work
    what: str = ""
    fraction: float = 0.0
    started_s: float | None = None  # monotonic clock
    cancelled: bool = False
    result: Any = None
    error: Exception | None = None
    problem: str | None = None
    done: threading.Event = field(default_factory=threading.Event)

    def cancel(self) -> None:
        """Ask the task to stop at its next check, or not to begin."""
        self.cancelled = True

    def wait(self) -> Any:
        """Wait for the end of the task and return its result.  Raises its exception, or Cancelled."""
        self.done.wait()
        if self.error is not None:
            raise self.error
        if self.cancelled:
            raise Cancelled
        return self.result

    def run(self) -> None:
        """Do the work, unless it was cancelled, and keep its result or error; called in the worker thread."""

        def report(what: str, fraction: float) -> None:
            self.what, self.fraction = what, fraction

        if self.cancelled:
            return
        self.started_s = time.monotonic()
        try:
            self.result = self.work(report, lambda: self.cancelled)
        except Cancelled:
            self.cancelled = True
        except Exception as error:  # its reader gets it, and the thread continues
            self.error, self.problem = error, str(error) or type(error).__name__


def raise_in_thread(task: Task) -> None:
    """Treat the error of a task as uncaught, because nobody reads it."""
    error = task.error
    if error is not None:
        what = (type(error), error, error.__traceback__, threading.current_thread())
        threading.excepthook(threading.ExceptHookArgs(what))


AnyTask = TypeVar("AnyTask", bound=Task)


class WorkerThread(Generic[AnyTask]):
    """A queue of tasks and the thread that runs them, from ``start`` to ``close``.

    ``ended`` is called in the thread with each task that has ended, also if it was cancelled before it began.
    """

    def __init__(self, name: str, ended: Callable[[AnyTask], object] = raise_in_thread) -> None:
        self.current: AnyTask | None = None  # the running task
        self.closing = threading.Event()
        self._name, self._ended = f"levimass {name}", ended
        self._waiting: deque[AnyTask] = deque()
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        self._thread = start_thread(self._name, self._work)

    def add(self, task: AnyTask) -> AnyTask:
        """Queue a task and return it; after ``close`` it is cancelled."""
        with self._wake:
            if self.closing.is_set():
                task.cancel()
            self._waiting.append(task)
            self._wake.notify()
        return task

    @property
    def queued(self) -> int:
        """Get the number of tasks that have not begun."""
        return len(self._waiting)

    @property
    def tasks(self) -> list[AnyTask]:
        """Get the queued and running tasks."""
        with self._wake:
            return [task for task in (*self._waiting, self.current) if task is not None]

    @property
    def alive(self) -> bool:
        """Get whether the thread was started and has not ended."""
        return self._thread is not None and self._thread.is_alive()

    def close(self, timeout_s: float = CLOSE_S, *, finish: bool = False) -> bool:
        """Cancel all tasks, or let them ``finish``, and join the thread; return whether it ended."""
        with self._wake:
            self.closing.set()
            for task in () if finish else self.tasks:
                task.cancel()
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(timeout_s)
        return not self.alive

    def _work(self) -> None:
        while True:
            with self._wake:
                while not self._waiting and not self.closing.is_set():
                    self._wake.wait()
                if not self._waiting:
                    return
                self.current = task = self._waiting.popleft()
            task.run()
            with self._wake:
                self.current = None
                self._ended(task)
            task.done.set()
            del task  # while the thread waits it keeps no data in memory


@contextmanager
def beside(name: str, work: Work) -> Iterator[Task]:
    """Run a task in a thread during a block, whose end cancels it; ``Task.wait`` returns its result."""
    thread = WorkerThread[Task](name, lambda task: None)
    thread.start()
    try:
        yield thread.add(Task(name, work))
    finally:
        thread.close()

"""Long computations in a subprocess, so that they delay neither the screen nor a capture."""

import contextlib
import gc
import itertools
import math
import os
import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from multiprocessing.connection import _ConnectionBase as Connection  # a pipe's end is another class on Windows
from typing import Any

import numpy as np

from analysis.pipeline import fitted, read
from analysis.shot import AnalysisError, AnalysisSettings, Cancelled, Progress, Recording, Shot
from instrument.background import ProcessEnded, WorkerProcess, lower_priority, start_thread
from instrument.files import RecordingError, analyse_and_check_hash, one_line

CANCEL_S = 5.0  # a child that has not reacted to a cancellation by then is killed
_LOOK_S = 0.02
_REPORT_EVERY_S = 0.05
_END_S = 5.0


@dataclass(frozen=True, slots=True)
class _Task:
    number: int
    work: Callable[..., Any]


@dataclass(frozen=True, slots=True)
class _Report:
    """Progress or end of the task ``number``; without a number: the child is ready."""

    number: int | None
    progress: tuple[str, float] | None = None
    result: Any = None
    problem: str | None = None
    cancelled: bool = False


class SubprocessWorker:
    """Runs one task after another in a child process; ``warm`` (picklable) is called there once, before the first.

    If the child dies, the running task fails and the next task starts a new child.
    """

    def __init__(self, warm: Callable[[], object] | None = None) -> None:
        self._warm = warm
        self._lock = threading.Lock()
        self._process: WorkerProcess | None = None
        self._numbers = itertools.count()
        self._closed = False

    def start(self) -> None:
        """Start the child if there is none, so that the first task does not wait for it; returns at once."""
        with self._lock:
            if not self._closed and (self._process is None or self._process.over):
                self._process = WorkerProcess("work", _serve, self._warm)

    def run(self, work: Callable[..., Any], progress: Progress, cancelled: Callable[[], bool]) -> Any:
        """Return the result of ``work(progress=..., cancelled=...)``; from one thread at a time.

        Work and result are pickled; arrays of the result are read-only.  After ``close`` the work runs in this process.
        Raises Cancelled, and AnalysisError for any other exception of the work.
        """
        self.start()
        process = self._process
        if self._closed or process is None:
            return work(progress=progress, cancelled=cancelled)
        try:
            return self._await(process, _Task(next(self._numbers), work), progress, cancelled)
        except ProcessEnded as error:
            process.end(0.0)
            if cancelled():
                raise Cancelled from error
            what = "the analysis's process ended by itself: start it again; a shot's recording is saved"
            raise AnalysisError(what) from error

    def await_ready(self, cancelled: Callable[[], bool]) -> None:
        """Wait until a child that was just started has finished ``warm``, or has ended; before its first task.

        Raises Cancelled.
        """
        with contextlib.suppress(ProcessEnded):
            while self._process is not None and self._process.receive(_LOOK_S) is None:
                if cancelled():
                    raise Cancelled

    def close(self) -> None:
        """End the child; harmless when there is none."""
        self._closed = True
        with self._lock:  # not while it starts
            process = self._process
        if process is not None:
            process.end(_END_S)

    @staticmethod
    def _await(process: WorkerProcess, task: _Task, progress: Progress, cancelled: Callable[[], bool]) -> Any:
        process.send(task)
        cancelled_s: float | None = None
        while True:
            if cancelled_s is None and cancelled():
                cancelled_s = time.monotonic()
                process.send(task.number)
            report: _Report | None = process.receive(_LOOK_S)
            if report is None:
                if cancelled_s is not None and time.monotonic() - cancelled_s > CANCEL_S:
                    process.end(0.0)
                    raise Cancelled
                continue
            if report.number != task.number:
                continue
            if report.progress is not None:
                progress(*report.progress)
            elif report.cancelled:
                raise Cancelled
            elif report.problem is not None:
                raise AnalysisError(report.problem)
            else:
                _seal(report.result)
                return report.result


def _serve(warm: Callable[[], object] | None, tasks: Connection, reports: Connection) -> None:
    """Run tasks until the parent is gone; the main function of the process."""
    lower_priority(10)  # samples and screen come first
    waiting: queue.SimpleQueue[_Task] = queue.SimpleQueue()
    dropped: set[int] = set()

    def receive() -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                order: _Task | int = tasks.recv()
                if isinstance(order, int):
                    dropped.add(order)
                else:
                    _seal(order.work)  # kernels are compiled for read-only arrays
                    waiting.put(order)
        os._exit(0)  # the parent is gone

    start_thread("tasks", receive)
    if warm is not None:
        with contextlib.suppress(Exception):  # kernels are then compiled at their first call
            warm()
    gc.freeze()  # objects loaded so far are never freed
    with contextlib.suppress(OSError):
        reports.send(_Report(None))
    while True:
        task = waiting.get()
        report = _run(task, reports, dropped)
        try:
            reports.send(report)
        except OSError:
            return
        except Exception as error:  # a result that cannot be pickled must be reported
            reports.send(_Report(task.number, problem=f"the result could not be sent: {one_line(repr(error))}"))
        del task, report
        gc.collect()  # now, when no task waits


def _run(task: _Task, reports: Connection, dropped: set[int]) -> _Report:
    reported_s = -math.inf

    def progress(what: str, share: float) -> None:
        nonlocal reported_s
        now = time.monotonic()
        if now - reported_s > _REPORT_EVERY_S:
            reported_s = now
            with contextlib.suppress(OSError):  # the parent is gone: the receiving thread ends the process
                reports.send(_Report(task.number, progress=(what, share)))

    def cancelled() -> bool:
        return task.number in dropped

    try:
        return _Report(task.number, result=task.work(progress=progress, cancelled=cancelled))
    except Cancelled:
        return _Report(task.number, cancelled=True)
    except (AnalysisError, RecordingError, OSError) as error:
        return _Report(task.number, problem=one_line(str(error)))
    except Exception as error:
        return _Report(task.number, problem=f"a fault of the program: {one_line(repr(error))}")
    finally:
        dropped.discard(task.number)


def _seal(value: object) -> None:
    """Make the arrays of a task or result read-only again, because pickling does not keep that."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, partial):
        _seal(value.args)
        _seal(value.keywords)
    elif is_dataclass(value):
        for field in fields(value):
            _seal(getattr(value, field.name))
    elif isinstance(value, tuple | list):
        for part in value:
            _seal(part)
    elif isinstance(value, Mapping):
        for part in value.values():
            _seal(part)


class SubprocessAnalysis(SubprocessWorker):
    """Analyses recordings in a child process, one at a time: first the readings, then the fit."""

    def read(
        self, recording: Recording, settings: AnalysisSettings, progress: Progress, cancelled: Callable[[], bool]
    ) -> Shot:
        """Read a recording as ``analysis.pipeline.read`` does; from one thread at a time.

        A recording that is only in memory is read in this process, because sending it takes long.  Raises
        AnalysisError, Cancelled.
        """
        if recording.path is None:
            return read(recording, settings, progress=progress, cancelled=cancelled)
        shot: Shot = self.run(partial(_read, recording.path, settings), progress, cancelled)
        return shot

    def fit(self, shot: Shot, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
        """Fit a shot as ``analysis.pipeline.fitted`` does; from one thread at a time.  Raises as ``read``."""
        whole: Shot = self.run(partial(fitted, shot), progress, cancelled)
        return whole


def _read(path: str, settings: AnalysisSettings, *, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
    return analyse_and_check_hash(path, partial(read, settings=settings, progress=progress, cancelled=cancelled))

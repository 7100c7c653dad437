"""Work done in a process of its own, whose long stretches of Python hold up neither the screen nor a capture."""

import contextlib
import gc
import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from multiprocessing.connection import _ConnectionBase as Connection  # a pipe's end is another class on Windows
from multiprocessing.context import SpawnProcess
from multiprocessing.reduction import ForkingPickler
from types import MappingProxyType
from typing import Any

import numpy as np

from analysis.pipeline import fitted, read
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisError, AnalysisSettings, Cancelled, Progress, Shot
from instrument.files.open_recording import analysed_while_hashed
from instrument.files.recording_error import RecordingError, one_line
from instrument.process.messages import give_way

HEEDS_S = 5.0  # a child that looks at a cancellation later than this is ended: it may still be loading, or starved
_LOOK_S = 0.02
_TOLD_EVERY_S = 0.05
_ENDS_S = 5.0
_READY = 0  # the number of no task

ForkingPickler.register(MappingProxyType, lambda view: (MappingProxyType, (dict(view),)))


@dataclass(frozen=True, slots=True)
class _Task:
    number: int
    work: Callable[..., Any]


@dataclass(frozen=True, slots=True)
class _News:
    """How far the task ``number`` is, or how it ended."""

    number: int
    progress: tuple[str, float] | None = None
    result: Any = None
    problem: str | None = None
    cancelled: bool = False


class WorkApart:
    """Does one piece of work after another in a child; ``warm`` (picklable) is called there once, before the first.

    A child that dies costs the work under way, and the next one starts another.
    """

    def __init__(self, warm: Callable[[], object] | None = None) -> None:
        self._warm = warm
        self._lock = threading.Lock()
        self._process: SpawnProcess | None = None
        self._tasks: Connection | None = None
        self._news: Connection | None = None
        self._number = 0
        self._closed = False

    @property
    def child_id(self) -> int | None:
        """Get the child's process number, None where there is none."""
        return self._process.pid if self._process is not None else None

    def start(self) -> None:
        """Start the child if there is none, so that the first work does not wait for it; returns at once."""
        with self._lock:
            if self._process is not None or self._closed:
                return
            context = multiprocessing.get_context("spawn")
            theirs, tasks = context.Pipe(duplex=False)
            news, said = context.Pipe(duplex=False)
            process = context.Process(target=_serve, args=(self._warm, theirs, said), name="levimass work")
            process.daemon = True
            process.start()
            theirs.close()
            said.close()
            self._process, self._tasks, self._news = process, tasks, news

    def run(self, work: Callable[..., Any], progress: Progress, cancelled: Callable[[], bool]) -> Any:
        """Return what ``work(progress=..., cancelled=...)`` returns; from one thread at a time.

        Work and result travel by pickle; arrays of the result are read-only.  After ``close`` the work is done here.
        Raises Cancelled, and AnalysisError with one line for whatever else the work raised.
        """
        if self._closed:
            return work(progress=progress, cancelled=cancelled)
        self.start()
        self._number += 1
        try:
            return self._await(_Task(self._number, work), progress, cancelled)
        except (EOFError, OSError) as error:
            self._end(0.0)
            if cancelled():
                raise Cancelled from error
            what = "the analysis's process ended by itself: ask for it again; a shot's recording is saved"
            raise AnalysisError(what) from error

    def await_ready(self, cancelled: Callable[[], bool]) -> None:
        """Return once a child that was just started has done its ``warm``, or is gone; before any other work of it.

        Raises Cancelled.
        """
        with contextlib.suppress(EOFError, OSError):
            while self._news is not None and not self._news.poll(_LOOK_S):
                if cancelled():
                    raise Cancelled

    def close(self) -> None:
        """End the child; harmless when there is none."""
        self._closed = True
        self._end(_ENDS_S)

    def _await(self, task: _Task, progress: Progress, cancelled: Callable[[], bool]) -> Any:
        tasks, news = self._tasks, self._news
        if tasks is None or news is None:
            raise EOFError
        tasks.send(task)
        told_s: float | None = None
        while True:
            if told_s is None and cancelled():
                told_s = time.monotonic()
                tasks.send(task.number)
            if not news.poll(_LOOK_S):
                if told_s is not None and time.monotonic() - told_s > HEEDS_S:
                    self._end(0.0)
                    raise Cancelled
                continue
            new: _News = news.recv()
            if new.number != task.number:
                continue
            if new.progress is not None:
                progress(*new.progress)
            elif new.cancelled:
                raise Cancelled
            elif new.problem is not None:
                raise AnalysisError(new.problem)
            else:
                _seal(new.result)
                return new.result

    def _end(self, patience_s: float) -> None:
        with self._lock:
            process, self._process = self._process, None
            tasks, self._tasks = self._tasks, None
            if tasks is not None:
                tasks.close()  # the child sees its end
            if process is not None:
                process.join(patience_s)
                if process.is_alive():
                    process.kill()
                    process.join(_ENDS_S)
                process.close()
            news, self._news = self._news, None
            if news is not None:
                news.close()


def _serve(warm: Callable[[], object] | None, tasks: Connection, news: Connection) -> None:
    """Do what comes until the parent is gone; the whole life of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches the whole group: the parent ends in good order
    give_way(10)  # samples and screen come first
    waiting: queue.SimpleQueue[_Task] = queue.SimpleQueue()
    dropped: set[int] = set()

    def hear() -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                order: _Task | int = tasks.recv()
                if isinstance(order, int):
                    dropped.add(order)
                else:
                    _seal(order.work)  # a kernel for arrays that are only read is another one
                    waiting.put(order)
        os._exit(0)  # nobody is left to tell

    threading.Thread(target=hear, name="tasks", daemon=True).start()
    if warm is not None:
        with contextlib.suppress(Exception):  # then it is compiled when it is needed
            warm()
    gc.freeze()  # what is loaded by now stays to the end
    with contextlib.suppress(OSError):
        news.send(_News(_READY))
    while True:
        task = waiting.get()
        new = _one(task, news, dropped)
        try:
            news.send(new)
        except OSError:
            return
        except Exception as error:  # a result that cannot travel must not end the child without a word
            news.send(_News(task.number, problem=f"the result was lost on its way: {one_line(repr(error))}"))
        del task, new
        gc.collect()  # now, when nobody waits for it


def _one(task: _Task, news: Connection, dropped: set[int]) -> _News:
    told_s = 0.0

    def progress(what: str, share: float) -> None:
        nonlocal told_s
        now = time.monotonic()
        if now - told_s > _TOLD_EVERY_S:
            told_s = now
            with contextlib.suppress(OSError):  # a parent that is gone: the thread that hears ends the process
                news.send(_News(task.number, progress=(what, share)))

    def cancelled() -> bool:
        return task.number in dropped

    try:
        return _News(task.number, result=task.work(progress=progress, cancelled=cancelled))
    except Cancelled:
        return _News(task.number, cancelled=True)
    except (AnalysisError, RecordingError, OSError) as error:
        return _News(task.number, problem=one_line(str(error)))
    except Exception as error:
        return _News(task.number, problem=f"a fault of the program: {one_line(repr(error))}")
    finally:
        dropped.discard(task.number)


def _seal(value: object) -> None:
    """Make the arrays of work or result read-only again, as they were before they travelled."""
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


class AnalysisApart(WorkApart):
    """Analyses recordings in a child, one at a time: up to the readings, then the fit."""

    def read(
        self, recording: Recording, settings: AnalysisSettings, progress: Progress, cancelled: Callable[[], bool]
    ) -> Shot:
        """Read a recording as ``analysis.pipeline.read`` does; from one thread at a time.

        A recording that is only in memory is read here, as it would be long on its way.  Raises AnalysisError,
        Cancelled.
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
    return analysed_while_hashed(path, partial(read, settings=settings, progress=progress, cancelled=cancelled))

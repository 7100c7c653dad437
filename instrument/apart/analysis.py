"""Shots analysed in a process of its own, whose long stretches of Python hold up neither the screen nor a capture."""

import contextlib
import gc
import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from analysis.motion import ARRAYS
from analysis.pipeline import analyse
from analysis.recording import Recording
from analysis.shot import AnalysisError, AnalysisSettings, Cancelled, Progress, Shot
from instrument.open_recording import open_recording
from instrument.recording_error import RecordingError, one_line

_LOOK_S = 0.02
_TOLD_EVERY_S = 0.05
_ENDS_S = 5.0
HEEDS_S = 5.0  # a child that looks at a cancellation later than this is ended: it may still be loading, or starved


@dataclass(frozen=True, slots=True)
class _Task:
    number: int
    path: str
    settings: AnalysisSettings


@dataclass(frozen=True, slots=True)
class _News:
    """How far the task ``number`` is, or how it ended."""

    number: int
    progress: tuple[str, float] | None = None
    shot: Shot | None = None
    problem: str | None = None
    cancelled: bool = False


class AnalysisApart:
    """Analyses recordings in a child, one at a time; ``warm`` (picklable) is called there once, before the first.

    A recording that is only in memory is analysed here, as it would be long on its way.  A child that dies costs the
    shot under way, and the next one starts another.
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
        """Start the child if there is none, so that the first shot does not wait for it; returns at once."""
        with self._lock:
            if self._process is not None or self._closed:
                return
            context = multiprocessing.get_context("spawn")
            theirs, tasks = context.Pipe(duplex=False)
            news, said = context.Pipe(duplex=False)
            process = context.Process(target=_serve, args=(self._warm, theirs, said), name="levimass analysis")
            process.daemon = True
            process.start()
            theirs.close()
            said.close()
            self._process, self._tasks, self._news = process, tasks, news

    def analyse(
        self, recording: Recording, settings: AnalysisSettings, progress: Progress, cancelled: Callable[[], bool]
    ) -> Shot:
        """Analyse a recording as ``analysis.pipeline.analyse`` does; from one thread at a time.

        Raises AnalysisError, Cancelled.
        """
        if recording.path is None or self._closed:
            return analyse(recording, settings, progress=progress, cancelled=cancelled)
        self.start()
        self._number += 1
        try:
            return self._await(_Task(self._number, recording.path, settings), progress, cancelled)
        except (EOFError, OSError) as error:
            self._end(0.0)
            if cancelled():
                raise Cancelled from error
            raise AnalysisError("the analysis's process ended by itself; open the shot's recording again") from error

    def close(self) -> None:
        """End the child; harmless when there is none."""
        self._closed = True
        self._end(_ENDS_S)

    def _await(self, task: _Task, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
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
            elif new.shot is not None:
                return _read_only(new.shot)
            elif new.cancelled:
                raise Cancelled
            else:
                raise AnalysisError(new.problem or "the analysis failed")

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
    """Analyse what comes until the parent is gone; the whole life of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches the whole group: the parent ends in good order
    if hasattr(os, "nice"):
        os.nice(10)  # samples and screen come first
    waiting: queue.SimpleQueue[_Task] = queue.SimpleQueue()
    dropped: set[int] = set()

    def hear() -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                order: _Task | int = tasks.recv()
                if isinstance(order, int):
                    dropped.add(order)
                else:
                    waiting.put(order)
        os._exit(0)  # nobody is left to tell

    threading.Thread(target=hear, name="tasks", daemon=True).start()
    if warm is not None:
        with contextlib.suppress(Exception):  # then it is compiled when it is needed
            warm()
    gc.freeze()  # what is loaded by now stays to the end
    while True:
        task = waiting.get()
        try:
            news.send(_one(task, news, dropped))
        except OSError:
            return
        gc.collect()  # now, when nobody waits for it


def _one(task: _Task, news: Connection, dropped: set[int]) -> _News:
    told_s = 0.0

    def progress(what: str, share: float) -> None:
        nonlocal told_s
        now = time.monotonic()
        if now - told_s > _TOLD_EVERY_S:
            told_s = now
            news.send(_News(task.number, progress=(what, share)))

    def cancelled() -> bool:
        return task.number in dropped

    try:
        shot = analyse(open_recording(task.path), task.settings, progress=progress, cancelled=cancelled)
        return _News(task.number, shot=_portable(shot))
    except Cancelled:
        return _News(task.number, cancelled=True)
    except (AnalysisError, RecordingError) as error:
        return _News(task.number, problem=one_line(str(error)))
    except OSError:
        raise
    except Exception as error:
        return _News(task.number, problem=f"the analysis failed: {one_line(repr(error))}")


def _read_only(shot: Shot) -> Shot:
    """Return the shot with its motion's arrays as they were before they travelled."""
    if shot.motion is not None:
        for name in ARRAYS:
            getattr(shot.motion, name).flags.writeable = False
    return shot


def _portable(shot: Shot) -> Shot:
    """Return the shot with nothing in it that cannot travel: views of mappings become mappings."""
    if shot.setup is None:
        return shot
    extra: dict[str, Any] = dict(shot.setup.extra)
    return replace(shot, setup=replace(shot.setup, extra=extra))

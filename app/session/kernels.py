"""Compile or load the numba kernels in parallel processes while the window opens.

The first start after an installation compiles for one to two minutes: first the kernels of a shot's readings, then
those of its fit, then all others.  Later starts load the kernels from disk.
"""

import contextlib
import gc
import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING

from analysis.compiled import cache_folder, whole_program
from analysis.shot import Cancelled, Progress, Stop
from app.session import warm_up
from app.session.warm_up import readings
from instrument.background import WorkerProcess, beside, lower_priority

if TYPE_CHECKING:
    from instrument.process import SubprocessWorker  # slow to import, which each compiling process would repeat

_LOOK_S = 0.05


class Stage(StrEnum):
    """Stages of the compilation, in order; the value is also the name of the file that marks the stage as done."""

    READINGS = "readings"  # kernels for the readings of a shot
    FIT = "first-shot"  # also those for its fit
    ALL = "complete"


@dataclass(frozen=True, slots=True)
class Piece:
    """A set of kernels compiled by one process, started once the piece named ``after`` is compiled."""

    name: str
    work: Callable[[], object]
    stage: Stage
    after: str = ""


BENCH = Piece("the simulated bench", warm_up.bench, Stage.READINGS)
READINGS = Piece("the readings", warm_up.readings, Stage.READINGS)
LATER = (
    Piece("the model", warm_up.fit, Stage.FIT),
    Piece("the effects", warm_up.effects, Stage.ALL),
    Piece("the diagnosis", warm_up.diagnosis, Stage.ALL, after="the model"),
)
PIECES = (READINGS, BENCH, *LATER)


def warm_up_analysis() -> None:
    """Load the kernels of readings and fit; compile those of the readings if they are not on disk."""
    warm_up.readings()
    if complete(Stage.FIT):
        warm_up.fit()


def complete(stage: Stage = Stage.ALL) -> bool:
    """Return whether this exact program, Python, numba and processor has compiled the kernels up to a stage."""
    now = whole_program()
    return any(_mark(reached) == now for reached in tuple(Stage)[tuple(Stage).index(stage) :])


def mark_complete(stage: Stage = Stage.ALL) -> None:
    """Mark this program's kernels as compiled up to a stage."""
    with contextlib.suppress(OSError):  # without the mark the next start prepares the kernels again
        (cache_folder() / stage).write_text(whole_program(), encoding="utf-8")


def prepare(
    report: Progress,
    cancelled: Stop,
    ready: Callable[[Stage], None] = lambda stage: None,
    at_once: int | None = None,
    pieces: Sequence[Piece] = PIECES,
) -> bool:
    """Compile the pieces in at most ``at_once`` processes (default: one per core); return whether all succeeded.

    ``ready`` is called with each stage reached.  Raises Cancelled after ending all processes.
    """
    width = at_once or os.cpu_count() or 1
    waiting, running, succeeded = list(pieces), dict[Piece, WorkerProcess](), True
    stages = list(dict.fromkeys(piece.stage for piece in pieces))
    try:
        while waiting or running:
            _start_next(waiting, running, width)
            succeeded &= _remove_ended(running)
            left = [*running, *waiting]
            while stages and stages[0] not in {piece.stage for piece in left}:
                if succeeded:
                    mark_complete(stages[0])
                ready(stages.pop(0))
            if left:
                report(f"compiling {left[0].name}", 1.0 - len(left) / len(pieces))
                if cancelled():
                    raise Cancelled
                time.sleep(_LOOK_S)
    finally:
        for process in running.values():
            process.end(0.0)
    return succeeded


def prepare_first_shot(report: Progress, ready: Callable[[Stage], None]) -> None:
    """Compile the kernels for a simulated shot on all cores, unless they are on disk.

    ``ready`` is called with each stage, even after a failure; kernels that failed are compiled on first use.
    """
    try:
        if not complete(Stage.FIT):
            prepare(report, lambda: False, ready, pieces=[piece for piece in PIECES if piece.stage is not Stage.ALL])
    finally:
        for stage in (Stage.READINGS, Stage.FIT):
            ready(stage)


def _mark(stage: Stage) -> str:
    try:
        return (cache_folder() / stage).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _start_next(waiting: list[Piece], running: dict[Piece, WorkerProcess], width: int) -> None:
    """Start the waiting pieces whose turn it is, up to ``width`` at once."""
    for piece in list(waiting):
        if len(running) < width and piece.after not in {other.name for other in (*waiting, *running)}:
            waiting.remove(piece)
            running[piece] = WorkerProcess(piece.name, _compile, piece)


def _remove_ended(running: dict[Piece, WorkerProcess]) -> bool:
    """Remove the processes that have ended; return whether all of them succeeded."""
    ended = [piece for piece, process in running.items() if process.exit_code is not None]
    return all([running.pop(piece).exit_code == 0 for piece in ended])  # a list, so that all are removed


def _compile(piece: Piece, _: object, __: object) -> None:
    lower_priority(5 if piece.stage is Stage.READINGS else 19)  # below capture and window; the readings come first
    try:
        piece.work()
    except Exception as error:
        print(f"levimass: {piece.name}: {' '.join(str(error).split())}", file=sys.stderr)
        raise SystemExit(1) from None


BACKGROUND_PIECES = (*LATER, replace(BENCH, stage=Stage.ALL))  # a simulated bench in use compiles its own kernels


class Kernels:
    """Prepares the kernels in the background; other threads can wait for each stage."""

    def __init__(self, analyst: "SubprocessWorker | None" = None, helper: "SubprocessWorker | None" = None) -> None:
        """``analyst``, the process that analyses the rig's shots, starts first and compiles the readings' kernels.

        ``helper``, the process for other work, starts once the fit's kernels are compiled.  Both are optional.
        """
        self._ready = {stage: threading.Event() for stage in Stage}
        self._analyst, self._helper = analyst, helper

    def work(self, report: Progress, cancelled: Stop) -> None:
        """Prepare the kernels, as a job.  If a process fails, its kernels are compiled on first use."""
        try:
            with beside("kernels", lambda _, __: self._load(cancelled)) as loading:
                if complete(Stage.FIT):
                    self._reached(Stage.FIT)
                if not complete():
                    cores = max(1, (os.cpu_count() or 1) - 1)  # one core is left for the readings' kernels
                    prepare(partial(self._report_progress, report), cancelled, self._reached, cores, BACKGROUND_PIECES)
                loading.wait()
        finally:
            # loaded objects are permanent; scanning them in a garbage collection would stop all threads for 0.1 s
            gc.freeze()
            for ready in self._ready.values():
                ready.set()

    def wait(self, stage: Stage, cancelled: Stop) -> None:
        """Wait until a stage is reached.  Raises Cancelled."""
        while not self._ready[stage].wait(_LOOK_S):
            if cancelled():
                raise Cancelled

    def _load(self, cancelled: Stop) -> None:
        """Load the kernels of the live view and, without an analyst, those of the readings."""
        if self._analyst is None:
            readings()
        else:
            self._analyst.start()
            if not complete(Stage.READINGS):
                self._analyst.await_ready(cancelled)
                mark_complete(Stage.READINGS)
            from instrument.live import warm  # slow to import

            warm()
        self._ready[Stage.READINGS].set()

    def _reached(self, stage: Stage) -> None:
        if stage is Stage.FIT and self._helper is not None:
            self._helper.start()
        self._ready[stage].set()

    def _report_progress(self, report: Progress, words: str, share: float) -> None:
        first = self._ready[Stage.READINGS].is_set()
        report(words if first else "compiling the readings, at the first start only", share)

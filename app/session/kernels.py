"""Compile or load the kernels in several processes at once, those that a first shot needs first.

The first start after an installation compiles for a minute or two: first what a shot's readings need, then its fit,
then the rest.  Later starts load the kernels from disk.  Processes do it while the window opens, so that the screen
does not wait.
"""

import contextlib
import gc
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from multiprocessing.context import SpawnProcess
from typing import TYPE_CHECKING

from analysis.compiled import cache_folder, whole_program
from analysis.shot import Cancelled, Progress, Stop
from app.session import warm_up
from app.session.warm_up import readings
from instrument.process import lower_priority

if TYPE_CHECKING:
    from instrument.process import SubprocessWorker  # slow to import, and in every process that compiles

_LOOK_S = 0.05


class Stage(StrEnum):
    """Stages of the compilation, in order; each is also the name of the file that marks it as done."""

    READINGS = "readings"  # the readings of a first shot
    FIT = "first-shot"  # and its fit
    ALL = "complete"


@dataclass(frozen=True, slots=True)
class Piece:
    """A part that one process compiles, ``after`` the piece whose kernels it needs too."""

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
    """Load the kernels of readings and fit; compile those of the readings where they are not on disk."""
    warm_up.readings()
    if complete(Stage.FIT):
        warm_up.fit()


def complete(stage: Stage = Stage.ALL) -> bool:
    """Return whether this very program, Python, numba and processor compiled the kernels up to a stage."""
    now = whole_program()
    return any(_mark(reached) == now for reached in tuple(Stage)[tuple(Stage).index(stage) :])


def mark_complete(stage: Stage = Stage.ALL) -> None:
    """Mark this program's kernels as compiled up to a stage."""
    with contextlib.suppress(OSError):  # the next start then checks again
        (cache_folder() / stage).write_text(whole_program(), encoding="utf-8")


def prepare(
    report: Progress,
    cancelled: Stop,
    ready: Callable[[Stage], None] = lambda stage: None,
    at_once: int | None = None,
    pieces: Sequence[Piece] = PIECES,
) -> bool:
    """Compile the pieces, ``at_once`` processes at a time (default: one per core); return whether all succeeded.

    ``ready`` is called with each stage that is reached.  Raises Cancelled, after ending all processes.
    """
    width = at_once or os.cpu_count() or 1
    waiting, running, succeeded = list(pieces), dict[Piece, SpawnProcess](), True
    stages = list(dict.fromkeys(piece.stage for piece in pieces))
    try:
        while waiting or running:
            for piece in list(waiting):
                if len(running) < width and piece.after not in {other.name for other in (*waiting, *running)}:
                    waiting.remove(piece)
                    running[piece] = _started(piece)
            for piece in [piece for piece, process in running.items() if not process.is_alive()]:
                succeeded &= running.pop(piece).exitcode == 0
            left = [*running, *waiting]
            while stages and not any(piece.stage is stages[0] for piece in left):
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
            process.kill()
    return succeeded


def prepare_first_shot(report: Progress, ready: Callable[[Stage], None]) -> None:
    """Compile what a simulated shot needs, on all cores, where it is not on disk yet.

    ``ready`` is called with each stage, also where it failed: its kernels are then compiled when they are needed.
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


def _started(piece: Piece) -> SpawnProcess:
    process = multiprocessing.get_context("spawn").Process(target=_compile, args=(piece,), daemon=True)
    process.start()
    return process


def _compile(piece: Piece) -> None:
    lower_priority(5 if piece.stage is Stage.READINGS else 19)  # below capture and screen; the readings above all else
    try:
        piece.work()
    except Exception as error:
        print(f"levimass: {piece.name}: {' '.join(str(error).split())}", file=sys.stderr)
        raise SystemExit(1) from None


_BESIDE = (*LATER, replace(BENCH, stage=Stage.ALL))  # the simulated bench compiles its own where it is the source


class Kernels:
    """Makes the kernels ready, and lets others wait for them."""

    def __init__(self, analyst: "SubprocessWorker | None" = None, helper: "SubprocessWorker | None" = None) -> None:
        """``analyst``, the process that analyses the rig's shots, starts first and compiles what readings need.

        ``helper``, the process for other work, starts once it need not compile.  Without them this process does all.
        """
        self._ready = {stage: threading.Event() for stage in Stage}
        self._analyst, self._helper = analyst, helper

    def work(self, report: Progress, cancelled: Stop) -> None:
        """Make the kernels ready, as a job.  Where a process fails its kernels are compiled when they are needed."""
        try:
            with ThreadPoolExecutor(1, "levimass kernels") as executor:
                loading = executor.submit(self._load, cancelled)
                if complete(Stage.FIT):
                    self._reached(Stage.FIT)
                if not complete():
                    cores = max(1, (os.cpu_count() or 1) - 1)  # one is the readings'
                    prepare(partial(self._report_progress, report), cancelled, self._reached, cores, _BESIDE)
                loading.result()
        finally:
            # what is loaded now stays: collecting garbage among it would stop every thread for 0.1 s
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

"""Compile all kernels in several processes at once, those that a first shot needs first."""

import contextlib
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from multiprocessing.context import SpawnProcess

from analysis.compiled import cache_folder, whole_program
from analysis.shot import Cancelled, Progress, Stop
from app.session import warm_up
from instrument.process import lower_priority

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

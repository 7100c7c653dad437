"""Everything compiled, in several processes at once: stretches of the program's road, what a first shot needs first."""

import contextlib
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from multiprocessing.context import SpawnProcess

from analysis.compiled import kernel_cache
from analysis.shot.shot import Cancelled
from app.session import rehearsal
from app.session.jobs import Asked, Report
from instrument.process.messages import lower_priority

_LOOK_S = 0.05


class Stage(StrEnum):
    """What is compiled by when, in this order; each is also the name of the mark that says it is on disk."""

    READINGS = "readings"  # the numbers of a first shot that need no model
    FIT = "first-shot"  # all its numbers
    ALL = "complete"


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch that one process compiles; it begins ``after`` the piece whose kernels it needs, too."""

    name: str
    work: Callable[[], object]
    stage: Stage
    after: str = ""


BENCH = Piece("the simulated bench", rehearsal.bench, Stage.READINGS)
READINGS = Piece("the readings", rehearsal.readings, Stage.READINGS)
LATER = (
    Piece("the model", rehearsal.fit, Stage.FIT),
    Piece("the effects", rehearsal.effects, Stage.ALL),
    Piece("the diagnosis", rehearsal.diagnosis, Stage.ALL, after="the model"),
)
PIECES = (READINGS, BENCH, *LATER)


def rehearse() -> None:
    """Load what a shot needs as far as it is on disk, and compile what its readings need if that is not."""
    rehearsal.readings()
    if complete(Stage.FIT):
        rehearsal.fit()


def complete(stage: Stage = Stage.ALL) -> bool:
    """Return whether the kernels were compiled up to a stage by just this program, Python, numba and processor."""
    now = kernel_cache.whole_program()
    return any(_mark(reached) == now for reached in tuple(Stage)[tuple(Stage).index(stage) :])


def mark_complete(stage: Stage = Stage.ALL) -> None:
    """Write down that this program's kernels are on disk up to a stage."""
    with contextlib.suppress(OSError):  # then the next start looks again, and finds them
        (kernel_cache.cache_folder() / stage).write_text(kernel_cache.whole_program(), encoding="utf-8")


def prepare(
    report: Report,
    cancelled: Asked,
    ready: Callable[[Stage], None] = lambda stage: None,
    at_once: int | None = None,
    pieces: Sequence[Piece] = PIECES,
) -> bool:
    """Compile the pieces, ``at_once`` processes at a time (a core each); return whether all went well.

    ``ready`` is called with each stage that is reached.  Raises Cancelled; no process stays.
    """
    width = at_once or os.cpu_count() or 1
    waiting, running, well = list(pieces), dict[Piece, SpawnProcess](), True
    stages = list(dict.fromkeys(piece.stage for piece in pieces))
    try:
        while waiting or running:
            for piece in list(waiting):
                if len(running) < width and piece.after not in {other.name for other in (*waiting, *running)}:
                    waiting.remove(piece)
                    running[piece] = _started(piece)
            for piece in [piece for piece, process in running.items() if not process.is_alive()]:
                well &= running.pop(piece).exitcode == 0
            left = [*running, *waiting]
            while stages and not any(piece.stage is stages[0] for piece in left):
                if well:
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
    return well


def prepare_first_shot(report: Report, ready: Callable[[Stage], None]) -> None:
    """Compile what a simulated shot needs, on all cores, where that is not on disk yet.

    ``ready`` is called with each stage that is reached, and where it cannot be: it is then compiled when needed.
    """
    try:
        if not complete(Stage.FIT):
            prepare(report, lambda: False, ready, pieces=[piece for piece in PIECES if piece.stage is not Stage.ALL])
    finally:
        for stage in (Stage.READINGS, Stage.FIT):
            ready(stage)


def _mark(stage: Stage) -> str:
    try:
        return (kernel_cache.cache_folder() / stage).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _started(piece: Piece) -> SpawnProcess:
    process = multiprocessing.get_context("spawn").Process(target=_compile, args=(piece,), daemon=True)
    process.start()
    return process


def _compile(piece: Piece) -> None:
    # samples and screen come first, then a first shot's numbers
    lower_priority(5 if piece.stage is Stage.READINGS else 19)
    try:
        piece.work()
    except Exception as error:
        print(f"levimass: {piece.name}: {' '.join(str(error).split())}", file=sys.stderr)
        raise SystemExit(1) from None

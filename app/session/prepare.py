"""Everything compiled, in several processes at once: pieces of the program's road, what a first shot needs first.

A piece starts at a place of its own on the road, with a motion made up here where it needs one, so that no piece waits
for another and few kernels are compiled twice; all find their kernels in the cache afterwards.
"""

import contextlib
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.context import SpawnProcess

import numpy as np

from analysis import kernel_cache
from analysis.motion import Motion
from analysis.shot import AnalysisSettings, Cancelled, Shot
from app.session.jobs import Asked, Report
from app.session.load import load_and_analyse
from instrument.apart.give_way import give_way
from instrument.live import warm

_LOOK_S = 0.05
_FIRST_SHOT = "first-shot"  # the mark that what a shot needs is there
_MASS_KG, _SPEED_M_PER_S, _CONTACT_S, _RATE_HZ = 0.02, 0.1, 4e-3, 100e3


def run_once(with_diagnosis: bool = False) -> None:
    """Run the whole road once over a short simulated shot; what comes out is thrown away.

    The shot goes over the disk, as a kernel for arrays that are only read is another one than for arrays of its own.
    """
    from instrument.bench.simulate import simulate

    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        (path,) = simulate(folder, 1, duration_s=0.05)
        shot = load_and_analyse(path)
        if with_diagnosis and shot.motion is not None:
            _diagnosed(shot.motion)


def _bench() -> None:
    from instrument.bench.simulate import simulate

    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        simulate(folder, 1, duration_s=0.05)


def _model() -> None:
    from analysis.model.exact import solve
    from analysis.model.parameters import PAPER

    solve(PAPER, np.array([0.0, PAPER.contact_time_estimate_s]), derivatives=True)


def _readings() -> Shot:
    from analysis.pipeline import analyse_motion

    return analyse_motion(_bounce(), AnalysisSettings(fit=False), name="bounce")


def _diagnosis() -> None:
    _diagnosed(_bounce())


def _diagnosed(motion: Motion) -> None:
    from analysis.diagnosis import diagnose

    diagnose([motion])


def _effects() -> None:
    from analysis.model.effects import CATALOGUE
    from analysis.model.effects.kernel import address, complex_address

    for row in CATALOGUE.values():
        for kernel in {row.kernel, row.locked} - {None}:
            if kernel is not None:
                address(kernel)
                complex_address(kernel)


def _bounce() -> Motion:
    """Return the motion of a block that meets a spring and leaves it a little slower, with nanometres of noise."""
    from analysis.signal.record import motion_from_displacement

    t = np.arange(-2000, 2000) / _RATE_HZ
    inside = _SPEED_M_PER_S * _CONTACT_S / np.pi * np.sin(np.pi * np.clip(t, 0, _CONTACT_S) / _CONTACT_S)
    x = inside + _SPEED_M_PER_S * (np.minimum(t, 0) - 0.95 * np.maximum(t - _CONTACT_S, 0))
    x = np.random.default_rng(1).normal(0, 1e-9, t.size) - x  # it comes in against the axis
    return motion_from_displacement(t, x, None, None, moving_mass_kg=_MASS_KG)


@dataclass(frozen=True, slots=True)
class _Piece:
    name: str
    work: Callable[[], object]
    first: bool  # needed by the first shot
    joins: bool = False  # goes over what the other first ones compiled, and begins after them


PIECES = (  # the longest first, so that two processes end with what a first shot needs at about the same time
    _Piece("the model", _model, True),
    _Piece("the simulated bench", _bench, True),
    _Piece("the signal", warm, True),
    _Piece("the readings", _readings, True),
    _Piece("a whole shot", run_once, True, joins=True),
    _Piece("the effects", _effects, False),
    _Piece("the diagnosis", _diagnosis, False),
)


def complete(what: str = "complete") -> bool:
    """Return whether the kernels were all compiled by just this program, Python, numba and processor."""
    try:
        return (kernel_cache.root() / what).read_text(encoding="utf-8") == kernel_cache.whole_program()
    except (OSError, UnicodeDecodeError):
        return False


def mark_complete(what: str = "complete") -> None:
    """Write down that this program's kernels are all on disk."""
    with contextlib.suppress(OSError):  # then the next start looks again, and finds them
        (kernel_cache.root() / what).write_text(kernel_cache.whole_program(), encoding="utf-8")


def prepare(
    report: Report, cancelled: Asked, first_are_ready: Callable[[], None] = lambda: None, at_once: int | None = None
) -> bool:
    """Compile every piece, ``at_once`` processes at a time (a core each); return whether all went well.

    ``first_are_ready`` is called once what a first shot needs is there.  Raises Cancelled; no process stays.
    """
    if _compiled(PIECES, report, cancelled, first_are_ready, at_once):
        mark_complete()
        return True
    return False


def prepare_first_shot(report: Report) -> None:
    """Compile what a shot needs, on all cores, where that is not on disk yet; what fails is compiled when needed."""
    if complete() or complete(_FIRST_SHOT):
        return
    if _compiled([p for p in PIECES if p.first and not p.joins], report, lambda: False, lambda: None, None):
        mark_complete(_FIRST_SHOT)


def _compiled(
    pieces: Sequence[_Piece], report: Report, cancelled: Asked, first_are_ready: Callable[[], None], at_once: int | None
) -> bool:
    """Compile these; a piece that joins the first ones begins when they end, whatever else is under way then."""
    width = at_once or os.cpu_count() or 1
    waiting, running, well = list(pieces), dict[_Piece, SpawnProcess](), True
    told = False
    try:
        while waiting or running:
            for piece in list(waiting):
                if not any(p.first for p in running) if piece.joins else len(running) < width:
                    waiting.remove(piece)
                    running[piece] = _started(piece)
            for piece in [piece for piece, process in running.items() if not process.is_alive()]:
                well &= running.pop(piece).exitcode == 0
            left = [*waiting, *running]
            if not told and not any(piece.first for piece in left):
                told = True
                first_are_ready()
            if left:
                report(f"compiling {left[0].name}", 1.0 - len(left) / len(pieces))
                if cancelled():
                    raise Cancelled
                time.sleep(_LOOK_S)
    finally:
        for process in running.values():
            process.kill()
    return well


def _started(piece: _Piece) -> SpawnProcess:
    process = multiprocessing.get_context("spawn").Process(target=_compile, args=(PIECES.index(piece),), daemon=True)
    process.start()
    return process


def _compile(piece: int) -> None:
    give_way(5)  # samples and screen come first
    try:
        PIECES[piece].work()
    except Exception as error:
        print(f"levimass: {PIECES[piece].name}: {' '.join(str(error).split())}", file=sys.stderr)
        raise SystemExit(1) from None

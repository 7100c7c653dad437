"""Kernels made ready while the window opens: compiled in a process of their own, so that no frame waits for a compiler.

The first start after an installation compiles for some ten seconds; the result is kept on disk, and every later start
only loads it.
"""

import contextlib
import gc
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from analysis import kernel_cache
from analysis.diagnosis import diagnose
from analysis.shot import Cancelled
from app.session.jobs import Asked, Report
from app.session.load import load_and_analyse
from instrument.bench.simulate import simulate
from instrument.live import warm

_LOOK_S = 0.05


def run_once(with_diagnosis: bool = False) -> None:
    """Run the whole road once over a short simulated shot; what comes out is thrown away.

    The shot goes over the disk, as a kernel for arrays that are only read is another one than for arrays of its own.
    """
    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        (path,) = simulate(folder, 1, duration_s=0.05)
        shot = load_and_analyse(path)
        if with_diagnosis and shot.motion is not None:
            diagnose([shot.motion])


class Kernels:
    """Whether the kernels are ready, for whoever is about to need them."""

    def __init__(self, then: Sequence[Callable[[], None]] = ()) -> None:
        """``then`` are called once they are on disk: what loads them elsewhere need not compile them.

        With any, the shots' analysis is done elsewhere: what the running stream needs is all that is loaded here.
        """
        self._ready = threading.Event()
        self._then = then

    def work(self, report: Report, cancelled: Asked) -> None:
        """Make them ready; a job.  Where the other process fails they are compiled here, when they are needed."""
        try:
            if not _on_disk():
                report("compiling, at the first start only", 0.2)
                _in_another_process(cancelled)
            for begin in self._then:
                begin()
            report("loading", 0.8)
            if not cancelled():
                warm() if self._then else run_once()
        finally:
            # what is loaded by now stays to the end; looking through it for garbage stopped every thread for 0.1 s
            gc.freeze()
            self._ready.set()

    def wait(self, cancelled: Asked) -> None:
        """Return when they are ready.  Raises Cancelled."""
        while not self._ready.wait(_LOOK_S):
            if cancelled():
                raise Cancelled


def _on_disk() -> bool:
    """Return whether the kernels were all compiled by just this program, Python, numba and processor."""
    try:
        return _mark().read_text(encoding="utf-8") == kernel_cache.whole_program()
    except (OSError, UnicodeDecodeError):
        return False


def _mark() -> Path:
    return kernel_cache.root() / "complete"


def _in_another_process(cancelled: Asked) -> None:
    house = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join(filter(None, (house, os.environ.get("PYTHONPATH"))))
    quiet = subprocess.DEVNULL
    with subprocess.Popen(
        [sys.executable, "-m", "app.session.warm"],
        env=os.environ | {"PYTHONPATH": paths},
        stdin=quiet,
        stdout=quiet,
        stderr=quiet,
    ) as process:
        while process.poll() is None:
            if cancelled():
                process.kill()
                raise Cancelled
            threading.Event().wait(_LOOK_S)


def main() -> int:
    """Compile everything into the cache, politely, and mark it as complete."""
    if hasattr(os, "nice"):
        os.nice(5)
    run_once(with_diagnosis=True)
    with contextlib.suppress(OSError):
        _mark().write_text(kernel_cache.whole_program(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

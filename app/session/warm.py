"""Kernels made ready while the window opens: compiled in processes of their own, so that no frame waits for a compiler.

The first start after an installation compiles for a minute or two of one core, what the first shot needs first; the
result is kept on disk, and every later start only loads it.
"""

import gc
import threading
from collections.abc import Callable, Sequence

from analysis.shot import Cancelled
from app.session.jobs import Asked, Report
from app.session.prepare import complete, prepare, run_once
from instrument.live import warm

_LOOK_S = 0.05


class Kernels:
    """Whether the kernels are ready, for whoever is about to need them."""

    def __init__(self, then: Sequence[Callable[[], None]] = ()) -> None:
        """``then`` are called once they are on disk: what loads them elsewhere need not compile them.

        With any, the shots' analysis is done elsewhere: what the running stream needs is all that is loaded here.
        """
        self._ready = threading.Event()
        self._then = then

    def work(self, report: Report, cancelled: Asked) -> None:
        """Make them ready; a job.  Where the other processes fail they are compiled here, when they are needed."""
        try:
            if complete():
                self._load(report, cancelled)
            else:
                prepare(report, cancelled, lambda: self._load(report, cancelled))
        finally:
            # what is loaded by now stays to the end; looking through it for garbage stopped every thread for 0.1 s
            gc.freeze()
            self._ready.set()

    def wait(self, cancelled: Asked) -> None:
        """Return when what a first shot needs is ready.  Raises Cancelled."""
        while not self._ready.wait(_LOOK_S):
            if cancelled():
                raise Cancelled

    def _load(self, report: Report, cancelled: Asked) -> None:
        for begin in self._then:
            begin()
        report("loading", 0.8)
        if not cancelled():
            warm() if self._then else run_once()
        self._ready.set()

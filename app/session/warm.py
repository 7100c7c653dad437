"""Kernels made ready while the window opens: compiled in processes of their own, so that no frame waits for a compiler.

The first start after an installation compiles for a minute or two of one core, what a first shot's readings need
first, then its fit, then all else; the result is kept on disk, and every later start only loads it.
"""

import gc
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

from analysis.shot.shot import Cancelled
from app.session.jobs import Asked, Report
from app.session.prepare import BENCH, LATER, Stage, complete, mark_complete, prepare
from app.session.rehearsal import readings
from instrument.process.subprocess_worker import SubprocessWorker

_LOOK_S = 0.05
_BESIDE = (*LATER, replace(BENCH, stage=Stage.ALL))  # the simulated bench compiles its own where it is the source


class Kernels:
    """Whether the kernels are ready, for whoever is about to need them."""

    def __init__(self, analyst: SubprocessWorker | None = None, helper: SubprocessWorker | None = None) -> None:
        """``analyst`` analyses the rig's shots elsewhere: it is started first, and compiles what their readings need.

        ``helper`` does what else is asked for: it is started once it need not compile.  Without them all is done here.
        """
        self._ready = {stage: threading.Event() for stage in Stage}
        self._analyst, self._helper = analyst, helper

    def work(self, report: Report, cancelled: Asked) -> None:
        """Make them ready; a job.  Where the other processes fail they are compiled where they are needed."""
        try:
            with ThreadPoolExecutor(1, "levimass kernels") as beside:
                loading = beside.submit(self._load, cancelled)
                if complete(Stage.FIT):
                    self._reached(Stage.FIT)
                if not complete():
                    cores = max(1, (os.cpu_count() or 1) - 1)  # one is the readings'
                    prepare(partial(self._told, report), cancelled, self._reached, cores, _BESIDE)
                loading.result()
        finally:
            # what is loaded by now stays to the end; looking through it for garbage stopped every thread for 0.1 s
            gc.freeze()
            for ready in self._ready.values():
                ready.set()

    def wait(self, stage: Stage, cancelled: Asked) -> None:
        """Return when a stage is reached.  Raises Cancelled."""
        while not self._ready[stage].wait(_LOOK_S):
            if cancelled():
                raise Cancelled

    def _load(self, cancelled: Asked) -> None:
        """Load what the running stream needs and, without an analyst, what the readings do."""
        if self._analyst is None:
            readings()
        else:
            self._analyst.start()
            if not complete(Stage.READINGS):
                self._analyst.await_ready(cancelled)
                mark_complete(Stage.READINGS)
            from instrument.live.live_thread import warm  # brings the numerics: only now, beside the screen

            warm()
        self._ready[Stage.READINGS].set()

    def _reached(self, stage: Stage) -> None:
        if stage is Stage.FIT and self._helper is not None:
            self._helper.start()
        self._ready[stage].set()

    def _told(self, report: Report, words: str, share: float) -> None:
        first = self._ready[Stage.READINGS].is_set()
        report(words if first else "compiling the readings, at the first start only", share)

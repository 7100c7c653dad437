"""Compile or load the kernels while the window opens, in other processes, so that the screen does not wait.

The first start after an installation compiles for a minute or two: first what a shot's readings need, then its fit,
then the rest.  Later starts load the kernels from disk.
"""

import gc
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

from analysis.shot import Cancelled, Progress, Stop
from app.session.kernel_compilation import BENCH, LATER, Stage, complete, mark_complete, prepare
from app.session.warm_up import readings
from instrument.process import SubprocessWorker

_LOOK_S = 0.05
_BESIDE = (*LATER, replace(BENCH, stage=Stage.ALL))  # the simulated bench compiles its own where it is the source


class Kernels:
    """Makes the kernels ready, and lets others wait for them."""

    def __init__(self, analyst: SubprocessWorker | None = None, helper: SubprocessWorker | None = None) -> None:
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

"""Long work that a test lets go on step by step: whatever is asked for meanwhile meets it half done."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from analysis.shot.motion import Motion
from analysis.shot.shot import Cancelled, Shot
from app.session.load import load_and_analyse
from app.session.workbench import Workbench
from tests.app import synthetic

LONGEST_S = 60.0


class SteppedWork:
    """Stands in for the child process: each piece of work waits here, and its result is made up.

    A shot that is opened or fitted gets the synthetic shot's fit with just the effects that were asked for.
    """

    def __init__(self) -> None:
        self.waits = threading.Event()
        self._go = threading.Event()
        self._heeds = False
        self._closed = False
        self.fitted = synthetic.shot()

    def run(self, work: "partial[Any]", progress: Callable[..., None], cancelled: Callable[[], bool]) -> Shot:
        """Return what the work would return, once the test lets it."""
        self.waits.set()
        assert self._go.wait(LONGEST_S)
        self._go.clear()
        if self._closed or (self._heeds and cancelled()):
            raise Cancelled
        if work.func is load_and_analyse:
            (path,), settings = work.args, work.keywords["settings"]
            wanted = work.keywords["effects_of"](settings.model)
            name = path.name.removesuffix(".csv")
            # a motion of its own, as from another process
            motion = replace(self.fitted.motion) if isinstance(self.fitted.motion, Motion) else None
            shot = replace(self.fitted, name=name, path=str(path), settings=settings, motion=motion)
        else:
            shot, wanted = work.args
        assert shot.fit is not None
        settings = replace(shot.settings, effects=wanted)
        return replace(shot, settings=settings, fit=replace(shot.fit, effects=wanted))

    def step(self, workbench: Workbench, *, heeds: bool) -> None:
        """Let one piece of work end; ``heeds``: one that was cancelled looks in time."""
        if not self._at_rest(workbench):
            return
        self._heeds = heeds
        self.waits.clear()
        self._go.set()
        self._at_rest(workbench)

    def short_jobs_end(self, workbench: Workbench) -> None:
        """Wait until the short jobs are done: only taking their results is left."""
        end = time.monotonic() + LONGEST_S
        while workbench.short_jobs.open_jobs:
            assert time.monotonic() < end, "a short job does not end"
            time.sleep(0.0005)

    def start(self) -> None:
        """Do nothing: there is no process."""

    def close(self) -> None:
        """Let what waits go, for the end."""
        self._closed = True
        self._go.set()

    def _at_rest(self, workbench: Workbench) -> bool:
        """Wait until work stands at the gate, or there is none; return whether some does."""
        end = time.monotonic() + LONGEST_S
        while time.monotonic() < end:
            errands_done = workbench.short_jobs.open_jobs == 0
            if self.waits.is_set() and not self._go.is_set() and errands_done:
                return True
            if workbench.jobs.open_jobs == 0 and errands_done:
                return False
            time.sleep(0.0005)
        raise AssertionError("the work neither ended nor waits")

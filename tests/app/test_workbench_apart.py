"""The workbench's long work in a process of its own: the same shots, fits and diagnosis, with progress and cancel."""

import time
from collections.abc import Callable

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.shot.motion import ARRAYS
from analysis.shot.shot import AnalysisSettings
from app.session.jobs import Event, EventKind
from app.session.load import load_and_analyse
from app.session.session import Session
from app.session.workbench import Workbench
from instrument.bench.simulated_shots import simulate
from instrument.process.subprocess_worker import SubprocessWorker
from tests.child import child_id

LONGEST_S = 120.0


@pytest.fixture(scope="module")
def child():
    apart = SubprocessWorker()
    apart.start()
    yield apart
    apart.close()
    assert child_id(apart) is None


@pytest.fixture(scope="module")
def recordings_of_bench(tmp_path_factory):
    return simulate(tmp_path_factory.mktemp("shots"), 1, duration_s=0.05)


def until(workbench: Workbench, true: Callable[[Event], bool]) -> Event:
    """Return the first event of which ``true`` holds."""
    end = time.monotonic() + LONGEST_S
    while time.monotonic() < end:
        for event in workbench.poll():
            if true(event):
                return event
        time.sleep(0.01)
    raise AssertionError("it never happened")


def test_shots_are_opened_refitted_and_reported_there(child, recordings_of_bench, tmp_path, warm_kernels):
    here, there = (
        Workbench(Session(), AnalysisSettings),
        Workbench(Session(), AnalysisSettings, subprocess_worker=child),
    )
    try:
        for workbench in (here, there):
            assert workbench.open_paths(recordings_of_bench) == 1
            until(workbench, lambda h: h.kind is EventKind.SHOT)
            workbench.model.add("paper", (effect_named("quadratic_drag"),))
            until(workbench, lambda h: h.kind is EventKind.CHANGED and h.numbers == (1,))
        ours, theirs = here.session.entries[0].shot, there.session.entries[0].shot
        for name in ARRAYS:
            assert np.array_equal(getattr(theirs.motion, name), getattr(ours.motion, name), equal_nan=True)
            assert not getattr(theirs.motion, name).flags.writeable
        assert theirs.fit.effects == ours.fit.effects == (effect_named("quadratic_drag"),)
        assert theirs.fit.reduced_chi2 == ours.fit.reduced_chi2
        # What `--replay --model FILE` says of this shot is what the window says after the effect is added.
        replayed = load_and_analyse(
            recordings_of_bench[0], settings=AnalysisSettings(effects=(effect_named("quadratic_drag"),))
        )
        for shot in (ours, theirs):
            assert (shot.impact, shot.flags, shot.settings) == (replayed.impact, replayed.flags, replayed.settings)
            assert shot.fit.parameters == replayed.fit.parameters

        there.exports.report([1], tmp_path / "report.html")
        done = until(there, lambda h: h.kind in (EventKind.EXPORTED, EventKind.PROBLEM))
        assert done.kind is EventKind.EXPORTED and (tmp_path / "report.html").stat().st_size > 10_000
        there.exports.report_to_print([1])
        printed = until(there, lambda h: h.kind in (EventKind.PRINT, EventKind.PROBLEM))
        assert printed.kind is EventKind.PRINT and theirs.name in printed.words
        there.exports.export([1], tmp_path / "missing" / "\0")
        assert until(there, lambda h: h.kind in (EventKind.EXPORTED, EventKind.PROBLEM)).kind is EventKind.PROBLEM
    finally:
        assert here.jobs.close() and here.short_jobs.close()
        assert there.jobs.close() and there.short_jobs.close()


def test_a_diagnosis_there_tells_how_far_it_is_and_is_cancelled(child, recordings_of_bench, warm_kernels):
    workbench = Workbench(Session(), AnalysisSettings, subprocess_worker=child)
    try:
        workbench.open_paths(recordings_of_bench)
        until(workbench, lambda h: h.kind is EventKind.SHOT)
        workbench.diagnose([1])
        job = workbench.jobs.current
        while job is None or job.kind != "diagnosis" or not job.what:
            time.sleep(0.005)
            job = workbench.jobs.current
        alive = child_id(child)
        job.cancel()
        assert job.done.wait(LONGEST_S) and job.result is None and job.problem is None
        assert child_id(child) == alive  # it heeded; it was not ended
        assert workbench.diagnoses.newest is None
    finally:
        assert workbench.jobs.close() and workbench.short_jobs.close()

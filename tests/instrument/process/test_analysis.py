"""Shots analysed in a subprocess give the same results; if it dies, one shot fails with a message."""

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from analysis.fitted.fitted_shot import fit_pending
from analysis.pipeline import analyse, read
from analysis.shot.motion import ARRAYS
from analysis.shot.recording import Recording, Setup
from analysis.shot.shot import AnalysisError, AnalysisSettings, Cancelled, Progress, Shot
from instrument.bench.simulated_shots import simulate
from instrument.files.recording_file import open_recording, read_recording
from instrument.files.recording_writer import write_recording
from instrument.process import subprocess_worker
from instrument.process.subprocess_worker import SubprocessAnalysis
from tests.child import child_id

PLAIN = AnalysisSettings()


def quiet(what: str, share: float) -> None:
    """Take progress and tell nobody."""


def never() -> bool:
    """Let the analysis go on."""
    return False


def who(*, progress: Progress, cancelled: Callable[[], bool]) -> int:
    """Return the process that this runs in."""
    return os.getpid()


def echo(what: object, *, progress: Progress, cancelled: Callable[[], bool]) -> object:
    """Return what it is given."""
    return what


@pytest.fixture(scope="module")
def apart() -> Iterator[SubprocessAnalysis]:
    """Return one child for all tests."""
    child = SubprocessAnalysis()
    yield child
    child.close()
    assert child_id(child) is None


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return a shot on disk."""
    return open_recording(simulate(tmp_path_factory.mktemp("shots"), 1, duration_s=0.05)[0])


def same(one: object, other: object) -> bool:
    """Return whether two shots' numbers are equal to the last bit."""
    return repr(one) == repr(other)


def test_a_shot_comes_out_as_it_would_here(apart: SubprocessAnalysis, simulated: Recording) -> None:
    told: list[tuple[str, float]] = []
    there = apart.read(simulated, PLAIN, lambda *news: told.append(news), never)
    assert there.impact is not None and there.fit is None and fit_pending(there)
    assert same(there.impact, read(simulated, PLAIN).impact)
    there = apart.fit(there, lambda *news: told.append(news), never)
    assert not fit_pending(there)
    here = analyse(simulated, PLAIN)
    assert here.impact is not None
    assert there.motion is not None
    assert there.fit is not None and here.fit is not None
    there, here = (replace(s, fit=replace(s.fit, seconds=0.0)) for s in (there, here))
    for name in ARRAYS:
        assert np.array_equal(getattr(there.motion, name), getattr(here.motion, name), equal_nan=True)
        assert not getattr(there.motion, name).flags.writeable
    for field in fields(Shot):
        if field.name not in ("motion", "seconds", "setup"):
            assert same(getattr(there, field.name), getattr(here, field.name)), field.name
    assert here.setup is not None
    assert there.setup == replace(here.setup, extra=dict(here.setup.extra))
    assert told


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="read from Linux's list of processes")
def test_the_child_gives_way_to_samples_and_screen_and_leaves_ctrl_c_to_its_parent(apart: SubprocessAnalysis) -> None:
    child = apart.run(who, quiet, never)
    assert child == child_id(apart) != os.getpid()
    assert os.getpriority(os.PRIO_PROCESS, child) == min(19, os.getpriority(os.PRIO_PROCESS, 0) + 10)
    assert os.sched_getscheduler(child) == os.SCHED_BATCH
    status = dict(line.split(":\t") for line in Path(f"/proc/{child}/status").read_text().splitlines())
    assert int(status["SigIgn"], 16) & 1 << (signal.SIGINT - 1)


def test_what_is_known_of_a_rig_travels_to_the_child_and_back(apart: SubprocessAnalysis) -> None:
    """A shot that is only in memory is fitted there with the setup that it was taken with."""
    for setup in (Setup(0.01), Setup(0.01, extra=MappingProxyType({"moving_mass_assumed": True}))):
        again = apart.run(partial(echo, setup), quiet, never)
        assert again == setup and again.extra == setup.extra and type(again.extra) is MappingProxyType


def test_altered_data_are_flagged_there_too(apart: SubprocessAnalysis, simulated: Recording, tmp_path: Path) -> None:
    short = replace(simulated, counts=simulated.counts[:3000], trigger_sample=None)
    shot = read_recording(write_recording(short, tmp_path / "s"))
    data = tmp_path / "s.sigmf-data"
    data.write_bytes(bytes([data.read_bytes()[0] ^ 1]) + data.read_bytes()[1:])
    assert "data_altered" in apart.read(shot, PLAIN, quiet, never).flags


def test_an_analysis_is_cancelled_there_too(apart: SubprocessAnalysis, simulated: Recording) -> None:
    apart.read(simulated, PLAIN, quiet, never)  # by now there is a child that answers, whichever test comes first
    child = child_id(apart)
    with pytest.raises(Cancelled):
        apart.read(simulated, PLAIN, quiet, lambda: True)
    assert child is not None and child_id(apart) == child  # it heeds, and need not be started anew


def test_what_is_wrong_with_a_recording_is_its_own_sentence(apart: SubprocessAnalysis, shot: Recording) -> None:
    with pytest.raises(AnalysisError, match="gone"):
        apart.read(replace(shot, path="/no/such/gone.sigmf-meta"), PLAIN, quiet, never)


def test_a_shot_that_is_only_in_memory_is_read_here(apart: SubprocessAnalysis, shot: Recording) -> None:
    assert same(apart.read(shot, PLAIN, quiet, never).problem, analyse(shot, PLAIN).problem)


def test_a_child_that_dies_costs_a_shot_and_the_next_has_another(
    apart: SubprocessAnalysis, shot: Recording, tmp_path: Path
) -> None:
    saved = open_recording(write_recording(shot, tmp_path / "shot"))
    apart.start()
    child = child_id(apart)
    assert child is not None
    os.kill(child, signal.SIGKILL)
    with pytest.raises(AnalysisError, match="process ended by itself"):
        apart.read(saved, PLAIN, quiet, never)
    assert apart.read(saved, PLAIN, quiet, never).problem == analyse(saved, PLAIN).problem


def test_a_child_that_heeds_no_cancelling_is_ended_and_the_next_shot_has_another(
    apart: SubprocessAnalysis, simulated: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subprocess_worker, "CANCEL_S", 0.2)
    apart.start()
    child = child_id(apart)
    assert child is not None
    os.kill(child, signal.SIGSTOP)  # as good as starved by other programs
    with pytest.raises(Cancelled):
        apart.read(simulated, PLAIN, quiet, lambda: True)
    assert child_id(apart) is None
    assert apart.read(simulated, PLAIN, quiet, never).motion is not None

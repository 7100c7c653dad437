"""The mark that says the kernels are on disk, true only for what wrote it; and what compiles them."""

import subprocess
import sys
import threading
import time
from functools import partial

import llvmlite
import numba
import pytest

from analysis.compiled import kernel_cache
from analysis.shot.shot import AnalysisSettings, Cancelled
from app.command_line.cli import main
from app.session import kernels as kernels_module
from app.session.rig import Rig
from instrument.bench.simulated_shots import simulate
from instrument.bench.site import USUAL_SITE, site_named
from instrument.capture.acquisition import Deadlines, State
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from tests.app import rigs

COMPLETE = kernels_module.complete  # as it is without the fixture of all windows


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kernels_module, "complete", COMPLETE)
    monkeypatch.setattr(kernel_cache, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(kernels_module, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(kernels_module, "readings", lambda: None)
    return tmp_path


class AtOnce:
    """A process that has ended when it is started, and says in which order."""

    started: list[str] = []  # noqa: RUF012 - emptied by each test

    exit_code = 0

    def __init__(self, name, main, piece) -> None:
        assert name == piece.name
        self.started.append(name)


@pytest.fixture
def order(monkeypatch):
    AtOnce.started.clear()
    monkeypatch.setattr(kernels_module, "WorkerProcess", AtOnce)
    return AtOnce.started


def quietly(words: str, share: float) -> None:
    assert 0.0 <= share <= 1.0


def test_the_mark_holds_for_the_program_that_wrote_it(folder):
    assert not kernels_module.complete()
    kernels_module.mark_complete()
    assert kernels_module.complete()


@pytest.mark.parametrize("what", [numba, llvmlite])
def test_another_numba_does_not_trust_it(folder, monkeypatch, what):
    kernels_module.mark_complete()
    monkeypatch.setattr(what, "__version__", "999.0")
    assert not kernels_module.complete()


def test_a_mark_that_says_nothing_or_nonsense_is_none(folder):
    (folder / kernels_module.Stage.ALL).touch()  # as an older version of the program left it
    assert not kernels_module.complete()
    (folder / kernels_module.Stage.ALL).write_bytes(b"\xff\xfe")
    assert not kernels_module.complete()


def test_a_mark_holds_for_what_comes_before_it_and_not_for_what_comes_after(folder):
    kernels_module.mark_complete(kernels_module.Stage.FIT)
    assert kernels_module.complete(kernels_module.Stage.READINGS) and kernels_module.complete(kernels_module.Stage.FIT)
    assert not kernels_module.complete()


def test_what_is_not_on_disk_is_compiled_elsewhere_and_only_once(folder, order, monkeypatch):
    read_here = []
    monkeypatch.setattr(kernels_module, "readings", lambda: read_here.append(len(order)))
    for _ in range(2):
        kernels = kernels_module.Kernels()
        kernels.work(quietly, lambda: False)
        for stage in kernels_module.Stage:
            kernels.wait(stage, lambda: True)
    assert sorted(order) == sorted(
        piece.name for piece in kernels_module.PIECES if piece is not kernels_module.READINGS
    )
    assert len(read_here) == 2


@pytest.mark.parametrize("at_once", [1, 2, 8])
def test_what_a_first_shot_needs_comes_first(folder, order, at_once):
    reached = []
    assert kernels_module.prepare(quietly, lambda: False, lambda stage: reached.append((stage, len(order))), at_once)
    assert [stage for stage, _ in reached] == list(kernels_module.Stage)
    stages = [next(piece.stage for piece in kernels_module.PIECES if piece.name == name) for name in order]
    assert stages == sorted(stages, key=list(kernels_module.Stage).index)
    assert order.index("the diagnosis") > order.index("the model")  # which it goes over: compiled once
    assert kernels_module.complete()


def test_in_processes_of_their_own_and_none_stays(folder, monkeypatch):
    processes = []
    start = kernels_module.WorkerProcess
    monkeypatch.setattr(kernels_module, "WorkerProcess", lambda *of: processes.append(start(*of)) or processes[-1])
    with pytest.raises(Cancelled):
        kernels_module.prepare(quietly, lambda: True, at_once=2)
    assert len(processes) == 2
    assert all(process.over and process.exit_code is not None for process in processes)
    assert not kernels_module.complete()


def test_what_could_not_be_compiled_leaves_no_mark_and_is_told(folder, order, monkeypatch, capsys):
    monkeypatch.setattr(AtOnce, "exit_code", 1)
    assert main(["--prepare"]) == 1
    assert "not all kernels could be compiled" in capsys.readouterr().err
    assert not kernels_module.complete()


def test_prepare_compiles_once(folder, order, capsys):
    assert main(["--prepare", "--jobs", "2"]) == 0
    assert "100" not in capsys.readouterr().err  # a share is of what is left, and at its end it is told in one line
    assert main(["--prepare"]) == 0
    assert "already" in capsys.readouterr().out
    assert len(order) == len(kernels_module.PIECES)


def test_what_a_shot_without_a_window_needs_is_compiled_once(folder, order):
    for _ in range(2):
        reached = []
        kernels_module.prepare_first_shot(quietly, reached.append)
        assert list(dict.fromkeys(reached)) == [kernels_module.Stage.READINGS, kernels_module.Stage.FIT]
    assert order == [piece.name for piece in kernels_module.PIECES if piece.stage is not kernels_module.Stage.ALL]
    assert not kernels_module.complete()


def test_the_process_that_analyses_loads_the_fit_where_it_is_on_disk_and_leaves_its_compiling_to_others(
    folder, monkeypatch
):
    loaded = []
    for name in ("readings", "fit"):
        monkeypatch.setattr(kernels_module.warm_up, name, partial(loaded.append, name))
    kernels_module.warm_up_analysis()
    assert loaded == ["readings"]
    kernels_module.mark_complete(kernels_module.Stage.FIT)
    kernels_module.warm_up_analysis()
    assert loaded == ["readings", "readings", "fit"]


NEW_KERNELS = """
import gc, sys
from numba.core.registry import CPUDispatcher
from analysis.pipeline import fitted, read
from app.session import warm_up
from instrument.files.recording_file import open_recording

def known():
    each = (kernel for kernel in gc.get_objects() if isinstance(kernel, CPUDispatcher))
    return {f"{kernel.py_func.__module__}.{kernel.py_func.__name__}{s}" for kernel in each for s in kernel.overloads}

warm_up.readings()
before = known()
shot = read(open_recording(sys.argv[1]))
assert shot.problem is None and shot.impact.disturbance is not None
print(*sorted(known() - before), sep="\\n")
warm_up.fit()
before = known()
assert fitted(shot).fit.converged
print(*sorted(known() - before), sep="\\n")
"""


def test_a_shot_in_a_usual_laboratory_needs_no_kernel_that_was_not_warmed_up(tmp_path, warm_kernels):
    (path,) = simulate(tmp_path, 1, site=site_named(USUAL_SITE))
    asked = subprocess.run([sys.executable, "-c", NEW_KERNELS, path], capture_output=True, text=True, check=True)
    assert asked.stdout.split() == []


def test_a_shot_taken_while_kernels_compile_tells_its_readings_before_its_fit(tmp_path, warm_kernels):
    """It waits for each as long as that takes; compiling may take longer than any analysis is given."""
    compiled = {stage: threading.Event() for stage in kernels_module.Stage}

    def options(_, digitizer):
        return CaptureOptions(tmp_path, CaptureSettings(10e6, 600_000, 60_000))

    def wait(stage, given_up):
        if threading.current_thread().name == "levimass capture":
            return  # what the stream needs is there
        while not compiled[stage].wait(0.02):
            if given_up():
                raise Cancelled

    later_s = 0.0

    def waits_for_minutes():
        nonlocal later_s
        for _ in range(30):
            later_s += 5.0  # the capture's thread may be a dozen looks behind, no more
            time.sleep(0.05)
            assert rig.latest().state is State.ANALYSING, rig.latest().message
        assert "compiling" in (rig.latest().doing or "")

    def clock():
        return time.monotonic() + later_s

    def analysed_shots(rig):
        return [shot for shot in rig.take_shots(rig.latest()) if not shot.waits]

    rig = Rig(options, AnalysisSettings, wait, deadlines=Deadlines(), open_digitizer=rigs.quick_bench, clock=clock)
    try:
        _until(lambda: rig.latest().state is State.IDLE and rig.channels != ())
        rig.arm()
        _until(lambda: rig.latest().state is State.ANALYSING)
        waits_for_minutes()
        compiled[kernels_module.Stage.READINGS].set()
        _until(lambda: bool(rig.latest().finished))
        (finished,) = analysed_shots(rig)
        assert finished.shot is not None and finished.shot.impact is not None
        assert finished.shot.fit is None and "fit_to_follow" in finished.shot.flags
        assert analysed_shots(rig) == []
        waits_for_minutes()
        compiled[kernels_module.Stage.FIT].set()
        _until(lambda: rig.latest().state is State.IDLE)
        (again,) = analysed_shots(rig)
        assert again.number == finished.number and again.shot is not None
        assert again.shot.fit is not None and again.shot.fit.converged and "fit_to_follow" not in again.shot.flags
        assert again.shot.impact is not None
        assert again.shot.impact.velocity_in_m_per_s == finished.shot.impact.velocity_in_m_per_s
    finally:
        for event in compiled.values():
            event.set()
        rig.close()


def _until(true, longest_s=60.0):
    end = time.monotonic() + longest_s
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)

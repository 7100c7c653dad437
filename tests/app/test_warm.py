"""The mark that says the kernels are on disk, true only for what wrote it; and what compiles them."""

import threading
import time

import llvmlite
import numba
import pytest

from analysis import kernel_cache
from analysis.shot import AnalysisSettings, Cancelled
from app.command_line.cli import main
from app.session import prepare, warm
from app.session.rig import Rig
from instrument.acquisition import Deadlines, State
from instrument.capture_options import CaptureOptions
from instrument.digitizer import CaptureSettings
from tests.app import rigs


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "root", lambda: tmp_path)
    monkeypatch.setattr(warm, "run_once", lambda: None)
    return tmp_path


class AtOnce:
    """A process that has ended when it is started, and says in which order."""

    started: list[str] = []  # noqa: RUF012 - emptied by each test

    def __init__(self, piece) -> None:
        self.started.append(piece.name)
        self.exitcode = 0

    def is_alive(self) -> bool:
        return False


@pytest.fixture
def order(monkeypatch):
    AtOnce.started.clear()
    monkeypatch.setattr(prepare, "_started", AtOnce)
    return AtOnce.started


def quietly(words: str, share: float) -> None:
    assert 0.0 <= share <= 1.0


def test_the_mark_holds_for_the_program_that_wrote_it(folder):
    assert not prepare.complete()
    prepare.mark_complete()
    assert prepare.complete()


@pytest.mark.parametrize("what", [numba, llvmlite])
def test_another_numba_does_not_trust_it(folder, monkeypatch, what):
    prepare.mark_complete()
    monkeypatch.setattr(what, "__version__", "999.0")
    assert not prepare.complete()


def test_a_mark_that_says_nothing_or_nonsense_is_none(folder):
    (folder / "complete").touch()  # as an older version of the program left it
    assert not prepare.complete()
    (folder / "complete").write_bytes(b"\xff\xfe")
    assert not prepare.complete()


def test_what_is_not_on_disk_is_compiled_elsewhere_and_only_once(folder, order):
    for _ in range(2):
        warm.Kernels().work(quietly, lambda: False)
    assert sorted(order) == sorted(piece.name for piece in prepare.PIECES)


def test_what_a_first_shot_needs_comes_first(folder, order):
    begun = []
    assert prepare.prepare(quietly, lambda: False, lambda: begun.append(len(order)), at_once=1)
    firsts = [piece.name for piece in prepare.PIECES if piece.first]
    assert set(order[: begun[0]]) == set(firsts)
    assert order[len(firsts) - 1] == next(piece.name for piece in prepare.PIECES if piece.joins)


def test_in_processes_of_their_own_and_none_stays(folder, monkeypatch):
    processes = []
    start = prepare._started
    monkeypatch.setattr(prepare, "_started", lambda piece: processes.append(start(piece)) or processes[-1])
    with pytest.raises(Cancelled):
        prepare.prepare(quietly, lambda: True, at_once=2)
    assert len(processes) == 2
    for process in processes:
        process.join(10)
        assert not process.is_alive()
    assert not prepare.complete()


def test_what_could_not_be_compiled_leaves_no_mark_and_is_told(folder, order, monkeypatch, capsys):
    monkeypatch.setattr(AtOnce, "is_alive", lambda self: setattr(self, "exitcode", 1))
    assert main(["--prepare"]) == 1
    assert "not everything could be compiled" in capsys.readouterr().err
    assert not prepare.complete()


def test_prepare_compiles_once(folder, order, capsys):
    assert main(["--prepare", "--jobs", "2"]) == 0
    assert "100" not in capsys.readouterr().err  # a share is of what is left, and at its end it is told in one line
    assert main(["--prepare"]) == 0
    assert "already" in capsys.readouterr().out
    assert len(order) == len(prepare.PIECES)


def test_what_a_shot_without_a_window_needs_is_compiled_once(folder, order):
    for _ in range(2):
        prepare.prepare_first_shot(quietly)
    assert order == [piece.name for piece in prepare.PIECES if piece.first and not piece.joins]
    assert not prepare.complete()


def test_the_made_up_bounce_is_one(warm_kernels):
    shot = prepare._readings()
    assert shot.problem is None
    assert shot.impact is not None


def test_a_shot_taken_while_kernels_compile_waits_for_them_and_is_listed(tmp_path, warm_kernels):
    """Compiling may take longer than any analysis is given: that is no fault."""
    compiled = threading.Event()

    def options(_, digitizer):
        return CaptureOptions(tmp_path, CaptureSettings(10e6, 600_000, 60_000))

    def wait(given_up):
        while not compiled.wait(0.02):
            if given_up():
                raise Cancelled

    rig = Rig(options, AnalysisSettings, wait, deadlines=Deadlines(analysing_s=2.0), open_digitizer=rigs.quick_bench)
    try:
        _until(lambda: rig.latest().state is State.IDLE and rig.channels != ())
        rig.arm()
        _until(lambda: rig.latest().state is State.ANALYSING)
        end = time.monotonic() + 2.5
        while time.monotonic() < end:
            assert rig.latest().state is State.ANALYSING, rig.latest().message
            time.sleep(0.01)
        assert "compiling" in (rig.latest().doing or "")
        compiled.set()
        _until(lambda: bool(rig.latest().finished))
        (finished,) = rig.latest().finished
        assert finished.shot is not None and finished.shot.impact is not None
    finally:
        compiled.set()
        rig.close()


def _until(true, longest_s=60.0):
    end = time.monotonic() + longest_s
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)

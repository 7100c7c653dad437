"""The modes without a screen: they run, say one line where they cannot, and never create a Qt application."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.shot.shot import Progress
from app.command_line import machine, start
from app.command_line.cli import main
from app.session import kernels
from tests.app import rigs


def test_simulated_shots_are_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--simulate", str(tmp_path), "--shots", "2", "--seed", "3"]) == 0
    assert len(capsys.readouterr().out.split()) == 2
    assert main(["--replay", str(tmp_path), "--no-diagnose"]) == 0
    assert "COR quasi-static" in capsys.readouterr().out


def test_without_a_screen_one_shot_is_told_and_named_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def ready_at_once(report: Progress, ready: Callable[[kernels.Stage], None]) -> None:
        for stage in kernels.Stage:
            ready(stage)

    monkeypatch.setattr("app.session.prepare_first_shot", ready_at_once)
    assert start.headless_shot() == 0
    said = capsys.readouterr().out
    assert said.index("COR quasi-static") < said.index("fit_to_follow") < said.index("fit of model paper")
    assert said.count("shot-1.sigmf-meta") == 1 and "COR quasi-static" in said and "fit of model paper" in said


@pytest.mark.parametrize("effect", ["nonsense:x=1", "tilt:nonsense=1", "tilt:angle_rad=steep", "tilt"])
def test_an_effect_that_does_not_exist(effect: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["--simulate", str(tmp_path), "--effect", effect])
    said = capsys.readouterr().err.strip().splitlines()
    if effect == "tilt":  # a name alone asks for the effect at its usual strength
        assert status in (0, 2)
    else:
        assert status == 2
        assert len(said) == 1


def test_doctor(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--doctor"]) in (0, 1)
    lines = capsys.readouterr().out.strip().splitlines()
    assert all(line.split()[0] in ("ok", "warn", "fail") for line in lines)
    for name in ("Python", "window", "disk"):
        assert any(f"{name}:" in line for line in lines), name


def test_the_doctor_judges_the_signals_of_a_source(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:  # the bench as it is chosen by name pushes its block after some seconds
        patched.setattr("app.command_line.doctor.open_in_subprocess", rigs.still_bench)
        main(["--doctor", "--source", "bench"])
    lines = [line for line in capsys.readouterr().out.splitlines() if " signal, " in line]
    assert [line.split(", ")[1].split(":")[0] for line in lines] == ["PD0", "PD1", "light switch", "rest frequency"]
    assert all("beat at 2.7" in line for line in lines[:2]), lines
    assert main(["--doctor", "--source", "nothing"]) == 1
    assert "fail  source: unknown source 'nothing'" in capsys.readouterr().out


def test_no_qt_without_a_window(tmp_path: Path) -> None:
    """The other modes need no screen; Qt is not even imported, nor at a start what costs a second."""
    code = (
        "import sys\n"
        "import app.session.load, analysis.diagnosis, analysis.planning.plan, instrument.bench.digitizer\n"
        "assert not {'scipy.stats', 'scipy.signal'} & set(sys.modules)\n"
        "from app.command_line.cli import main\n"
        f"assert main(['--simulate', {str(tmp_path)!r}, '--shots', '1']) == 0\n"
        f"assert main(['--replay', {str(tmp_path)!r}, '--no-diagnose']) == 0\n"
        "assert not any(name.startswith(('PySide6', 'pyqtgraph')) for name in sys.modules)\n"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_window_holds_none_of_what_only_fits_need() -> None:
    """They run in a process of their own; here scipy.optimize alone is 30 MB."""
    code = (
        "import sys\n"
        "from app.window.main_window import MainWindow\n"
        "assert not {'scipy.optimize', 'scipy.sparse', 'scipy.interpolate', 'scipy.stats'} & set(sys.modules)\n"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_shots_are_acquired_from_the_bench_and_from_a_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    site = ["--site", "VC-C"]
    assert main(["--acquire", "1", "--source", "bench", "--out", str(first), "--timeout", "30", *site]) == 0
    assert main(["--acquire", "1", "--source", f"replay:{first}", "--out", str(again), "--timeout", "30"]) == 0
    paths = capsys.readouterr().out.split()
    assert [Path(p).exists() for p in paths] == [True, True]
    assert main(["--replay", str(again), "--no-diagnose"]) == 0


@pytest.mark.parametrize("source", ["nothing", "replay:/no/such/place", "bench:here"])
def test_a_source_that_is_not_there(source: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--acquire", "1", "--source", source, "--out", str(tmp_path / "out")]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_the_frozen_application_asks_itself_whether_a_window_can_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is no Python: "-c" and a line of it were taken for wrong arguments, and Qt for one that does not start."""
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    asked = machine._probe()
    house = Path(__file__).resolve().parents[2]
    command = [asked[0], str(house / "packaging" / "application.py"), *asked[1:]]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": str(house)}, check=False, capture_output=True)
    assert done.returncode == 0, done.stderr

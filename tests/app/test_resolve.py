"""``levimass resolve``: shots planned and taken until one name is left, without a window."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from analysis.planning.next_shot import NextShot
from analysis.shot.recording import Setup
from app.command_line import resolve as module
from app.command_line.acquire import CaptureRequest
from instrument.devices.digitizer import CaptureSettings
from instrument.devices.sources import is_bench
from tests.app import synthetic


def test_what_the_system_refuses_is_said_in_a_line_that_names_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*_: object) -> list[Path]:
        raise OSError("the folder went away")

    monkeypatch.setattr(module, "record_shots", refused)
    request = CaptureRequest("bench", tmp_path / "shots", None, None, 10.0)
    assert module.resolve(2, 3, request, None) == 1
    assert capsys.readouterr().err.splitlines() == [f"levimass: {tmp_path / 'shots'}: the folder went away"]


@pytest.mark.parametrize(
    ("source", "opened"),
    [
        ("bench?seed=4", "bench?seed=4&speed=0.6000&added=0.05000&first=2"),
        ("hantek6022", "hantek6022"),
    ],
)
def test_a_planned_shot_is_taken_as_it_was_planned(
    source: str, opened: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """At the bench speed and weights are set; elsewhere they are asked for, and the recording states the weights."""
    planned, taken = NextShot(0.6, 0.05, 20e-3, 0.1), [synthetic.shot("one"), synthetic.shot("two")]
    asked: list[str] = []

    def open_one(source: str, _request: CaptureRequest) -> object:
        asked.append(source)
        return SimpleNamespace(setup=Setup(17.85e-3))

    def acquire(
        digitizer: object, folder: Path, count: int, settings: CaptureSettings, timeout_s: float, *, report, setup
    ) -> list[Path]:
        assert isinstance(digitizer, SimpleNamespace) and (folder, count, timeout_s) == (tmp_path, 1, 10.0)
        assert settings.samples / settings.sample_rate_hz > planned.before_s + planned.after_s
        weighs_kg = None if setup is None else setup.moving_mass_kg
        assert weighs_kg == (None if is_bench(source) else pytest.approx(67.85e-3))
        return [tmp_path / "third"]

    monkeypatch.setattr(module, "opened", open_one)
    monkeypatch.setattr(module, "acquire", acquire)
    request = CaptureRequest(source, tmp_path, 1e6, None, 10.0)
    assert module._planned(planned, taken, request, 2) == tmp_path / "third"
    assert asked == [opened]
    said = capsys.readouterr().err
    assert planned.words in said and ("set the rig, then push the block" in said) is not is_bench(source)

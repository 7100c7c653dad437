"""``levimass resolve``: shots planned and taken until one name is left, without a window."""

from pathlib import Path

import pytest

from app.command_line import resolve as module
from app.command_line.acquire import CaptureRequest


def test_what_the_system_refuses_is_said_in_a_line_that_names_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*_: object) -> list[Path]:
        raise OSError("the folder went away")

    monkeypatch.setattr(module, "record_shots", refused)
    request = CaptureRequest("bench", tmp_path / "shots", None, None, 10.0)
    assert module.resolve(2, 3, request, None) == 1
    assert capsys.readouterr().err.splitlines() == [f"levimass: {tmp_path / 'shots'}: the folder went away"]

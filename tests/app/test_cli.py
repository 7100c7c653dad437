"""The command's usage: what it refuses, and that it says so with status 2."""

import pytest

from app.cli import USAGE, main


@pytest.mark.parametrize(
    "arguments",
    [
        ["--no-such-option"],
        ["--replay"],
        ["--json", "out.json"],
        ["--export", "folder"],
        ["--replay", "x", "--model", "no-such-model"],
        ["--acquire", "0", "--source", "bench", "--out", "d"],
        ["--acquire", "1", "--source", "bench"],
        ["--acquire", "1", "--out", "d"],
        ["--source", "bench"],
        ["--undeclared"],
        ["--simulate", "d", "--undeclared", "--effect", "tilt:angle_rad=1e-4"],
        ["--replay", "x", "--doctor"],
        ["--replay", "x", "--save-model", "m.toml", "--no-diagnose"],
        ["--replay", "x", "--save-model", "m.toml", "--jobs", "2"],
        ["--figures", "d"],
    ],
)
def test_wrong_usage_is_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == USAGE
    assert "levimass" in capsys.readouterr().err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("levimass ")

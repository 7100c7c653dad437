"""The command's usage: what it refuses, and that it says so with status 2."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.command_line import cli
from app.command_line.cli import main
from app.command_line.options import FAILED, GROUPS, INTERRUPTED, USAGE, commands_of
from app.command_line.outputs import json_text
from app.command_line.parser import command_parser, flat_parser, parse

HOUSE = Path(__file__).resolve().parents[2]


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
        ["--replay", "x", "--resolve", "2"],
        ["--replay", "x", "--plan", "--no-diagnose"],
        ["--replay", "x", "--plan", "--jobs", "2"],
        ["--replay", "x", "--speeds", "0.1"],
        ["--replay", "x", "--plan", "--speeds", "0,0.1"],
        ["--replay", "x", "--plan", "--speeds", "fast"],
        ["--replay", "x", "--plan", "--weights", "-0.05"],
        ["--replay", "x", "--plan", "--run-up", "0"],
        ["--paper", "--plan"],
        ["--acquire", "1", "--source", "bench", "--out", "d", "--resolve", "0"],
        ["--source", "bench"],
        ["--doctor", "--source", "bench", "--out", "d"],
        ["--undeclared"],
        ["--simulate", "d", "--undeclared", "--effect", "tilt:angle_rad=1e-4"],
        ["--replay", "x", "--doctor"],
        ["--replay", "x", "--save-model", "m.toml", "--no-diagnose"],
        ["--replay", "x", "--save-model", "m.toml", "--jobs", "2"],
        ["--figures", "d"],
        ["--replay", ""],
        ["--simulate", "d", "--seed", "-5"],
        ["--simulate", "d", "--site", "VC-Z"],
        ["--simulate", "d", "--site", "no-such-file.toml"],
        ["--replay", "x", "--site", "VC-C"],
        ["--acquire", "1", "--source", "hantek6022", "--out", "d", "--site", "VC-C"],
    ],
)
def test_wrong_usage_is_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == USAGE
    assert "levimass" in capsys.readouterr().err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("levimass ")
    assert "MIT" in out and "numba" in out


def test_version_and_a_wrong_word_wait_for_no_numerics() -> None:
    asking = (
        "import sys\nfrom app.command_line.cli import main\nmain(['--version']); main(['--no-such'])\n"
        "assert not {'numpy', 'numba', 'PySide6'} & set(sys.modules)"
    )
    ended = subprocess.run([sys.executable, "-c", asking], cwd=HOUSE, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    ("command", "as_options"),
    [
        (["replay", "a", "b", "--fit-seconds", "3"], ["--replay", "a", "b", "--fit-seconds", "3"]),
        (["replay", "--no-diagnose", "a"], ["--no-diagnose", "--replay", "a"]),
        (["plan", "a", "--speeds", "0.1"], ["--replay", "a", "--plan", "--speeds", "0.1"]),
        (["plan", "a", "--plan", "plate_mass_kg"], ["--replay", "a", "--plan", "plate_mass_kg"]),
        (["acquire", "2", "--source", "bench", "--out", "d"], ["--acquire", "2", "--source", "bench", "--out", "d"]),
        (["simulate", "d", "--seed", "7"], ["--simulate", "d", "--seed", "7"]),
        (["map", "f.csv", "--rate", "1e6"], ["--map", "f.csv", "--rate", "1e6"]),
        (["paper"], ["--paper"]),
        (["paper", "shot", "--json", "-"], ["--paper", "shot", "--json", "-"]),
        (["prepare", "--jobs", "1"], ["--prepare", "--jobs", "1"]),
        (["doctor", "--source", "bench"], ["--doctor", "--source", "bench"]),
        (["window", "--site", "VC-D"], ["--site", "VC-D"]),
    ],
)  # fmt: skip
def test_a_command_says_what_its_options_say(command: list[str], as_options: list[str]) -> None:
    assert parse(command) == parse(as_options)


@pytest.mark.parametrize(
    "arguments",
    [["replay"], ["replay", "x", "--seed", "2"], ["plan", "x", "--no-diagnose"], ["acquire", "1", "--source", "bench"],
     ["doctor", "--json", "-"], ["simulate"], ["prepare", "now"], ["--replay", "x", "--seed", "2"]],
)  # fmt: skip
def test_a_command_refuses_what_does_not_go_with_it(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == USAGE
    assert "levimass" in capsys.readouterr().err


def test_every_option_goes_with_a_command_whose_help_names_it() -> None:
    for group in GROUPS:
        for option in group.options:
            for command in commands_of(group, option):
                assert option.flag in command_parser(command).format_help()
    assert "--seed" not in command_parser("replay").format_help()


def test_the_help_names_the_sites_there_are() -> None:
    from instrument.bench.site import NAMES

    words = " ".join(flat_parser().format_help().split())
    for name in NAMES:
        assert name in words or name.startswith("VC-"), name


@pytest.mark.parametrize("option", ["--json", "--report", "--save-model", "--export"])
def test_an_output_that_cannot_be_written_is_told_before_the_analysis(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    for target, cause in (("file/under", "not a folder|Not a directory"), ("", "names no file")):
        status = main(["--replay", str(tmp_path / "none"), option, str(tmp_path / target) if target else ""])
        printed = capsys.readouterr()
        assert status == (FAILED if target else USAGE)
        assert re.search(cause, printed.err) and "no such file" not in printed.err
        assert printed.out == ""


@pytest.mark.parametrize("name", ["x" * 5000, "ünï\n名", "."])
def test_any_name_is_refused_in_one_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--replay", str(tmp_path / name)]) == FAILED
    assert capsys.readouterr().err.count("\n") == 1


POSIX = pytest.mark.skipif(os.name != "posix", reason="pipes and signals as POSIX has them")


@POSIX
def test_a_reader_that_leaves_and_a_full_disk(tmp_path: Path) -> None:
    (tmp_path / "shot.csv").write_text("time_s,pd1\n0,1\n1,2\n")
    command = [sys.executable, "-m", "app", "--map", str(tmp_path / "shot.csv")]

    def run(stdout: Any) -> tuple[str, int]:
        ended = subprocess.run(command, cwd=HOUSE, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False)
        return ended.stderr, ended.returncode

    with open("/dev/full", "w") as full:
        assert run(full) == ("levimass: standard output: No space left on device\n", FAILED)
    read, write = os.pipe()
    os.close(read)
    assert run(write) == ("", 0)
    os.close(write)


def test_ctrl_c_in_mid_run_is_a_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "prepared_command", lambda options, arguments: interrupted)
    assert main(["--replay", "x"]) == INTERRUPTED
    assert capsys.readouterr().err == "levimass: interrupted\n"


@POSIX
def test_ctrl_c_while_modules_load_ends_the_process() -> None:
    loading = (
        "import os, signal, app.command_line.cli as c\nwith c._ended_by_ctrl_c(): os.kill(os.getpid(), signal.SIGINT)\n"
    )
    ended = subprocess.run([sys.executable, "-c", loading], cwd=HOUSE, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (-signal.SIGINT, "")


def test_a_number_that_json_does_not_know_is_never_written():
    assert json_text({"force_n": 1.5}) == '{\n "force_n": 1.5\n}\n'
    for number in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="JSON"):
            json_text({"force_n": number})

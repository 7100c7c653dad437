"""Names and notes that reach a terminal or a spreadsheet are shown, never obeyed."""

import csv
import random
from pathlib import Path

import pytest

from app.command_line.cli import main
from app.report.exports import write_table
from app.words.markup import cell, escape_controls

ESCAPE = "\x1b]0;owned\x07\x1b[2J\r\x08\u202e\x9b31m\u2028"


def test_nothing_a_terminal_obeys_is_left() -> None:
    assert escape_controls("velocity ± 0.1 µm/s\n\tnext") == "velocity ± 0.1 µm/s\n\tnext"
    assert escape_controls(ESCAPE) == "\\x1b]0;owned\\x07\\x1b[2J\\r\\x08\\u202e\\x9b31m\\u2028"
    random_ = random.Random(1)
    for _ in range(300):
        text = "".join(chr(random_.choice((random_.randrange(0x300), random_.randrange(0xD7FF)))) for _ in range(20))
        assert all(character.isprintable() or character in "\n\t" for character in escape_controls(text))


@pytest.mark.parametrize(
    "formula", ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", " =1", "\n@x", "-1_0", "-"]
)
def test_a_formula_is_text(formula: str) -> None:
    assert cell(formula) == f"'{formula}"


@pytest.mark.parametrize("number", ["-0.5", "+3", "-1e-05", "-inf", "", "shot-1", "a=b", "0.001784"])
def test_numbers_and_names_stay(number: str) -> None:
    assert cell(number) == number


def test_a_table_holds_no_cell_that_is_obeyed(tmp_path: Path) -> None:
    write_table(["name", "note"], [["=1+1", "a\x00b\x1b[2J"], ["-0.5", "two\nlines"]], tmp_path / "t.csv")
    with open(tmp_path / "t.csv", newline="") as file:
        assert list(csv.reader(file))[1:] == [["'=1+1", "a\\x00b\\x1b[2J"], ["-0.5", "two\nlines"]]


def test_a_name_that_commands_the_terminal_is_written_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / f"x{ESCAPE.replace('/', '')}"
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system takes no such name")
    (folder / "a.sigmf-meta").write_text("{")
    assert main(["--replay", str(folder)]) == 1
    assert main(["--replay", f"none{ESCAPE}"]) == 1
    assert main(["--nonsense", ESCAPE]) == 2
    heard = capsys.readouterr()
    assert heard.err and all(c.isprintable() or c in "\n\t" for c in heard.out + heard.err)

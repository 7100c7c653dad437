"""The code, the printed numbers and the calls of the command line on the pages, and an example of a docstring."""

import ast
import contextlib
import io
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

import levimass
from app.command_line.options import COMMANDS, PLAN, WINDOW
from app.command_line.parser import parse

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted([*DOCS.glob("*.md"), DOCS.parent / "README.md"])
NUMBER = re.compile(r"(\()?(-?\d+(?:\.\d+)?)(?: ± (\d+(?:\.\d+)?))?(?(1)\))(e-?\d+)?")


def numbers(printed: str) -> list[tuple[float, float, bool]]:
    """Return value, uncertainty (else one in the last digit) and whether it is stated, of each number."""
    found = []
    for _, value, std, power in NUMBER.findall(printed):
        last = 10.0 ** -len(value.partition(".")[2]) if "." in value else 0.0
        scale = float(f"1{power}")
        found.append((float(value) * scale, (float(std) if std else last) * scale, bool(std)))
    return found


def test_the_notebooks_page_prints_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "from-a-notebook.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    compared = 0
    for code, said in re.findall(r"```python\n(.*?)```\n(?:```\n(.*?)```)?", page, re.DOTALL):
        if "matplotlib" in code:
            try:
                import matplotlib
            except ImportError:  # not needed by the program
                continue
            matplotlib.use("Agg")
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, "from-a-notebook.md", "exec"), names)
        now, then = numbers(printed.getvalue()), numbers(said)
        assert NUMBER.sub("", printed.getvalue()) == NUMBER.sub("", said)
        for (value, std, _), (told, told_std, is_stated) in zip(now, then, strict=True):
            assert value == pytest.approx(told, rel=0.0, abs=told_std), printed.getvalue()
            assert not is_stated or std == pytest.approx(told_std, rel=0.1), printed.getvalue()
            compared += is_stated
    assert compared == 8


def test_the_example_of_effects_to_simulate_is_simulated(tmp_path: Path) -> None:
    (example,) = re.findall(r"``(\{.*?\}\})``", levimass.simulate.__doc__ or "")
    (path,) = levimass.simulate(tmp_path, shots=1, effects=ast.literal_eval(example))
    assert levimass.read(path).counts.shape[1] == 3


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_calls_on_a_page_are_commands_and_those_set_apart_are_accepted(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    known = {*(command.key for command in COMMANDS), PLAN, WINDOW}
    called = set(re.findall(r"(?:`|^)(?:\.venv/bin/)?levimass (\S+?)[` \n]", text, re.MULTILINE))
    assert called - known <= ({"--replay"} if page.name == "README.md" else set())
    for block in re.findall(r"^```\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for call in re.findall(r"^(?:\.venv/bin/)?levimass (.*)", block, re.MULTILINE):
            if "[" not in call:  # a synopsis
                parse(shlex.split(call))

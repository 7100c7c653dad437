"""Which tests run a line of the program, found by running the suite once with every line noted (coverage.py).

What a compiled kernel does is not seen, nor what runs in another process: for those lines the imports answer
(``tests.mutants.imports``).
"""

import ast
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from coverage import CoverageData

_LINES, _TIMES = "lines.db", "times.xml"


class Covered:
    """The tests that ran each line of the program, and how long each took."""

    def __init__(self, root: Path, lines: CoverageData, seconds: dict[str, float]) -> None:
        self._root, self._seconds, self._lines = root, seconds, lines

    @classmethod
    def kept_in(cls, folder: Path, root: Path) -> Self:
        """Read what an earlier run of the suite has left in ``folder``; without one, run the suite (a quarter hour)."""
        if not (folder / _LINES).is_file():
            _run_suite(folder, root)
        lines = CoverageData(str(folder / _LINES))
        lines.read()
        return cls(root, lines, _seconds(folder / _TIMES))

    def tests_of(self, path: str, line: int, near: Sequence[str], seconds: float) -> list[str]:
        """Return the tests that ran the line, or else its function: ``seconds`` of them in all at most.

        Those of the files ``near`` come first, then the others, the quickest first of each.
        """
        by_line = self._lines.contexts_by_lineno(path)  # of files as pyproject.toml has them: relative to the root
        of_line = self._of(by_line, [line]) or self._of(by_line, _lines_of_function(self._root / path, line))

        def order(test: str) -> tuple[bool, float, str]:
            return test.partition("::")[0] not in near, self._seconds[test], test

        chosen: list[str] = []
        left = seconds
        for test in sorted(of_line, key=order):
            left -= self._seconds[test]
            if left < 0.0 and chosen:
                break
            chosen.append(test)
        return chosen

    def _of(self, by_line: dict[int, list[str]], lines: list[int] | range) -> set[str]:
        named = {context.rpartition("|")[0] for line in lines for context in by_line.get(line, ())}
        return named & self._seconds.keys()


def _lines_of_function(path: Path, line: int) -> range:
    """Return the lines of the innermost function about a line without its header, all of the file's outside of any."""
    tree = ast.parse(path.read_bytes())
    about = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]
    if not about:
        return range(1, 1 + path.read_bytes().count(b"\n"))
    inner = max(about, key=lambda node: node.lineno)
    return range(inner.body[0].lineno, (inner.end_lineno or inner.lineno) + 1)


def _run_suite(folder: Path, root: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    place = folder.resolve()
    command = [
        sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-n", "auto", "--dist", "worksteal", "-m", "not slow",
        "--cov=analysis", "--cov=instrument", "--cov=app", "--cov-context=test", "--cov-report=",
        "--junitxml", str(place / _TIMES), "-o", "junit_family=xunit1",
    ]  # fmt: skip
    environment = os.environ | {
        "QT_QPA_PLATFORM": "offscreen",
        "COVERAGE_FILE": str(place / "lines.now"),
        "LEVIMASS_LINES_FOLLOWED": "1",
    }
    ended = subprocess.run(command, cwd=root, env=environment, check=False)
    if ended.returncode not in (0, 1):
        raise SystemExit("mutants: the suite does not run to its end")
    shutil.move(place / "lines.now", place / _LINES)


def _seconds(times: Path) -> dict[str, float]:
    """Return how long each test took in s, by its name as pytest prints it; of those alone that passed."""
    found = {}
    for case in ElementTree.parse(times).iter("testcase"):
        if case.find("failure") is not None or case.find("error") is not None:
            continue
        inside = case.get("classname", "").removeprefix(case.get("file", "")[:-3].replace("/", ".")).strip(".")
        name = "::".join(filter(None, [case.get("file"), *inside.split("."), case.get("name")]))
        found[name] = float(case.get("time", 0.0))
    return found

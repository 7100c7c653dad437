"""Imports go one way: app -> instrument -> analysis; Qt lives in app alone."""

import ast
import re
from pathlib import Path

import pytest

HOUSE = Path(__file__).resolve().parents[1]
FORBIDDEN = {
    "analysis": {"instrument", "app", "PySide6", "pyqtgraph", "usb", "niscope", "pyvisa"},
    "instrument": {"app", "PySide6", "pyqtgraph"},
    "resources": {"app", "instrument", "analysis", "PySide6"},
}


def _imported(source: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("floor", sorted(FORBIDDEN))
def test_imports_go_one_way(floor: str) -> None:
    sources = sorted((HOUSE / floor).rglob("*.py"))
    assert sources
    wrong = {str(s.relative_to(HOUSE)): bad for s in sources if (bad := _imported(s) & FORBIDDEN[floor])}
    assert not wrong


APP_FLOORS = ("words", "report", "session", "window")  # each may import those before it


def _modules(source: Path) -> set[str]:
    tree = ast.walk(ast.parse(source.read_text(encoding="utf-8")))
    return {node.module for node in tree if isinstance(node, ast.ImportFrom) and node.module}


@pytest.mark.parametrize("floor", range(len(APP_FLOORS)))
def test_imports_within_the_application_go_one_way(floor: int) -> None:
    above = {f"app.{name}" for name in (*APP_FLOORS[floor + 1 :], "command_line")}
    sources = sorted((HOUSE / "app" / APP_FLOORS[floor]).rglob("*.py"))
    assert sources
    wrong = {
        str(source.relative_to(HOUSE)): bad
        for source in sources
        if (bad := {name for name in _modules(source) if ".".join(name.split(".")[:2]) in above})
    }
    assert not wrong


def test_what_is_cited_lies_in_the_repository() -> None:
    cited = re.compile(r"\b(?:docs/)?([A-Za-z][\w-]*\.md)\b")
    there = {path.name for path in (HOUSE / "docs").glob("*.md")} | {"README.md"}
    missing = set()
    for folder in ("analysis", "instrument", "app"):
        for source in (HOUSE / folder).rglob("*.py"):
            missing |= {(source.name, name) for name in cited.findall(source.read_text(encoding="utf-8"))}
    assert {(source, name) for source, name in missing if name not in there} == set()

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


LAYERS = {  # a package imports from those before it alone; what lies in none comes last
    "analysis": (
        "compiled",
        "collision",
        "shot",
        "signal",
        "reading",
        "inference",
        "drive",
        "fitted",
        "diagnosis",
        "planning",
        "uncertainty",
        "paper",
    ),
    "instrument": ("trigger", "files", "devices", "bench", "process", "live", "capture"),
    "app": ("words", "report", "session", "window", "command_line"),
}


def _layer(module: str) -> int:
    """Return the place of a module in the order of the packages of its folder."""
    top, part = module.split(".")[:2]
    return LAYERS[top].index(part) if part in LAYERS[top] else len(LAYERS[top])


def _taken(source: Path) -> set[str]:
    """Return the modules of the source's own top folder that its imports name, wherever in it they stand."""
    taken: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            taken |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            taken |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in taken if name.startswith(f"{source.relative_to(HOUSE).parts[0]}.")}


def _runs_back(module: str, taken: set[str]) -> set[str]:
    return {name for name in taken if _layer(name) > _layer(module)}


@pytest.mark.parametrize("top", sorted(LAYERS))
def test_packages_import_in_one_order(top: str) -> None:
    folder = HOUSE / top
    assert {path.name for path in folder.iterdir() if (path / "__init__.py").exists()} == set(LAYERS[top])
    of_source = {source: source.relative_to(HOUSE).with_suffix("").as_posix() for source in folder.rglob("*.py")}
    sources = {name.replace("/", "."): source for source, name in of_source.items()}
    wrong = {name: bad for name, source in sources.items() if (bad := _runs_back(name, _taken(source)))}
    assert not wrong


def test_an_import_that_runs_back_is_seen() -> None:
    assert _runs_back("analysis.inference.fit.search", {"analysis.diagnosis.words"})
    assert not _runs_back("analysis.diagnosis.words", {"analysis.inference.fit.search", "analysis.diagnosis.result"})
    assert _runs_back("analysis.paper.paper", {"analysis.pipeline.analyse"})
    assert _runs_back("instrument.live.live_thread", {"instrument.capture.snapshot.Snapshot"})


def test_the_page_of_the_house_names_every_package() -> None:
    page = (HOUSE / "docs" / "architecture.md").read_text(encoding="utf-8")
    packages = (*LAYERS["analysis"], *LAYERS["instrument"])
    assert [name for name in packages if f"| `{name}` |" not in page] == []


def test_what_is_cited_lies_in_the_repository() -> None:
    cited = re.compile(r"\b(?:docs/)?([A-Za-z][\w-]*\.md)\b")
    there = {path.name for path in (HOUSE / "docs").glob("*.md")} | {"README.md"}
    missing = set()
    for folder in ("analysis", "instrument", "app"):
        for source in (HOUSE / folder).rglob("*.py"):
            missing |= {(source.name, name) for name in cited.findall(source.read_text(encoding="utf-8"))}
    assert {(source, name) for source, name in missing if name not in there} == set()

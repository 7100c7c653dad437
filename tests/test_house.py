"""Imports go one way: app -> instrument -> analysis; Qt lives in app alone; nobody imports past a package's exports."""

import ast
import importlib.util
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import levimass
from instrument.devices.sources import SOURCES
from levimass import settings

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


def _keeping_alive(source: str) -> Iterator[int]:
    """Yield the lines that start a thread for which Python waits at its end."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "threading.Thread":
            daemon = next((keyword.value for keyword in node.keywords if keyword.arg == "daemon"), None)
            if not isinstance(daemon, ast.Constant) or daemon.value is not True:
                yield node.lineno


@pytest.mark.parametrize("top", ["analysis", "instrument", "app"])
def test_no_thread_keeps_a_closed_program_running(top: str) -> None:
    """A driver that never returns would: its thread is left behind instead."""
    sources = {source: source.read_text(encoding="utf-8") for source in sorted((HOUSE / top).rglob("*.py"))}
    assert [(str(source), line) for source, text in sources.items() for line in _keeping_alive(text)] == []


@pytest.mark.parametrize(("how", "seen"), [("", [1]), (", daemon=False", [1]), (", daemon=True", [])])
def test_a_thread_that_keeps_it_running_is_seen(how: str, seen: list[int]) -> None:
    assert list(_keeping_alive(f"threading.Thread(target=work{how}).start()")) == seen


def _starts(source: str) -> bool:
    """Return whether a source starts a thread or a process by itself, and not by ``instrument.background``."""
    return re.search(r"\b(Thread|Timer|Process|Popen|\w+Executor|get_context)\(", source) is not None


def test_threads_and_processes_start_in_one_place() -> None:
    sources = [path for top in ("instrument", "app") for path in sorted((HOUSE / top).rglob("*.py"))]
    starting = [path.relative_to(HOUSE).as_posix() for path in sources if _starts(path.read_text(encoding="utf-8"))]
    assert starting == [f"instrument/background/worker_{what}.py" for what in ("process", "thread")]


@pytest.mark.parametrize(
    ("source", "seen"),
    [
        ("threading.Thread(target=work, daemon=True)", True),
        ("with ThreadPoolExecutor(1) as pool:", True),
        ("multiprocessing.Process(target=work)", True),
        ("threading.Event()", False),
        ("from multiprocessing.connection import wait", False),
        ("timer = QTimer(self)", False),
    ],
)
def test_a_source_that_starts_one_is_seen(source: str, seen: bool) -> None:
    assert _starts(source) == seen


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
    "instrument": ("background", "trigger", "files", "devices", "bench", "process", "live", "capture"),
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


def _without_encoding(source: str) -> Iterator[int]:
    """Yield the lines that open, read or write a text file in whatever encoding the computer happens to use."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call) or any(keyword.arg == "encoding" for keyword in node.keywords):
            continue
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        bare = isinstance(node.func, ast.Name)
        modes = [a.value for a in node.args[1 if bare else 0 :][:1] if isinstance(a, ast.Constant)]
        text = re.fullmatch(r"[rwaxt+]+", str(modes[0])) if modes else bare and len(node.args) == 1
        given = {"open": not text, "read_text": len(node.args) > 0, "write_text": len(node.args) > 1}
        if not given.get(name, True):
            yield node.lineno


@pytest.mark.parametrize("top", ["analysis", "instrument", "app", "levimass"])
def test_every_text_file_is_read_and_written_in_a_stated_encoding(top: str) -> None:
    sources = {path: path.read_text(encoding="utf-8") for path in sorted((HOUSE / top).rglob("*.py"))}
    assert {f"{path.name}:{line}" for path, text in sources.items() for line in _without_encoding(text)} == set()


def test_a_text_file_without_an_encoding_is_seen() -> None:
    for wrong in ('open("a")', 'open("a", "w")', 'p.open("w")', "p.read_text()", "p.write_text(words)"):
        assert list(_without_encoding(wrong)) == [1], wrong
    for right in (
        'open("a", "rb")',
        'p.open("w", encoding="utf-8")',
        "sheet.open()",
        'p.read_text("utf-8")',
        'rig.open("bench")',
    ):
        assert list(_without_encoding(right)) == [], right


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
    assert not _runs_back(
        "analysis.diagnosis.findings.words", {"analysis.inference.fit.search", "analysis.diagnosis.findings.result"}
    )
    assert _runs_back("analysis.paper.paper", {"analysis.pipeline.analyse"})
    assert _runs_back("instrument.live.live_thread", {"instrument.capture.snapshot.Snapshot"})


def _at_run_time(text: str) -> Iterator[tuple[str, str]]:
    """Yield (module, name) of each import of a source, except those for type hints alone."""
    tree = ast.parse(text)
    hints = [node for node in ast.walk(tree) if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    unseen = {id(inside) for node in hints for inside in ast.walk(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0 and id(node) not in unseen:
            yield from ((node.module, alias.name) for alias in node.names)


def _folder(module: str, name: str) -> str:
    """Return the folder, dotted, of what ``from module import name`` takes."""
    if module in PACKAGES:
        module = f"{module}.{_exported(module).get(name, name)}".rstrip(".")
    path = HOUSE.joinpath(*module.split("."))
    if not path.is_dir():
        return module.rpartition(".")[0]
    return module


def _in_no_order(taken: dict[str, set[str]]) -> set[str]:
    """Return the folders that are left when those that take from none of the others are removed, again and again."""
    left = dict(taken)
    while free := [folder for folder, others in left.items() if not (others - {folder}) & left.keys()]:
        for folder in free:
            del left[folder]
    return set(left)


def test_no_folders_import_each_other() -> None:
    """... also where one lies inside of the other, as the folders of ``analysis.inference`` do."""
    taken: dict[str, set[str]] = {}
    for top in LAYERS:
        for source in (HOUSE / top).rglob("*.py"):
            folder = ".".join(source.parent.relative_to(HOUSE).parts)
            named = _at_run_time(source.read_text(encoding="utf-8"))
            taken.setdefault(folder, set()).update(_folder(*one) for one in named if one[0].split(".")[0] in LAYERS)
    assert len(taken) > 30 and _in_no_order(taken) == set()


def test_folders_that_import_each_other_are_seen() -> None:
    assert _in_no_order({"a": {"b"}, "b": {"c"}, "c": {"c", "d"}}) == set()
    assert _in_no_order({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}, "e": set()}) == {"a", "b", "c", "d"}
    assert _folder("analysis.inference", "fit_shots") == "analysis.inference.fit"
    assert _folder("analysis.inference.noise.floor", "Floor") == "analysis.inference.noise"
    assert _folder("analysis.pipeline", "analyse") == "analysis"
    text = "if TYPE_CHECKING:\n    from a import b\ndef f():\n    from c import d"
    assert list(_at_run_time(text)) == [("c", "d")]


PACKAGES = ("levimass", *(f"{top}.{part}" for top, parts in LAYERS.items() for part in parts))


def _package(module: str) -> str:
    """Return the package that a module is inside of; what lies directly in a top folder stands for itself."""
    top, *inside = module.split(".")
    if top == "levimass":
        return top
    return f"{top}.{inside[0]}" if inside and inside[0] in LAYERS.get(top, ()) else module


@cache
def _exported(package: str) -> dict[str, str]:
    """Return, of each name that a package exports, the module in the package that it comes from."""
    if package == "levimass":
        return dict.fromkeys(levimass.__all__, "")
    stub = HOUSE.joinpath(*package.split("."), "__init__.pyi")
    imports = ast.parse(stub.read_text(encoding="utf-8")).body
    assert all(isinstance(node, ast.ImportFrom) and node.level == 1 for node in imports), f"{stub} holds more"
    named = [(alias, node.module or "") for node in imports for alias in node.names]
    assert all(alias.asname == alias.name for alias, _ in named), f"{stub}: only `name as name` is exported to mypy"
    return {alias.name: module for alias, module in named}


def _crossing(module: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield (module, name) of each import in a source that names something of another package."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            named = [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            named = [(node.module, alias.name) for alias in node.names]
        else:
            continue
        for come_from, name in named:
            inside = _package(f"{come_from}.{name}") if come_from in LAYERS else _package(come_from)
            if inside in PACKAGES and inside != _package(module):
                yield come_from, name


def _past(module: str, text: str) -> set[str]:
    """Return the imports of a source that are none of a name that another package exports."""
    crossing = _crossing(module, text)
    return {f"{of} {name}" for of, name in crossing if of not in PACKAGES or name not in _exported(of)}


@cache
def _product() -> dict[str, str]:
    """Return the text of each module of the program, and of what is frozen."""
    sources = [path for top in ("levimass", *LAYERS, "packaging") for path in (HOUSE / top).rglob("*.py")]
    named = {path.relative_to(HOUSE).with_suffix("").as_posix().replace("/", "."): path for path in sources}
    return {name.removesuffix(".__init__"): path.read_text(encoding="utf-8") for name, path in named.items()}


def test_nobody_imports_past_what_a_package_exports() -> None:
    assert {name: past for name, text in _product().items() if (past := _past(name, text))} == {}


def _back_through_levimass(module: str, text: str) -> set[str]:
    """Return what a source takes from ``levimass`` but the declared settings; the rest of it calls every package."""
    crossing = [(of, name) for of, name in _crossing(module, text) if _package(of) == "levimass"]
    return {f"{of} {name}" for of, name in crossing if name not in vars(settings)}


def test_analysis_and_instrument_take_nothing_but_settings_from_levimass() -> None:
    below = {name: text for name, text in _product().items() if name.startswith(("analysis.", "instrument."))}
    assert below
    assert {name: back for name, text in below.items() if (back := _back_through_levimass(name, text))} == {}


@pytest.mark.parametrize(
    ("text", "back"),
    [
        ("from levimass import DRIVE, settings_of", set()),
        ("from levimass import DRIVE, simulate", {"levimass simulate"}),
        ("def f():\n    from levimass import analyse as again", {"levimass analyse"}),
        ("import levimass", {"levimass "}),
        ("import levimass.settings", {"levimass.settings "}),
        ("from levimass import settings", {"levimass settings"}),
    ],
)
def test_a_way_back_through_levimass_is_seen(text: str, back: set[str]) -> None:
    assert _back_through_levimass("analysis.shot.shot", text) == back


@pytest.mark.parametrize(
    ("text", "past"),
    [
        ("from analysis.inference import fit_shots", False),
        ("from analysis.inference.fit.shot_fit import fit_shots", True),
        ("from analysis.inference import fit", True),  # a folder inside
        ("from analysis import inference", True),  # as a whole
        ("import analysis.inference", True),
        ("from analysis.diagnosis.findings.words import plain", False),  # its own
        ("def f():\n    from levimass.settings import number", True),
        ("from analysis.pipeline import analyse", False),  # in no package
    ],
)
def test_an_import_past_a_package_is_seen(text: str, past: bool) -> None:
    assert bool(_past("analysis.diagnosis.search.time_limit", text)) is past


def test_what_is_exported_is_used_outside() -> None:
    """... by the program, by its text, or by scripts: those functions are on the page about them."""
    used = {one for name, text in _product().items() for one in _crossing(name, text)}
    by_text = [source.opener.partition(":") for source in SOURCES]
    used |= {(f"instrument.{folder}", function) for folder, _, function in by_text}
    page = (HOUSE / "docs" / "from-a-notebook.md").read_text(encoding="utf-8")
    used |= {("levimass", name) for name in levimass.__all__ if f"`{name}`" in page}
    exported = {(package, name) for package in PACKAGES for name in _exported(package)}
    assert exported - used == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_exported_is_there(package: str) -> None:
    """Each name as its module defines it; none is also the name of a module, which would take its place."""
    exporting = importlib.import_module(package)
    assert sorted(exporting.__all__) == sorted(_exported(package))
    for name, home in _exported(package).items():
        if home:
            assert getattr(exporting, name) is getattr(importlib.import_module(f"{package}.{home}"), name), name
            assert importlib.util.find_spec(f"{package}.{name}") is None, name
        else:
            assert getattr(exporting, name) is not None


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

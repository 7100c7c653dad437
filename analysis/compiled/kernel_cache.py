"""Where numba keeps compiled kernels, so that no changed source is ever answered by an old binary.

numba's own cache looks at the file of the function that is called and at nothing else: a kernel that calls one in
another file, or has a constant from there compiled into it, goes on with the old one after that file has changed.
Here every kernel file has a stamp of all the sources its kernels can be made of: the file itself, what it imports
from this program, what those import, and so on, beside the versions of Python, numba, llvmlite and numpy.  Kernels
lie in a folder named after the file and its stamp.  So a change reaches just the kernels that depend on it, whatever
else was edited or reinstalled with the same text stays compiled, and two versions of the program can run side by side.

Where the sources are not there to be read (a frozen application) the stamp is that of the whole installation.
"""

import ast
import contextlib
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
import uuid
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

from analysis.compiled.kernel_safety import import_numba, only_own

_PREFIX = __name__.rpartition("analysis.")[0]  # in the wheel "levimass."
_BASE = Path(__file__).resolve().parents[__name__.count(".")]
_TOPS = tuple(_PREFIX + name for name in ("analysis", "instrument", "app", "tests"))
_BEGAN_NS = time.time_ns()
KEPT_VERSIONS = 4  # of one kernel file: branches and versions that are in use at a time


def keep_true() -> None:
    """Let numba keep this program's kernels under their stamps; kernels of other programs are left alone."""
    import_numba()
    from numba.core import caching

    locators = caching.CacheImpl._locator_classes
    if any(getattr(locator, "__module__", "") == __name__ for locator in locators):
        return

    class Locator(caching._CacheLocator):  # type: ignore[misc]
        """What numba asks where a function is kept, and whether what it finds there is of these sources."""

        def __init__(self, module: str, line: int) -> None:
            self._module, self._line = module, line

        @classmethod
        def from_function(cls, py_func: Any, py_file: str) -> Any:
            module = py_func.__module__
            if not isinstance(module, str) or not module.startswith(tuple(top + "." for top in _TOPS)):
                return None
            source = source_of(module)
            if source is not None and not _same_file(source, py_file):
                return None  # of another program that has a package of this name
            locator = cls(module, py_func.__code__.co_firstlineno)
            _ready(locator.get_cache_path())
            return locator

        def ensure_cache_path(self) -> None:
            with contextlib.suppress(OSError):
                os.makedirs(self.get_cache_path(), mode=0o700, exist_ok=True)

        def get_cache_path(self) -> str:
            return str(folder_of(self._module))

        def get_source_stamp(self) -> str:
            return stamp(self._module)

        def get_disambiguator(self) -> str:
            return str(self._line)

    class Binaries(caching.IndexDataCacheFile):  # type: ignore[misc]
        """One function's binaries, under names of their own.

        numba counts them: two processes that compile one function for two types at the same time both write number
        1, and the index may keep one's name with the other's code.
        """

        def _data_name(self, number: int) -> str:
            return str(self._data_name_pattern).replace("{number:d}", f"{number}-{uuid.uuid4().hex[:12]}")

        def save(self, key: Any, data: Any) -> None:
            with contextlib.suppress(OSError):  # a full disk: it is compiled, and will be again the next time
                super().save(key, data)  # type: ignore[no-untyped-call]

    locators.insert(0, Locator)
    caching.IndexDataCacheFile = Binaries  # type: ignore[misc]


def root() -> Path:
    """Return the folder of all kernels: the environment's where the user chose one, else the user's cache folder.

    Where neither can be written to, or may hold what somebody else laid there, they are kept with the temporary files.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR", "")
    if chosen and _writable(Path(chosen) / "levimass"):
        return Path(chosen) / "levimass"
    return _root_unless_chosen()


@cache
def _root_unless_chosen() -> Path:
    folder = Path(platformdirs.user_cache_dir("levimass", appauthor=False)) / "kernels"
    if _writable(folder):
        return folder
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"levimass-kernels-{user}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        if not folder.is_symlink() and only_own(folder):
            return folder
    return _private()


def folder_of(module: str) -> Path:
    """Return the folder of a module's kernels, as its sources are now."""
    folder = root() / f"{module.removeprefix(_PREFIX)}-{stamp(module)[:16]}"
    return folder if only_own(folder) else _private() / folder.name


@cache
def _private() -> Path:
    """Return a folder of this process alone: binaries that somebody else may have laid are not run."""
    return Path(tempfile.mkdtemp(prefix="levimass-kernels-"))


@cache
def stamp(module: str) -> str:
    """Return a digest of everything that kernels in ``module`` can be made of."""
    digest = hashlib.sha256(f"{module}\n{_makers()}\n".encode())
    for name in sorted(closure(module)):
        digest.update(f"{name}:{_text_digest(name)}\n".encode())
    return digest.hexdigest()


def whole_program() -> str:
    """Return a digest of every source of the program, and of what compiles them and for which processor."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    digest = hashlib.sha256(f"{_makers()}\n{get_host_cpu_name()}\n{get_host_cpu_features().flatten()}\n".encode())
    for top in _TOPS[:2]:
        folder = _BASE.joinpath(*top.split("."))
        sources = sorted(folder.rglob("*.py"))
        for path in sources:
            digest.update(f"{path.relative_to(_BASE)}:{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
        if not sources:
            digest.update(_installation().encode())
    return digest.hexdigest()


@cache
def closure(module: str) -> frozenset[str]:
    """Return ``module`` and every module of this program that it can have a name from, directly or not."""
    found, waiting = {module}, [module]
    while waiting:
        new = _imported(waiting.pop()) - found
        found |= new
        waiting += new
    return frozenset(found)


@cache
def source_of(module: str) -> Path | None:
    """Return the file that holds a module of this program, None where there is no such source."""
    path = _BASE.joinpath(*module.split("."))
    for candidate in (path.with_name(path.name + ".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


@cache
def _imported(module: str) -> frozenset[str]:
    """Return the modules of this program that one imports, wherever in its text."""
    source = source_of(module)
    if source is None:
        return frozenset()
    package = module.split(".")[: None if source.name == "__init__.py" else -1]
    names: set[str] = set()
    for node in import_statements(source.read_text(encoding="utf-8")):
        if isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                names |= {alias.name} if alias.asname else {".".join(parts[: i + 1]) for i in range(len(parts))}
        else:
            above = package[: len(package) - node.level + 1] if node.level else []
            come_from = ".".join([*above, *filter(None, [node.module])])
            names |= {come_from, *(f"{come_from}.{alias.name}" for alias in node.names)}
    return frozenset(name for name in names if name.startswith(_TOPS) and source_of(name) is not None)


_STATEMENT = re.compile(r"^[ \t]*(?:from[ \t]+[.\w]+[ \t]+import\b|import[ \t]+\w).*$", re.MULTILINE)
_UNUSUAL = re.compile(r"[:;][ \t]*(?:from|import)[ \t]|^[ \t]*from\b.*\\$", re.MULTILINE)


def import_statements(text: str) -> list[ast.Import | ast.ImportFrom]:
    """Return the import statements of a source; ten times as fast as taking all of it apart, as every start does it.

    A line of prose that reads like one counts too: a stamp may hold more than it needs.
    """
    if _UNUSUAL.search(text):
        return [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    found: list[ast.Import | ast.ImportFrom] = []
    for match in _STATEMENT.finditer(text):
        end = match.end()
        while True:
            with contextlib.suppress(SyntaxError):
                tree = ast.parse(text[match.start() : end].strip())
                found += [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
                break
            closing = text.find(")", end) + 1
            if not closing or "(" not in match.group():  # prose
                break
            end = closing
    return found


def _text_digest(module: str) -> str:
    source = source_of(module)
    if source is None:
        return _installation()
    if _BEGAN_NS < source.stat().st_mtime_ns <= time.time_ns():
        return uuid.uuid4().hex  # changed since this process began: what is loaded may be old, and is not kept
    return hashlib.sha256(source.read_bytes()).hexdigest()


@cache
def _installation() -> str:
    """Return what stands for the sources where there are none: the installation's own list, or the executable."""
    if getattr(sys, "frozen", False):
        return hashlib.sha256(Path(sys.executable).read_bytes()).hexdigest()
    from importlib import metadata

    with contextlib.suppress(metadata.PackageNotFoundError):
        distribution = metadata.distribution("levimass")
        return hashlib.sha256((distribution.read_text("RECORD") or distribution.version).encode()).hexdigest()
    return uuid.uuid4().hex  # nothing tells versions apart: kept for this process alone


def _makers() -> str:
    import llvmlite
    import numba
    import numpy as np

    return f"{sys.version} numba {numba.__version__} llvmlite {llvmlite.__version__} numpy {np.__version__}"


@cache
def _ready(folder: str) -> None:
    """Make a folder for kernels, mark it as used, and let go of the oldest of the same file."""
    path = Path(folder)
    with contextlib.suppress(OSError):  # no room for it, or another process is clearing the same folders
        new = not path.is_dir()
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.utime(path)
        if new:
            mine = path.name.rpartition("-")[0]
            same = [other for other in path.parent.glob(f"{mine}-*") if other.name.rpartition("-")[0] == mine]
            for old in sorted(same, key=lambda other: other.stat().st_mtime)[:-KEPT_VERSIONS]:
                shutil.rmtree(old, ignore_errors=True)


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK) and only_own(folder)


def _same_file(source: Path, other: str) -> bool:
    try:
        return os.path.samefile(source, other)
    except OSError:
        return not Path(other).is_absolute()  # a frozen application tells where the source once was

"""Cache of compiled kernels, which never uses an old binary for a changed source.

numba's own cache checks only the file of the called function.  If a kernel uses a function or a constant of another
file, it is not recompiled when that file changes.  Here every kernel file has a stamp: a digest of the file, of all
modules of this program that it imports, directly or indirectly, and of the versions of Python, numba, llvmlite and
numpy.  Its kernels are in a folder named after the file and its stamp.  A change therefore recompiles only the kernels
that depend on it, and two versions of the program can be used at the same time.

Without sources (a frozen application) the stamp is that of the whole installation.
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
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

from analysis.compiled.kernel_safety import import_numba, only_own

_PREFIX = __name__.rpartition("analysis.")[0]  # "levimass." in the wheel, otherwise empty
_BASE = Path(__file__).resolve().parents[__name__.count(".")]
_TOPS = tuple(_PREFIX + name for name in ("analysis", "instrument", "app", "tests"))
_BEGAN_NS = time.time_ns()
KEPT_VERSIONS = 4  # folders kept for one kernel file: branches and versions in use at the same time


def use_kernel_cache() -> None:
    """Make numba use this cache for the kernels of this program; other kernels are not affected."""
    import_numba()
    from numba.core import caching

    locators = caching.CacheImpl._locator_classes
    if any(getattr(locator, "__module__", "") == __name__ for locator in locators):
        return

    class Locator(caching._CacheLocator):  # type: ignore[misc]
        """Gives numba the folder of a function's binaries, and the stamp that they must have."""

        def __init__(self, module: str, line: int) -> None:
            self._module, self._line = module, line

        @classmethod
        def from_function(cls, py_func: Any, py_file: str) -> Any:
            module = py_func.__module__
            if not isinstance(module, str) or not module.startswith(tuple(top + "." for top in _TOPS)):
                return None
            source = source_of(module)
            if source is not None and not _same_file(source, py_file):
                return None  # a package of the same name in another program
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
        """The binaries of one function, under unique names.

        numba numbers them.  Two processes that compile a function for two types at the same time would both write
        number 1, and the index could then give the name of one to the code of the other.
        """

        def _data_name(self, number: int) -> str:
            return str(self._data_name_pattern).replace("{number:d}", f"{number}-{uuid.uuid4().hex[:12]}")

        def save(self, key: Any, data: Any) -> None:
            with contextlib.suppress(OSError):  # if the disk is full, the next run compiles again
                super().save(key, data)  # type: ignore[no-untyped-call]

    locators.insert(0, Locator)
    caching.IndexDataCacheFile = Binaries  # type: ignore[misc]


def cache_folder() -> Path:
    """Return the folder of all kernels: NUMBA_CACHE_DIR, else the user's cache folder, else a temporary folder.

    A folder is not used if this user cannot write to it, or if another user can.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR", "")
    if chosen and _writable(Path(chosen) / "levimass"):
        return Path(chosen) / "levimass"
    return _default_cache_folder()


@cache
def _default_cache_folder() -> Path:
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
    """Return the folder of a module's kernels for its current sources."""
    folder = cache_folder() / f"{module.removeprefix(_PREFIX)}-{stamp(module)[:16]}"
    return folder if only_own(folder) else _private() / folder.name


@cache
def _private() -> Path:
    """Return a folder private to this process; used where another user could have written binaries."""
    return Path(tempfile.mkdtemp(prefix="levimass-kernels-"))


@cache
def stamp(module: str) -> str:
    """Return a digest of everything that the kernels of ``module`` depend on."""
    digest = hashlib.sha256(f"{module}\n{_makers()}\n".encode())
    for name in sorted(closure(module)):
        digest.update(f"{name}:{_text_digest(name)}\n".encode())
    return digest.hexdigest()


def whole_program() -> str:
    """Return a digest of all sources of the program, of the compilers' versions and of the processor."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    digest = hashlib.sha256(f"{_makers()}\n{get_host_cpu_name()}\n{get_host_cpu_features().flatten()}\n".encode())
    for top in _TOPS[:2]:
        folder = _BASE.joinpath(*top.split("."))
        sources = sorted([*folder.rglob("*.py"), *folder.rglob("*.pyi")])
        for path in sources:
            digest.update(f"{path.relative_to(_BASE)}:{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
        if not sources:
            digest.update(_installation().encode())
    return digest.hexdigest()


@cache
def closure(module: str) -> frozenset[str]:
    """Return ``module`` and every module of this program that it imports, directly or indirectly."""
    found, waiting = {module}, [module]
    while waiting:
        new = _imported(waiting.pop()) - found
        found |= new
        waiting += new
    return frozenset(found)


@cache
def source_of(module: str) -> Path | None:
    """Return the source file of a module of this program, or None."""
    path = _BASE.joinpath(*module.split("."))
    for candidate in (path.with_name(path.name + ".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


@cache
def _imported(module: str) -> frozenset[str]:
    """Return the modules of this program that a module imports anywhere in its source."""
    source = source_of(module)
    if source is None:
        return frozenset()
    package = module.split(".")[: None if source.name == "__init__.py" else -1]
    names: set[str] = set()
    for node in import_statements(source.read_text(encoding="utf-8")):
        if isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                named = {alias.name} if alias.asname else {".".join(parts[: i + 1]) for i in range(len(parts))}
                names |= named.union(*map(_all_exported, named))
        else:
            above = package[: len(package) - node.level + 1] if node.level else []
            come_from = ".".join([*above, *filter(None, [node.module])])
            for alias in node.names:
                whole = _all_exported(come_from if alias.name == "*" else f"{come_from}.{alias.name}")
                names |= _homes(come_from, alias.name) | whole
    return frozenset(name for name in names if name.startswith(_TOPS) and source_of(name) is not None)


@cache
def exports_of(package: str) -> Mapping[str, str]:
    """Return the home module of each name that a package exports, as listed in the package's stub."""
    source = source_of(package) if package.startswith(_TOPS) else None
    if source is None or source.name != "__init__.py" or not (stub := source.with_suffix(".pyi")).is_file():
        return {}
    exported = {}
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            home = ".".join([package, *filter(None, [node.module])])
            exported.update({alias.name: home for alias in node.names})
    return exported


def _homes(package: str, name: str) -> set[str]:
    """Return the package and the module that ``name`` comes from, or the module that it names."""
    home = exports_of(package).get(name, package)
    return {package, f"{package}.{name}"} if home == package else {package} | _homes(home, name)


def _all_exported(package: str) -> set[str]:
    """Return the modules that can be reached through an import of the whole package; none if it exports nothing."""
    return set().union(*(_homes(package, name) for name in exports_of(package)))


_STATEMENT = re.compile(r"^[ \t]*(?:from[ \t]+[.\w]+[ \t]+import\b|import[ \t]+\w).*$", re.MULTILINE)
_UNUSUAL = re.compile(r"[:;][ \t]*(?:from|import)[ \t]|^[ \t]*from\b.*\\$", re.MULTILINE)


def import_statements(text: str) -> list[ast.Import | ast.ImportFrom]:
    """Return the import statements of a source.  It runs at every start, so it avoids a full parse (ten times slower).

    A line of prose that looks like an import also counts; the stamp then only depends on more modules.
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
        return uuid.uuid4().hex  # changed since this process began: the loaded code may be old, and is not cached
    return hashlib.sha256(source.read_bytes()).hexdigest()


@cache
def _installation() -> str:
    """Return the digest used without sources: that of the installation's file list, or of the executable."""
    if getattr(sys, "frozen", False):
        return hashlib.sha256(Path(sys.executable).read_bytes()).hexdigest()
    from importlib import metadata

    with contextlib.suppress(metadata.PackageNotFoundError):
        distribution = metadata.distribution("levimass")
        return hashlib.sha256((distribution.read_text("RECORD") or distribution.version).encode()).hexdigest()
    return uuid.uuid4().hex  # the version is unknown: cached for this process only


def _makers() -> str:
    import llvmlite
    import numba
    import numpy as np

    return f"{sys.version} numba {numba.__version__} llvmlite {llvmlite.__version__} numpy {np.__version__}"


@cache
def _ready(folder: str) -> None:
    """Create a folder for kernels, mark it as in use, and remove the oldest folders of the same file."""
    path = Path(folder)
    with contextlib.suppress(OSError):  # the disk is full, or another process is removing the same folders
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
        return not Path(other).is_absolute()  # a frozen application keeps the source path of its build

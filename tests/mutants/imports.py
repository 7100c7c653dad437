"""Which tests could notice a fault in a file: those that import it, directly or through others, nearest first."""

import ast
from pathlib import Path

_MOST = 25  # test files that are run on a fault: from so far away few look closely
_FILES = (".py", "/__init__.py")  # of a name that is imported
TOPS = ("analysis", "instrument", "app", "tests")


class Imports:
    """Who imports whom among the program's files and its tests."""

    def __init__(self, root: Path) -> None:
        files = sorted(path for top in TOPS for path in (root / top).rglob("*.py"))
        self._size = {str(path.relative_to(root)): path.stat().st_size for path in files}
        self._exported: dict[tuple[str, str], str] = {}  # the module of each name that a package exports
        for top in TOPS[:3]:
            for stub in (root / top).glob("*/__init__.pyi"):
                self._read(stub, ".".join(stub.parent.relative_to(root).parts))
        self._by: dict[str, set[str]] = {}
        for path in files:
            name = str(path.relative_to(root))
            for imported in self._imported(path):
                self._by.setdefault(imported, set()).add(name)

    def program(self) -> list[str]:
        """Return the files of the program that may hold a fault."""
        return [name for name in self._size if not name.startswith("tests/") and not name.endswith("__init__.py")]

    def tests_of(self, path: str) -> list[str]:
        """Return the test files that import a file, directly first, then through ever more others; at most so many."""
        ring, seen, tests = {path}, {path}, []
        while ring and len(tests) < _MOST:
            ring = {by for one in ring for by in self._by.get(one, set())} - seen
            seen |= ring
            tests += self._tests(ring)
        return tests[:_MOST]

    def _tests(self, names: set[str]) -> list[str]:
        of = (name for name in names if name.rpartition("/")[2].startswith("test_"))
        return sorted(of, key=lambda name: self._size[name])

    def _read(self, stub: Path, package: str) -> None:
        for node in ast.parse(stub.read_bytes()).body:
            if isinstance(node, ast.ImportFrom):
                for alias in node.names:
                    self._exported[package, alias.name] = f"{package}.{node.module or alias.name}"

    def _imported(self, path: Path) -> set[str]:
        found = set()
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                each = [(node.module, alias.name) for alias in node.names]
                names = [node.module, *(self._exported.get(one, ".".join(one)) for one in each)]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            places = [name.replace(".", "/") for name in names]
            found |= {file for place in places for end in _FILES if (file := place + end) in self._size}
        return found

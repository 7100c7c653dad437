"""Every string that the program may show: ``python -m tests.app.screen_words`` prints them, a page to be read once."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("app/window", "app/session", "app/report", "app/words")
NOT_SHOWN = ("setProperty", "setObjectName", "setStyleSheet", "getattr", "hasattr", "TypeVar", "findChild", "glob")


@dataclass(frozen=True, slots=True)
class Words:
    """One string; the parts of an f-string that are computed are "{}"."""

    file: str
    line: int
    text: str


@lru_cache(maxsize=1)
def shown() -> tuple[Words, ...]:
    """Return each string of at least two words that is no docstring and no key."""
    files = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))
    return tuple(words for path in files for words in _of(path))


def _of(path: Path) -> Iterator[Words]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = {id(node) for node in _skipped(tree)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        text = _text(node)
        if text is not None and " " in text.strip() and any(c.isalpha() for c in text):
            yield Words(str(path.relative_to(ROOT)), getattr(node, "lineno", 0), " ".join(text.split()))


def _text(node: ast.AST) -> str | None:
    if isinstance(node, ast.JoinedStr):
        parts = (p.value if isinstance(p, ast.Constant) and isinstance(p.value, str) else "{}" for p in node.values)
        return "".join(parts)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _skipped(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield docstrings, the parts of f-strings, and what is given to calls that show nothing."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr):
                yield first.value
        elif isinstance(node, ast.Expr):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            for part in node.values:
                yield part
                if isinstance(part, ast.FormattedValue) and part.format_spec is not None:
                    yield part.format_spec
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in NOT_SHOWN:
                for argument in node.args:
                    yield from ast.walk(argument)


if __name__ == "__main__":
    before = ""
    for words in shown():
        if words.file != before:
            print(f"\n{words.file}")
            before = words.file
        print(f"  {words.line:4}  {words.text}")

"""A motion record whose name and keys command whoever shows them, sent through every way out of the program."""

import contextlib
import csv
import io
import json
from collections.abc import Callable, Sequence
from html.parser import HTMLParser
from pathlib import Path

from tests.attack.trial import REFUSED, SURVIVED


class _Tags(HTMLParser):
    """Collects the names of all elements, and attributes that act."""

    def __init__(self) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.acting: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        self.acting += [name for name, _ in attrs if name.startswith("on")]


def sent(folder: Path, words: Sequence[str], main: Callable[[list[str]], int]) -> str:
    """Replay a broken recording and a motion record with such names; look at what came out."""
    stem = "".join(words).replace("/", "").replace("\0", "")[:80]
    try:
        path = folder / f"{stem}.sigmf-meta"
        path.write_text(json.dumps({"global": {"core:datatype": "".join(words)}}))
    except (OSError, ValueError):
        return REFUSED  # this file system takes no such name
    out, err = io.StringIO(), io.StringIO()
    report, tables = folder / "report.html", folder / "tables"
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(["--replay", str(path), "--no-diagnose", "--export", str(tables), "--report", str(report)])
    path.unlink()
    assert status == 1
    for text in (out.getvalue(), err.getvalue()):
        assert all(c.isprintable() or c in "\n\t" for c in text), repr(text[:300])
    with open(tables / "shots.csv", newline="", encoding="utf-8") as file:
        for row in csv.reader(file):
            for cell in row:
                assert cell.isprintable() or all(c.isprintable() or c in "\n\t" for c in cell), repr(cell)
                assert not cell.lstrip().startswith(("=", "+", "-", "@")), cell
    tags = _Tags()
    tags.feed(report.read_text(encoding="utf-8"))
    assert not tags.acting and tags.names.isdisjoint({"script", "img", "iframe", "object"}), (tags.names, tags.acting)
    return SURVIVED

"""Escape text: in HTML and SVG elements for reports and the window, for terminals, and for spreadsheets.

No template engine is used: it would be one more dependency, and it escapes only on request.
"""

import html
import re
from collections.abc import Iterable, Sequence
from typing import Any, TextIO


class Markup(str):
    """Text that is already markup and must not be escaped."""

    __slots__ = ()


Piece = str | Iterable[str]
_INSIDE_UNIT = re.compile(r"(?<=\bN) (?=s\b)")  # no line break within "N s/m"
_VOID = ("meta", "br")
_CLOSED = ("path", "line", "rect", "circle")  # SVG elements without children


def escaped(text: str) -> Markup:
    """Return escaped text; control characters, which HTML forbids, become a replacement character."""
    if isinstance(text, Markup):
        return text
    clean = "".join(c if c in "\n\t" or (c >= " " and not "\x7f" <= c <= "\x9f") else "\ufffd" for c in text)
    return Markup(html.escape(clean.encode("utf-8", "replace").decode("utf-8")))


def tag(name: str, /, *children: Piece, **attributes: str | float | None) -> Markup:
    """Return an element.  In attribute names a trailing "_" is dropped, others become "-"; None values are left out."""
    pairs = (
        f' {key.rstrip("_").replace("_", "-")}="{escaped(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    head = f"<{name}{''.join(pairs)}"
    if name in _VOID + _CLOSED:
        return Markup(f"{head}/>" if name in _CLOSED else f"{head}>")
    return Markup(f"{head}>{joined(*children)}</{name}>")


def joined(*pieces: Piece) -> Markup:
    return Markup("".join(escaped(p) if isinstance(p, str) else joined(*p) for p in pieces))


def lines(pieces: Iterable[str]) -> Markup:
    """Return texts separated by line breaks."""
    return Markup("<br>".join(map(escaped, pieces)))


def table(header: Sequence[str], rows: Iterable[Sequence[str]], class_: str | None = None) -> Markup:
    """Return a table in which the first cell of each row is its heading; units are kept on one line."""
    header, rows = _unbroken(header), map(_unbroken, rows)
    head = tag("thead", tag("tr", [tag("th", cell, scope="col") for cell in header])) if header else Markup()
    body = [tag("tr", tag("th", row[0], scope="row"), [tag("td", cell) for cell in row[1:]]) for row in rows]
    return tag("table", head, tag("tbody", body), class_=class_)


def _unbroken(cells: Sequence[str]) -> list[str]:
    return [cell if isinstance(cell, Markup) else _INSIDE_UNIT.sub("\u00a0", cell) for cell in cells]


_FORMULA = ("=", "+", "-", "@")  # first characters of a formula


def escape_controls(text: str) -> str:
    """Return text with control characters escaped (``\\x1b``), except line ends and tabs."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def cell(text: str) -> str:
    """Return text for a spreadsheet cell: escaped as by ``escape_controls``, with an apostrophe before a formula."""
    shown = escape_controls(text)
    if not shown.lstrip().startswith(_FORMULA) or _is_number(shown):
        return shown
    return f"'{shown}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


class EscapingStream:
    """A text stream that escapes all text as ``escape_controls`` does; ``bare`` is the underlying stream."""

    def __init__(self, bare: TextIO) -> None:
        self.bare = bare

    def write(self, text: str) -> int:
        """Write ``text`` escaped; return the length of the original text."""
        self.bare.write(escape_controls(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.bare, name)

"""Escape text from files for terminals (control characters) and spreadsheets (formulas)."""

from typing import Any, TextIO

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

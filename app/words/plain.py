"""Text that leaves the program: names, notes and messages of others, made harmless for terminals and spreadsheets."""

from typing import Any, TextIO

_FORMULA = ("=", "+", "-", "@")  # a spreadsheet computes what begins so


def plain(text: str) -> str:
    """Return text that a terminal only shows: what it could obey is written out (``\\x1b``); lines and tabs stay."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def cell(text: str) -> str:
    """Return text that a spreadsheet only shows: as ``plain``, and an apostrophe before what it would compute."""
    shown = plain(text)
    if not shown.lstrip().startswith(_FORMULA) or _is_number(shown):
        return shown
    return f"'{shown}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


class PlainStream:
    """A stream of text for people; everything written to it is made plain.  ``bare`` is the stream itself."""

    def __init__(self, bare: TextIO) -> None:
        self.bare = bare

    def write(self, text: str) -> int:
        """Write ``text``, plain; return how much of it was taken."""
        self.bare.write(plain(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.bare, name)

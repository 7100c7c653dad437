"""Why a file could not be read or written, in one line that names the file and the key."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

_SHOWN = 60  # characters of a foreign value that a message may carry


class RecordingError(Exception):
    """A file that cannot be read or written; the message is one line: file, key or place, cause."""

    def __init__(self, path: Path | str, cause: str, key: str | None = None) -> None:
        where = f"{path}: {key}" if key else f"{path}"
        super().__init__(one_line(f"{where}: {cause}", 600))
        self.path = str(path)
        self.key = key


class FileNotReached(RecordingError):
    """A file that is not there, may not be read or whose disk fails: says nothing of what it holds."""


class RecordingExists(RecordingError):
    """A recording of that name is there already, and none is ever overwritten."""

    def __init__(self, path: Path | str) -> None:
        super().__init__(path, "exists already; a recording is never overwritten")


class PartlySaved(RecordingError):
    """The first of several shots that could not be saved; ``saved`` has the paths of those before it, by name."""

    def __init__(self, error: RecordingError, saved: Mapping[str, Path]) -> None:
        Exception.__init__(self, str(error))
        self.path, self.key, self.saved = error.path, error.key, dict(saved)


def one_line(text: str, longest: int = 200) -> str:
    """Return ``text`` without line breaks or control characters, cut to ``longest`` characters."""
    flat = "".join(c if c.isprintable() else " " for c in text)
    return flat if len(flat) <= longest else flat[: longest - 3] + "..."


def shown(value: Any) -> str:
    """Return a foreign value short enough for a message; never renders a large structure."""
    if isinstance(value, str):
        return one_line(repr(value[: _SHOWN + 1]), _SHOWN)
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**18:
        return "a huge whole number"
    return one_line(repr(value), _SHOWN)

"""Errors of reading and writing files, each with a message of one line: the file, the key and the cause."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

_SHOWN = 60  # most characters of a file's value in a message


class RecordingError(Exception):
    """A file cannot be read or written; the message is one line: file, key or place, cause."""

    def __init__(self, path: Path | str, cause: str, key: str | None = None) -> None:
        where = f"{path}: {one_line(key)}" if key else f"{path}"
        super().__init__(one_line(f"{where}: {cause}", 600))
        self.path = str(path)
        self.key = key


class FileNotReached(RecordingError):
    """A file does not exist, may not be read, or is on a failing disk; its content is unknown."""


class RecordingExists(RecordingError):
    """A recording of this name already exists; recordings are never overwritten."""

    def __init__(self, path: Path | str) -> None:
        super().__init__(path, "exists already; a recording is never overwritten")


class SomeShotsNotSaved(RecordingError):
    """One of several shots could not be saved; ``saved`` maps the names of the shots before it to their paths."""

    def __init__(self, error: RecordingError, saved: Mapping[str, Path]) -> None:
        Exception.__init__(self, str(error))
        self.path, self.key, self.saved = error.path, error.key, dict(saved)


def one_line(text: str, longest: int = 200) -> str:
    """Return ``text`` without line breaks or control characters, cut to ``longest`` characters."""
    flat = "".join(c if c.isprintable() else " " for c in text)
    return flat if len(flat) <= longest else flat[: longest - 3] + "..."


def error_words(error: BaseException) -> str:
    """Return an error's message in one line, or the name of its type if the message is empty."""
    return " ".join(str(error).split()) or type(error).__name__


def system_message(error: OSError) -> str:
    """Return the system's description of an error, without the error number and the path."""
    return error.strerror or str(error)


def shown(value: Any) -> str:
    """Return a value from a file as text shortened for a message."""
    if isinstance(value, str):
        return one_line(repr(value[:_SHOWN]), _SHOWN)
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**18:
        return "a huge whole number"
    return one_line(repr(value), _SHOWN)

"""Foreign JSON, read without trust: bounded in size and depth, no NaN, every value checked where it is used."""

import json
import math
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from instrument.recording_error import RecordingError, shown

LARGEST_FILE_BYTES = 16 * 2**20


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number in JSON")


def open_regular(path: Path) -> int:
    """Return a read-only file descriptor of a regular file; a pipe or a device is refused, so nothing can hang."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise RecordingError(path, "no such file") from None
    except (OSError, ValueError) as error:
        raise RecordingError(path, getattr(error, "strerror", None) or str(error)) from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise RecordingError(path, "not a regular file")
    return descriptor


def read_text(path: Path, largest_bytes: int = LARGEST_FILE_BYTES) -> str:
    """Return a UTF-8 text file of at most ``largest_bytes``; RecordingError where it is none."""
    with os.fdopen(open_regular(path), "rb") as file:
        try:
            raw = file.read(largest_bytes + 1)
        except OSError as error:
            raise RecordingError(path, error.strerror or str(error)) from None
    if len(raw) > largest_bytes:
        raise RecordingError(path, f"larger than {largest_bytes // 2**20} MiB")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(path, f"not UTF-8 text (byte {error.start})") from None


def read_object(path: Path) -> dict[str, Any]:
    """Return the JSON object in ``path``; RecordingError where it is none."""
    try:
        value = json.loads(read_text(path), parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise RecordingError(path, f"not JSON ({error.msg}, line {error.lineno})") from None
    except RecursionError:
        raise RecordingError(path, "not JSON that can be read (nested too deeply)") from None
    except ValueError as error:  # NaN, or a whole number of thousands of digits
        raise RecordingError(path, f"not JSON ({error})") from None
    if not isinstance(value, dict):
        raise RecordingError(path, f"{shown(value)} where an object is wanted")
    return value


class Checked:
    """One JSON object with its place in the file, so that every refusal names file and key."""

    def __init__(self, path: Path, values: Mapping[str, Any], place: str = "") -> None:
        self.path = path
        self.values = values
        self.place = place
        self.used: set[str] = set()

    def refuse(self, key: str, cause: str) -> RecordingError:
        """Return the error that names ``key`` of this object."""
        return RecordingError(self.path, cause, f"{self.place}.{key}" if self.place else key)

    def get(self, key: str) -> Any:
        """Return the value or None, and count the key as read."""
        self.used.add(key)
        return self.values.get(key)

    def unread(self) -> dict[str, Any]:
        """Return what nobody asked for, to be written back."""
        return {key: value for key, value in self.values.items() if key not in self.used}

    def number(
        self, key: str, low: float, high: float, *, default: float | None = None, over: bool = False
    ) -> float | None:
        """Return a finite number in [low, high] (``over``: above ``low``), ``default`` where the key is missing."""
        value = self.get(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refuse(key, f"{shown(value)} is not a number")
        try:
            real = float(value)
        except OverflowError:
            real = math.inf
        if not math.isfinite(real) or not low <= real <= high or (over and real == low):
            raise self.refuse(key, f"{shown(value)} is not {'above' if over else 'from'} {low:g} to {high:g}")
        return real

    def required(self, key: str, low: float, high: float, *, over: bool = False) -> float:
        """Return a number as ``number`` does; a missing key is refused."""
        value = self.number(key, low, high, over=over)
        if value is None:
            raise self.refuse(key, "missing")
        return value

    def whole(self, key: str, low: int, high: int) -> int | None:
        """Return a whole number in [low, high], or None where the key is missing; 5.0 counts as 5."""
        value = self.get(key)
        if value is None:
            return None
        if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.refuse(key, f"{shown(value)} is not a whole number")
        if not low <= value <= high:
            raise self.refuse(key, f"{shown(value)} is not from {low} to {high}")
        return value

    def text(self, key: str, longest: int = 1_000_000) -> str | None:
        """Return a string, or None where the key is missing."""
        value = self.get(key)
        if value is None:
            return None
        if not isinstance(value, str):
            raise self.refuse(key, f"{shown(value)} is not text")
        if len(value) > longest:
            raise self.refuse(key, f"longer than {longest} characters")
        return value

    def object(self, key: str) -> "Checked | None":
        """Return the object under ``key``, or None where it is missing."""
        value = self.get(key)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.refuse(key, f"{shown(value)} is not an object")
        return Checked(self.path, value, f"{self.place}.{key}" if self.place else key)

    def objects(self, key: str) -> "list[Checked] | None":
        """Return the list of objects under ``key``, or None where it is missing."""
        value = self.get(key)
        if value is None:
            return None
        if not isinstance(value, list):
            raise self.refuse(key, f"{shown(value)} is not a list")
        place = f"{self.place}.{key}" if self.place else key
        checked = []
        for index, item in enumerate(value):
            if not isinstance(item, dict):
                raise self.refuse(f"{key}[{index}]", f"{shown(item)} is not an object")
            checked.append(Checked(self.path, item, f"{place}[{index}]"))
        return checked

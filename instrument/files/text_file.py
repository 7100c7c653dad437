"""Read JSON, TOML and text files: regular files only, bounded in size, depth and number of values."""

import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from instrument.files.recording_error import FileNotReached, RecordingError, one_line, shown, system_message

LARGEST_JSON_BYTES = 16 * 2**20
LARGEST_TOML_BYTES = 2**20  # smaller than for JSON, as the TOML parser is a thousand times slower
MOST_VALUES = 400_000  # values in one file: these take less than 0.3 GB of memory
_MOST_PARTS = 200  # parts of a dotted TOML name; parsing time grows with the square of their number
_BETWEEN_NAMES = re.compile(r"[,=\n\[\]{}#]")

Value = TypeVar("Value")


def open_regular(path: Path) -> int:
    """Return a read-only file descriptor of a regular file; refuse a pipe or a device, which could hang."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise FileNotReached(path, "no such file") from None
    except OSError as error:
        raise FileNotReached(path, system_message(error)) from None
    except ValueError as error:  # a NUL character in the name
        raise RecordingError(path, str(error)) from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise RecordingError(path, "not a regular file")
    return descriptor


def read_text(path: Path, largest_bytes: int) -> str:
    """Return the text of a UTF-8 file of at most ``largest_bytes``.  Raises RecordingError."""
    with os.fdopen(open_regular(path), "rb") as file:
        try:
            raw = file.read(largest_bytes + 1)
        except OSError as error:
            raise FileNotReached(path, system_message(error)) from None
    if len(raw) > largest_bytes:
        room = f"{largest_bytes // 2**20} MiB" if largest_bytes >= 2**20 else f"{largest_bytes // 2**10} KiB"
        raise RecordingError(path, f"larger than {room}")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(path, f"not UTF-8 text (byte {error.start})") from None


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in ``path``.  Raises RecordingError, also for a duplicate key."""

    def parse(text: str) -> Any:
        return json.loads(
            text, parse_constant=_no_constant, parse_float=_finite_number, object_pairs_hook=_without_duplicates
        )

    value = _parsed(path, read_text(path, LARGEST_JSON_BYTES), "JSON", parse)
    if not isinstance(value, dict):
        raise RecordingError(path, f"{shown(value)} where an object is wanted")
    return value


def read_toml(path: Path, largest_bytes: int = LARGEST_TOML_BYTES) -> dict[str, Any]:
    """Return the TOML table in ``path``.  Raises RecordingError."""
    return _parsed(path, read_toml_text(path, largest_bytes), "TOML", tomllib.loads)


def read_toml_text(path: Path, largest_bytes: int = LARGEST_TOML_BYTES) -> str:
    """Return the text of a TOML file if it can be parsed in bounded time.  Raises RecordingError."""
    text = read_text(path, largest_bytes)
    if max(part.count(".") for part in _BETWEEN_NAMES.split(text)) > _MOST_PARTS:
        raise RecordingError(path, f"not TOML that can be read (a name of more than {_MOST_PARTS} parts)")
    return text


def _parsed(path: Path, text: str, what: str, parse: Callable[[str], Value]) -> Value:
    if sum(map(text.count, ",[{")) > MOST_VALUES:
        raise RecordingError(path, f"more than {MOST_VALUES} values")
    try:
        return parse(text)
    except RecursionError:
        raise RecordingError(path, f"not {what} that can be read (nested too deeply)") from None
    except json.JSONDecodeError as error:
        raise RecordingError(path, f"not {what} ({error.msg}, line {error.lineno})") from None
    except ValueError as error:  # a TOML error, NaN, a duplicate key, or an integer of thousands of digits
        raise RecordingError(path, f"not {what} ({error})") from None


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number in JSON")


def _finite_number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{one_line(text)} is beyond every number")
    return value


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    whole = dict(pairs)
    if len(whole) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise ValueError(f"the key {shown(twice)} appears twice")
    return whole

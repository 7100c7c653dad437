"""Read JSON, TOML and text files, regular and of bounded size, depth and number of values; check the values read.

Every error names the file, and the key where there is one.
"""

import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import Any, NoReturn, TypeVar, get_args, get_origin, get_type_hints

from instrument.files.recording_error import FileNotReached, RecordingError, one_line, shown, system_message
from levimass import setting_of

LARGEST_JSON_BYTES = 16 * 2**20
LARGEST_TOML_BYTES = 2**20  # smaller than for JSON, as the TOML parser is a thousand times slower
MAX_VALUES = 400_000  # values in one file: these take less than 0.3 GB of memory
_MAX_PARTS = 200  # parts of a dotted TOML name; parsing time grows with the square of their number
_BETWEEN_NAMES = re.compile(r"[,=\n\[\]{}#]")
_LARGEST = 1e15  # bound of a number in a dataclass field without declared bounds

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
        raise RecordingError(path, f"larger than {largest_bytes // 2**20} MiB")
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


def read_toml(path: Path) -> dict[str, Any]:
    """Return the TOML table in ``path``.  Raises RecordingError."""
    return _parsed(path, read_toml_text(path), "TOML", tomllib.loads)


def read_toml_text(path: Path) -> str:
    """Return the text of a TOML file if it can be parsed in bounded time.  Raises RecordingError."""
    text = read_text(path, LARGEST_TOML_BYTES)
    if max(part.count(".") for part in _BETWEEN_NAMES.split(text)) > _MAX_PARTS:
        raise RecordingError(path, f"not TOML that can be read (a name of more than {_MAX_PARTS} parts)")
    return text


def _parsed(path: Path, text: str, what: str, parse: Callable[[str], Value]) -> Value:
    if sum(map(text.count, ",[{")) > MAX_VALUES:
        raise RecordingError(path, f"more than {MAX_VALUES} values")
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


class CheckedTable:
    """One JSON object or TOML table with its place in the file.  Every method may raise RecordingError."""

    __slots__ = ("path", "place", "used", "values")

    def __init__(self, path: Path, values: Mapping[str, Any], place: str = "") -> None:
        self.path = path
        self.values = values
        self.place = place
        self.used: set[str] = set()

    def error_for(self, key: str, cause: str) -> RecordingError:
        """Return, without raising, the error that ``cause`` makes ``key`` of this object invalid."""
        return RecordingError(self.path, cause, f"{self.place}.{key}" if self.place else key)

    def get(self, key: str) -> Any:
        """Return the value or None, and mark the key as read."""
        self.used.add(key)
        return self.values.get(key)

    def _typed(self, key: str, kind: Any, what: str) -> Any:
        """Return a value of this type, None if the key is missing; of another the error says it "is not" ``what``."""
        value = self.get(key)
        if value is not None and (isinstance(value, bool) or not isinstance(value, kind)):
            raise self.error_for(key, f"{shown(value)} is not {what}")
        return value

    def unread(self) -> dict[str, Any]:
        """Return the values that were not read, so that they can be written back."""
        return {key: value for key, value in self.values.items() if key not in self.used}

    def number(self, key: str, low: float, high: float) -> float | None:
        """Return a finite number in [low, high], None if the key is missing."""
        value = self._typed(key, int | float, "a number")
        if value is None:
            return None
        try:
            real = float(value)
        except OverflowError:
            real = math.inf
        if not math.isfinite(real) or not low <= real <= high:
            raise self.error_for(key, f"{shown(value)} is not from {low:g} to {high:g}")
        return real

    def required(self, key: str, low: float, high: float) -> float:
        """Return a finite number in [low, high]; a missing key is an error."""
        value = self.number(key, low, high)
        if value is None:
            raise self.error_for(key, "missing")
        return value

    def whole(self, key: str, low: int, high: int) -> int | None:
        """Return a whole number in [low, high], None if the key is missing; 5.0 counts as 5."""
        value = self.get(key)
        if value is None:
            return None
        if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error_for(key, f"{shown(value)} is not a whole number")
        if not low <= value <= high:
            raise self.error_for(key, f"{shown(value)} is not from {low} to {high}")
        return value

    def text(self, key: str, longest: int = 10_000) -> str | None:
        """Return a string, None if the key is missing."""
        value: str | None = self._typed(key, str, "text")
        if value is not None and len(value) > longest:
            raise self.error_for(key, f"longer than {longest} characters")
        return value

    def object(self, key: str) -> "CheckedTable | None":
        """Return the object under ``key``, None if it is missing."""
        value = self._typed(key, dict, "an object")
        return None if value is None else CheckedTable(self.path, value, f"{self.place}.{key}" if self.place else key)

    def required_object(self, key: str) -> "CheckedTable":
        """Return the object under ``key``; a missing one is an error."""
        found = self.object(key)
        if found is None:
            raise self.error_for(key, "missing")
        return found

    def objects(self, key: str) -> "list[CheckedTable] | None":
        """Return the list of objects under ``key``, None if it is missing."""
        value = self._typed(key, list, "a list")
        if value is None:
            return None
        items = CheckedTable(self.path, {f"{key}[{index}]": item for index, item in enumerate(value)}, self.place)
        return [items.required_object(place) for place in items.values]

    def names(self, key: str, kind: type = str) -> tuple[Any, ...]:
        """Return the texts (or whole numbers) listed under ``key``; empty if it is missing."""
        values = self.get(key)
        if values is None:
            return ()
        if not isinstance(values, list) or not all(type(value) is kind for value in values):
            raise self.error_for(key, f"not a list of {'names' if kind is str else 'numbers'}")
        return tuple(values)

    def read_dataclass(
        self, kind: type[Value], own: Mapping[str, Callable[["CheckedTable"], Any]] | None = None
    ) -> Value:
        """Return a dataclass with the values of this object, each checked against its field's type and declaration.

        A missing key keeps the field's default; without a default it is an error.  ``own`` maps field names to
        functions that read these fields.
        """
        types, own, values = get_type_hints(kind), own or {}, {}
        for field in fields(kind):  # type: ignore[arg-type]
            name = field.name
            if name in own:
                values[name] = own[name](self)
            elif self.get(name) is not None:
                values[name] = self._field(name, types[name])
                setting = setting_of(field)
                try:
                    if setting is not None:
                        setting.check(values[name])
                except ValueError as error:
                    raise self.error_for(name, str(error)) from None
            elif field.default is MISSING and field.default_factory is MISSING:
                if type(None) not in get_args(types[name]):
                    raise self.error_for(name, "missing")
                values[name] = None
        return kind(**values)

    def _field(self, name: str, kind: Any) -> Any:
        """Return the value under ``name`` as the type of its field."""
        if get_origin(kind) is UnionType:  # a type or None, which stands for a missing key
            kind = next(part for part in get_args(kind) if part is not type(None))
        if get_origin(kind) is tuple:
            return self.names(name, get_args(kind)[0])
        if kind is bool:
            if not isinstance(self.values[name], bool):
                raise self.error_for(name, f"{shown(self.values[name])} is neither true nor false")
            return self.values[name]
        if kind is float:
            return self.number(name, -_LARGEST, _LARGEST)
        if kind is int:
            return self.whole(name, 1, 2**31)
        if isinstance(kind, type) and issubclass(kind, Enum):
            try:
                return kind(self.values[name])
            except ValueError:
                raise self.error_for(
                    name, f"{shown(self.values[name])} is none of {', '.join(map(str, kind))}"
                ) from None
        if kind is str:
            return self.text(name)
        return self.required_object(name).read_dataclass(kind)

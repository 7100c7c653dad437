"""The values of a foreign file, read without trust: every one is checked where it is used."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from instrument.recording_error import RecordingError, shown


class Checked:
    """One JSON object or TOML table with its place in the file, so that every refusal names file and key."""

    __slots__ = ("path", "place", "used", "values")

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

"""Declare settings at dataclass fields, with bounds, unit and words for files, sheet and command line."""

from collections.abc import Sequence
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any

Value = float | str | bool | None
MOST_LISTED = 12  # numbers in a list: a plan predicts each with every candidate
_DECLARED = "setting"


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting; the stored value (SI) times ``scale`` is shown in ``unit``.

    Without a ``group`` it is not in the window, without a ``flag`` not on the command line.
    """

    group: str
    words: str
    kind: str  # "number" | "numbers" (SI, separated by blanks) | "choice" | "folder" | "flag"
    unit: str = ""
    scale: float = 1.0
    low: float = float("-inf")
    high: float = float("inf")
    hover: str = ""
    choices: tuple[tuple[str, str], ...] = ()  # (stored, words)
    optional: bool = False  # may be empty
    flag: str = ""  # of the command line
    metavar: str = ""  # its unit or what it names
    key: str = ""  # the name of the dataclass field

    def check(self, value: Value) -> None:
        """Raise ValueError, which names the setting, for a value that is not allowed."""
        if self.kind == "number":
            if value is None and self.optional:
                return
            if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
                raise self.refused(value, f"is outside {self.low:g} to {self.high:g}")
        elif self.kind == "numbers":
            self._check_list(value)
        elif self.kind == "choice":
            if value not in {stored for stored, _ in self.choices}:
                raise self.refused(value, "is not one of the choices")
        elif self.kind == "flag":
            if not isinstance(value, bool):
                raise self.refused(value, "is neither true nor false")
        elif not isinstance(value, str):
            raise self.refused(value, "is not a text")

    def refused(self, value: object, why: str) -> ValueError:
        """Return the error for a value of this setting; a long value is shortened."""
        shown = "a huge number" if isinstance(value, int) and abs(value) > 10**18 else repr(value)
        return ValueError(f"{self.words or self.key}: {shown if len(shown) < 60 else shown[:57] + '...'} {why}")

    def _check_list(self, value: Value) -> None:
        try:
            numbers = [float(word) for word in value.split()] if isinstance(value, str) else None
        except ValueError:
            numbers = None
        if numbers is None:
            raise self.refused(value, "is not a list of numbers")
        if not numbers and not self.optional:
            raise ValueError(f"{self.words}: a number is missing")
        if len(numbers) > MOST_LISTED:
            raise ValueError(f"{self.words}: {len(numbers)} numbers, a plan can compare at most {MOST_LISTED}")
        for number in numbers:
            if not self.low <= number <= self.high:
                raise ValueError(f"{self.words}: {number:g} is outside {self.low:g} to {self.high:g}")


def number(
    default: float | None,
    group: str,
    words: str,
    unit: str = "",
    scale: float = 1.0,
    low: float = float("-inf"),
    high: float = float("inf"),
    hover: str = "",
    **more: Any,
) -> Any:
    """Return a dataclass field for a number from ``low`` to ``high`` (SI); one whose default is None is optional."""
    more.setdefault("optional", default is None)
    return declared(default, Setting(group, words, "number", unit, scale, low, high, hover, **more))


def choice(
    default: str, group: str, words: str, choices: Sequence[tuple[str, str]], hover: str = "", **more: Any
) -> Any:
    """Return a dataclass field for one of ``choices``, each (stored, words)."""
    return declared(default, Setting(group, words, "choice", hover=hover, choices=tuple(choices), **more))


def flag(default: bool, group: str, words: str, hover: str = "") -> Any:
    """Return a dataclass field for yes or no."""
    return declared(default, Setting(group, words, "flag", hover=hover))


def declared(default: Value, setting: Setting) -> Any:
    """Return a dataclass field with a declaration."""
    return field(default=default, metadata={_DECLARED: setting})


def setting_of(of: "Field[Any]") -> Setting | None:
    """Return the declaration of a dataclass field, or None."""
    setting: Setting | None = of.metadata.get(_DECLARED)
    return None if setting is None else replace(setting, key=of.name)


def settings_of(kind: Any) -> tuple[Setting, ...]:
    """Return the declared settings of a dataclass, in the order of its fields."""
    return tuple(found for of in fields(kind) if (found := setting_of(of)) is not None)

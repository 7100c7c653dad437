"""A setting, declared once at its dataclass field: bounds, unit and words; file, sheet and command line follow."""

from collections.abc import Sequence
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any

Value = float | str | bool | None
MOST_LISTED = 12  # numbers of a list: each is foretold by every model that competes
_DECLARED = "setting"


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting; ``scale`` turns the stored value (SI) into the shown one, in ``unit``.

    Without a ``group`` the window does not offer it; without a ``flag`` the command line does not.
    """

    group: str
    words: str
    kind: str  # "number" | "numbers" (SI, parted by blanks) | "choice" | "folder" | "flag"
    unit: str = ""
    scale: float = 1.0
    low: float = float("-inf")
    high: float = float("inf")
    hover: str = ""
    choices: tuple[tuple[str, str], ...] = ()  # (stored, words)
    optional: bool = False  # an empty field means: not given
    flag: str = ""  # of the command line
    metavar: str = ""  # its unit or what it names
    key: str = ""  # the name of the dataclass field

    def check(self, value: Value) -> None:
        """Raise ValueError, with words that name the setting, for a value that it cannot have."""
        if self.kind == "number":
            if value is None and self.optional:
                return
            if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
                raise self.refused(value, f"is outside {self.low:g} to {self.high:g}")
        elif self.kind == "numbers":
            self._check_list(value)
        elif self.kind == "choice":
            if value not in {stored for stored, _ in self.choices}:
                raise self.refused(value, "is none of the choices")
        elif self.kind == "flag":
            if not isinstance(value, bool):
                raise self.refused(value, "is neither true nor false")
        elif not isinstance(value, str):
            raise self.refused(value, "is not a text")

    def refused(self, value: object, why: str) -> ValueError:
        """Return the error that names this setting and a value, cut where that is long."""
        told = "a huge number" if isinstance(value, int) and abs(value) > 10**18 else repr(value)
        return ValueError(f"{self.words or self.key}: {told if len(told) < 60 else told[:57] + '...'} {why}")

    def _check_list(self, value: Value) -> None:
        try:
            numbers = [float(word) for word in value.split()] if isinstance(value, str) else None
        except ValueError:
            numbers = None
        if numbers is None:
            raise self.refused(value, "is no list of numbers")
        if not numbers and not self.optional:
            raise ValueError(f"{self.words}: a number is missing")
        if len(numbers) > MOST_LISTED:
            raise ValueError(f"{self.words}: {len(numbers)} numbers, of which a plan can weigh {MOST_LISTED}")
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
    """Return a dataclass field that carries its declaration."""
    return field(default=default, metadata={_DECLARED: setting})


def setting_of(of: "Field[Any]") -> Setting | None:
    """Return what a dataclass field declares, its own name as the key."""
    setting: Setting | None = of.metadata.get(_DECLARED)
    return None if setting is None else replace(setting, key=of.name)


def settings_of(kind: Any) -> tuple[Setting, ...]:
    """Return all declarations of a dataclass, in the order of its fields."""
    return tuple(found for of in fields(kind) if (found := setting_of(of)) is not None)

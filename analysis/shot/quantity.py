"""A number with its standard uncertainty, or the reason why it could not be read; display units of numbers."""

import math
import re
from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value, its standard uncertainty in the same unit, and a short description of how it was obtained."""

    value: float
    std: float
    how: str = ""

    def __str__(self) -> str:
        """Render value ± standard uncertainty, both rounded to two digits of the uncertainty."""
        if not (math.isfinite(self.std) and self.std > 0 and math.isfinite(self.value)):
            return f"{self.value:.6g}"
        largest = max(abs(self.value), self.std)
        if 1e-3 <= largest < 1e6:
            return self._rounded()
        exponent = math.floor(math.log10(largest))
        factor = 10.0**-exponent
        return f"({Quantity(self.value * factor, self.std * factor)._rounded()})e{exponent:+d}"

    def _rounded(self) -> str:
        decimals = 1 - math.floor(math.log10(self.std))
        digits = max(decimals, 0)
        return f"{round(self.value, decimals):.{digits}f} ± {round(self.std, decimals):.{digits}f}"

    def in_text(self) -> str:
        """Render the quantity, with a power of ten where the value would begin with zeros or exceed five digits."""
        if not self.value or 1e-2 <= abs(self.value) < 1e5:
            return str(self)
        exponent = int(f"{self.value:e}".partition("e")[2])
        return f"({self.scaled(10.0**-exponent)})e{exponent}"

    def scaled(self, factor: float) -> "Quantity":
        """Return the same quantity in another unit."""
        return Quantity(self.value * factor, self.std * abs(factor), self.how)


@dataclass(frozen=True, slots=True)
class NotSeen:
    """The reason why a number could not be read from this shot."""

    reason: str

    def __str__(self) -> str:
        return "–"


Reading: TypeAlias = Quantity | NotSeen


def to_json(reading: Reading | None) -> dict[str, float] | None:
    """Return a reading as the result file stores it: ``{"value", "std"}``, or null if it could not be read."""
    if not isinstance(reading, Quantity):
        return None
    if not (math.isfinite(reading.value) and math.isfinite(reading.std)):
        return None
    return {"value": float(reading.value), "std": float(reading.std)}


_SYMBOLS = {"n": "N", "s": "s", "m": "m", "kg": "kg", "hz": "Hz", "rad": "rad"}
_POWERS = {"": "", "2": "²", "3": "³", "4": "⁴"}
_DISPLAY_UNITS = {"s": (1e3, "ms"), "m": (1e3, "mm"), "kg": (1e3, "g"), "Pa": (1e-9, "GPa"), "1": (1.0, "")}
_POWER_OF_TIME = {"N": -2, "s": 1, "Hz": -1}
_TOKEN = re.compile(rf"({'|'.join(_SYMBOLS)})([234]?)")


def display_unit(unit: str) -> tuple[float, str]:
    """Return the factor from an SI unit to the unit shown on the screen, and the shown unit; "" for a ratio."""
    return _DISPLAY_UNITS.get(unit, (1.0, unit))


def split_unit(name: str) -> tuple[str, str]:
    """Return the words and the unit of a name: ("coefficient", "N s²/m²") for "coefficient_n_s2_per_m2"; "" if none."""
    tokens = name.split("_")
    begin = len(tokens)
    while begin > 1 and (tokens[begin - 1] == "per" or _TOKEN.fullmatch(tokens[begin - 1])):
        begin -= 1
    unit = "_".join(tokens[begin:])
    above, _, below = unit.partition("_per_")
    if unit.startswith("per_") or unit.endswith("per") or "per" in below.split("_"):
        return name.replace("_", " "), ""
    spelled = _spell_unit(above)
    if below:
        spelled += f"/({_spell_unit(below)})" if "_" in below else f"/{_spell_unit(below)}"
    return " ".join(tokens[:begin]), spelled


def power_of_time(name: str) -> int:
    """Return the power of the second in the unit of a name: -2 for "stiffness_n_per_m", as N is kg m/s²."""
    return power_of_second(split_unit(name.rpartition(".")[2])[1])


def power_of_second(unit: str) -> int:
    """Return the power of the second in a unit: -1 for "N s/m", as N is kg m/s²."""
    above, _, below = unit.partition("/")
    return _power_above(above) - _power_above(below.strip("()"))


def _power_above(spelled: str) -> int:
    found = [re.fullmatch(r"(N|s|Hz)([²³⁴]?)", part) for part in spelled.split()]
    powers = {"": 1, "²": 2, "³": 3, "⁴": 4}
    return sum(_POWER_OF_TIME[match[1]] * powers[match[2]] for match in found if match)


def _spell_unit(tokens: str) -> str:
    found = [_TOKEN.fullmatch(token) for token in tokens.split("_")]
    return " ".join(_SYMBOLS[match[1]] + _POWERS[match[2]] for match in found if match)

"""A number as an instrument states it: value with standard uncertainty, or the reason why it was not seen."""

import math
from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value, its standard uncertainty in the same unit, and in a few words how it was read."""

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

    def in_a_sentence(self) -> str:
        """Render it with a power of ten where it has more than a zero or five digits before it says anything."""
        if not self.value or 1e-2 <= abs(self.value) < 1e5:
            return str(self)
        exponent = int(f"{abs(self.value):e}".partition("e")[2])
        return f"({self.scaled(10.0**-exponent)})e{exponent}"

    def scaled(self, factor: float) -> "Quantity":
        """Return the same reading in another unit."""
        return Quantity(self.value * factor, self.std * abs(factor), self.how)


@dataclass(frozen=True, slots=True)
class NotSeen:
    """The reason why a number could not be read from this shot."""

    reason: str

    def __str__(self) -> str:
        return "–"


Reading: TypeAlias = Quantity | NotSeen


def to_json(reading: Reading | None) -> dict[str, float] | None:
    """Return the result file's form of a reading: ``{"value", "std"}``, or null where it was not seen."""
    if not isinstance(reading, Quantity):
        return None
    if not (math.isfinite(reading.value) and math.isfinite(reading.std)):
        return None
    return {"value": float(reading.value), "std": float(reading.std)}

"""The prefix with which a unit's numbers are short: 0.0004 m are 0.4 mm."""

import math

_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: ""}


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Return what to multiply numbers of a unit up to ``largest`` by, and the unit they are in then."""
    if not largest > 0 or not math.isfinite(largest):
        return 1.0, unit
    power = 3 * math.floor(math.log10(largest * 1.0000001) / 3)
    power = min(0, max(min(_PREFIXES), power))
    return 10.0**-power, _PREFIXES[power] + unit

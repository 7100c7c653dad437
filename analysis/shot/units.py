"""The unit that a name carries: "coefficient_n_s2_per_m2" is a coefficient in N s²/m²."""

import re

_SYMBOLS = {"n": "N", "s": "s", "m": "m", "kg": "kg", "hz": "Hz", "rad": "rad"}
_POWERS = {"": "", "2": "²", "3": "³", "4": "⁴"}
_SHOWN = {"s": (1e3, "ms"), "m": (1e3, "mm"), "kg": (1e3, "g"), "Pa": (1e-9, "GPa"), "1": (1.0, "")}
_OF_TIME = {"N": -2, "s": 1, "Hz": -1}
_TOKEN = re.compile(rf"({'|'.join(_SYMBOLS)})([234]?)")


def shown_in(unit: str) -> tuple[float, str]:
    """Return the factor to the unit in which a number in this SI unit is shown, and that unit; "" for a ratio."""
    return _SHOWN.get(unit, (1.0, unit))


def parts(name: str) -> tuple[str, str]:
    """Return ("coefficient", "N s²/m²") for "coefficient_n_s2_per_m2"; a name without a unit has the unit ""."""
    tokens = name.split("_")
    begin = len(tokens)
    while begin > 1 and (tokens[begin - 1] == "per" or _TOKEN.fullmatch(tokens[begin - 1])):
        begin -= 1
    unit = "_".join(tokens[begin:])
    above, _, below = unit.partition("_per_")
    if unit.startswith("per_") or unit.endswith("per") or "per" in below.split("_"):
        return name.replace("_", " "), ""
    spelled = _spelled(above)
    if below:
        spelled += f"/({_spelled(below)})" if "_" in below else f"/{_spelled(below)}"
    return " ".join(tokens[:begin]), spelled


def power_of_time(name: str) -> int:
    """Return the power of the second that a name's unit holds: -2 for "stiffness_n_per_m", as N is kg m/s²."""
    unit = parts(name.rpartition(".")[2])[1]
    above, _, below = unit.partition("/")
    return _seconds(above) - _seconds(below.strip("()"))


def _seconds(spelled: str) -> int:
    found = [re.fullmatch(r"(N|s|Hz)([²³⁴]?)", part) for part in spelled.split()]
    powers = {"": 1, "²": 2, "³": 3, "⁴": 4}
    return sum(_OF_TIME[match[1]] * powers[match[2]] for match in found if match)


def _spelled(tokens: str) -> str:
    found = [_TOKEN.fullmatch(token) for token in tokens.split("_")]
    return " ".join(_SYMBOLS[match[1]] + _POWERS[match[2]] for match in found if match)

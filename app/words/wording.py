"""Format numbers and names for the window, in the system's decimal format."""

import math
import re
from collections.abc import Mapping

from PySide6.QtCore import QLocale

from analysis.collision import Effect, UserLaw
from analysis.shot import NotSeen, Quantity, Reading, split_unit
from app.words.markup import Markup, lines, tag
from app.words.model_texts import DASH, prefix_for

COMBINED = "± is the combined standard uncertainty, from all sources in the budget."
NOISE_ONLY = "± is the standard uncertainty from this shot's noise alone."
LONGEST_NAME = 24  # most characters of a shot's name in a list of names


def localised_number(text: str) -> str:
    """Convert the text of a number with "." to the system's decimal format."""
    point = QLocale().decimalPoint()
    return text if point == "." else text.replace(".", point)


def localised_text(text: str) -> str:
    """Convert a sentence for the window: system's decimal sign, short exponents, "Coulomb", "Stribeck", "→"."""
    plain = re.sub(r"(?<![\w.)])(\d+(?:\.\d+)?)e\+?0*([0-6])\b", lambda m: f"{float(m[0]):.0f}", text)
    plain = re.sub(r"(?<=\d)e([+-])0?(\d+)", lambda found: f"e{found[1].replace('+', '')}{found[2]}", plain)
    plain = re.sub(r"\b(coulomb|stribeck)\b", lambda m: m[0].capitalize(), plain.replace("->", "→"))
    point = QLocale().decimalPoint()
    return plain if point == "." else re.sub(r"(?<=\d)\.(?=\d)", point, plain)


def number(value: float | None, digits: int = 4) -> str:
    """Return a number with this many significant digits, or a dash."""
    if value is None or not math.isfinite(value):
        return DASH
    text = f"{value + 0.0:.{digits}g}"  # + 0.0 avoids "-0"
    mantissa, exponent, power = text.partition("e")
    if not exponent:
        return localised_number(text)
    if 0 < int(power) < 7:  # 14900, not 1.49e+04
        return localised_number(f"{float(text):.0f}")
    return localised_number(f"{mantissa}e{int(power)}")


def value_text(reading: Reading | None, scale: float = 1.0) -> str:
    """Return "value ± std", both multiplied by ``scale``, or a dash."""
    if not isinstance(reading, Quantity) or not math.isfinite(reading.value):
        return DASH
    return localised_number(str(reading.scaled(scale)))


def concise_text(reading: Reading | None, scale: float = 1.0) -> str:
    """Return "0.98756(12)", with the standard uncertainty of the last digits in brackets, or a dash."""
    if not isinstance(reading, Quantity) or not math.isfinite(reading.value):
        return DASH
    value, std = reading.value * scale, reading.std * abs(scale)
    if not (math.isfinite(std) and std > 0):
        return localised_number(f"{value:.6g}")
    decimals = 1 - math.floor(math.log10(std))
    if decimals <= 0 or decimals > 12:
        return value_text(reading, scale)
    digits = round(std * 10**decimals)
    return localised_number(f"{value:.{decimals}f}({digits})")


def reading_tooltip(
    name: str, reading: Reading | None, meaning: str = "", std: str = "± is the standard uncertainty."
) -> Markup:
    """Return the tooltip of a number: meaning, how it was read or why not; ``std`` is a sentence that explains ±."""
    said = [tag("b", name), meaning]
    if isinstance(reading, Quantity):
        said.append(f"Read from: {reading.how}" if reading.how else "")
        if reading.std > 0 and math.isfinite(reading.std):
            said.append(std)
    elif isinstance(reading, NotSeen):
        said.append(f"Not measured: {reading.reason}")
    else:
        said.append("No shot yet.")
    return lines(filter(None, said))


def effect_numbers(effect: Effect, parameters: Mapping[str, Quantity]) -> str:
    """Return an effect's parameters with units (an own law declares its units), each kept on one line."""
    units = {p.name: p.unit for p in effect.parameters} if isinstance(effect, UserLaw) else {}
    return ", ".join(unbroken(parameter_words(name, value, units.get(name))) for name, value in parameters.items())


def parameter_words(name: str, value: Quantity, unit: str | None = None) -> str:
    """Return "coefficient (1.90 ± 0.10)e-3 N s²/m²" for "coefficient_n_s2_per_m2"."""
    base, _, shot = name.partition(".")
    words, unit = split_unit(base) if unit is None else (base, unit)
    which = f" of shot {shot}" if shot else ""
    return f"{words}{which} {localised_number(value.in_text())} {unit}".rstrip()


def unbroken(words: str) -> str:
    """Return a text without possible line breaks, neither at a space nor after the slash of a unit."""
    return words.replace(" ", "\u00a0").replace("/", "/\u2060")


def short_name(name: str) -> str:
    """Return a name, shortened in the middle if it is long, because names of shots often differ at the end."""
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME // 2 - 1]}…{name[-LONGEST_NAME // 2 :]}"


def duration(seconds: float) -> str:
    """Return minutes and seconds, like "01:05"."""
    whole = max(0, int(seconds))
    return f"{whole // 60:02d}:{whole % 60:02d}"


def size_words(size_bytes: float) -> str:
    """Return a disk size, like "412 GB"."""
    for unit in ("B", "kB", "MB", "GB"):
        if size_bytes < 1000:
            return f"{size_bytes:.0f} {unit}"
        size_bytes /= 1000
    return localised_number(f"{size_bytes:.1f} TB")


def cached_words(version: str) -> str:
    """Return "cached result" with the version of the program that made it."""
    return f"cached result, version {version}"


def with_prefix(value: float | None, unit: str) -> str:
    """Return a value with a prefixed unit, like "111 µm" for 1.11e-4 m; a dash for None."""
    if value is None or not math.isfinite(value):
        return DASH
    factor, words = prefix_for(value, unit)
    return f"{number(factor * value, 3)} {words}"


def typed_number(text: str) -> float:
    """Parse a typed number, with a point or a comma as the decimal sign.

    Raises ValueError with the reason, also for several signs, because the thousands separator depends on the country.
    """
    plain = text.strip().replace("−", "-")
    if plain.count(".") + plain.count(",") > 1:
        raise ValueError(f"{text} is ambiguous: use one decimal sign and no thousands separators")
    try:
        value = float(plain.replace(",", "."))
    except ValueError:
        raise ValueError(f"{text} is not a number") from None
    if "_" in plain or not math.isfinite(value):
        raise ValueError(f"{text} is not a number")
    return value


def typed_numbers(text: str) -> tuple[float, ...]:
    """Parse a list of numbers separated by blanks, semicolons, or commas before a blank.

    Raises ValueError as ``typed_number`` does.
    """
    words = (word.removesuffix(",") for word in text.replace(";", " ").split())
    return tuple(typed_number(word) for word in words if word)

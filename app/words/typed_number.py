"""Numbers as a person types them, whatever the screen's language is."""

import math


def typed_number(text: str) -> float:
    """Return the number: a point and a comma both are the decimal sign.

    Raises ValueError, with the reason in words, where there is more than one of them: which one marks the decimals and
    which one thousands depends on the country, and the wrong guess is wrong by a factor of a thousand.
    """
    plain = text.strip().replace("−", "-")
    if plain.count(".") + plain.count(",") > 1:
        raise ValueError(f"{text} could be read in two ways: write it with one decimal sign and without groups")
    try:
        value = float(plain.replace(",", "."))
    except ValueError:
        raise ValueError(f"{text} is not a number") from None
    if "_" in plain or not math.isfinite(value):
        raise ValueError(f"{text} is not a number")
    return value


def typed_numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a list, parted by blanks or semicolons; a comma before a blank parts too.

    Raises ValueError as ``typed_number`` does.
    """
    words = (word.removesuffix(",") for word in text.replace(";", " ").split())
    return tuple(typed_number(word) for word in words if word)

"""Weights on the block: which shots of a set were taken as found, and which with how much added."""

from collections.abc import Sequence
from itertools import groupby

_SAME_KG = 1e-6  # a balance's milligram: weighed twice, not weighted


def weights_words(masses_kg: Sequence[float]) -> str:
    """Return who was taken how ("shots 1-3 as found, 4-5 with 50.00 g added"); nothing where all weigh the same.

    The lightest block of the set is the block as found.
    """
    if not masses_kg or max(masses_kg) - min(masses_kg) <= _SAME_KG:
        return ""
    found = min(masses_kg)
    added = [mass - found if mass - found > _SAME_KG else 0.0 for mass in masses_kg]
    kinds = [f"with {1e3 * kg:.2f} g added" if kg else "as found" for kg in added]
    return f"shots {numbered(kinds)}"


def numbered(kinds: Sequence[str]) -> str:
    """Return who of several is of which kind: "1-3 as found, 4-5 with 50.00 g added"."""
    parts, number = [], 1
    for kind, group in groupby(kinds):
        count = len(list(group))
        parts.append(f"{number}-{number + count - 1} {kind}" if count > 1 else f"{number} {kind}")
        number += count
    return ", ".join(parts)

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
    parts, number = [], 1
    for more, group in groupby(added, key=lambda kg: round(kg / _SAME_KG)):
        count = len(list(group))
        which = f"{number}-{number + count - 1}" if count > 1 else f"{number}"
        number += count
        parts.append(f"{which} {f'with {1e3 * _SAME_KG * more:.2f} g added' if more else 'as found'}")
    return f"shots {', '.join(parts)}"

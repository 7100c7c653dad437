"""Numbers with their combined standard uncertainties: all sources of a shot's budget together."""

from collections.abc import Mapping
from dataclasses import replace

from analysis.shot.quantity import Quantity, Reading
from analysis.shot.shot import Shot
from analysis.uncertainty.budget import budget


def combined_of(shot: Shot) -> dict[str, float]:
    """Return the combined standard uncertainty of each number that has a budget, by its key; some ms."""
    return {q.key: q.std for q in budget(shot).quantities} if shot.impact is not None else {}


def stated(reading: Reading, key: str, combined: Mapping[str, float]) -> Reading:
    """Return a reading with the uncertainty that stands under its key, or as it is where none does."""
    std = combined.get(key)
    return replace(reading, std=std) if isinstance(reading, Quantity) and std is not None else reading

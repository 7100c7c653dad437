"""The combined standard uncertainties of the listed shots, computed once per shot; and what ± means on the screen."""

from collections.abc import Iterable, Mapping

from analysis.shot.shot import Shot
from analysis.uncertainty.budget import combined_of

COMBINED = "± is the combined standard uncertainty, from all sources in the budget."
NOISE_ONLY = "± is the standard uncertainty from this shot's noise alone."


class CombinedCache:
    """Combined standard uncertainties by shot."""

    def __init__(self) -> None:
        self._made: dict[int, tuple[Shot, Mapping[str, float]]] = {}  # by the id of the shot, which is kept alive

    def of(self, shot: Shot) -> Mapping[str, float]:
        """Return the combined standard uncertainties of a shot."""
        if id(shot) not in self._made:
            self._made[id(shot)] = (shot, combined_of(shot))
        return self._made[id(shot)][1]

    def keep(self, shots: Iterable[Shot]) -> None:
        """Drop all shots but these."""
        listed = {id(shot) for shot in shots}
        self._made = {key: made for key, made in self._made.items() if key in listed}

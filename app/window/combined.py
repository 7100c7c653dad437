"""The combined standard uncertainties of a shot's numbers, all sources of its budget together; made once a shot."""

from collections.abc import Iterable, Mapping

from analysis.budget import budget
from analysis.shot import Shot

COMBINED = "± is the combined standard uncertainty, all sources of the budget together."


def combined_of(shot: Shot) -> dict[str, float]:
    """Return the combined standard uncertainty of each number that has a budget, by its key; some ms."""
    return {q.key: q.std for q in budget(shot).quantities} if shot.impact is not None else {}


class CombinedOnce:
    """Keeps what was made for as long as its shot is listed."""

    def __init__(self) -> None:
        self._made: dict[int, tuple[Shot, Mapping[str, float]]] = {}  # by the shot's identity, which it keeps alive

    def of(self, shot: Shot) -> Mapping[str, float]:
        """Return the combined standard uncertainties of a shot."""
        if id(shot) not in self._made:
            self._made[id(shot)] = (shot, combined_of(shot))
        return self._made[id(shot)][1]

    def keep(self, shots: Iterable[Shot]) -> None:
        """Forget all shots but these."""
        listed = {id(shot) for shot in shots}
        self._made = {key: made for key, made in self._made.items() if key in listed}

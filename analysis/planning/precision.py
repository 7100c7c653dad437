"""Which next shots make a number twice as sure, or all of them surer: the same exact derivatives, nobody competing.

The information of independent shots adds up; a shot's own start is eliminated from its part.  For one parameter the
criterion is its variance (c-optimal; A-optimal is the same over several), for all of them the determinant of their
covariance (D-optimal; Fedorov, "Theory of Optimal Experiments", ch. 2).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import exp, inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.collision.parameters import Infeasible
from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.planning.foreseen import at_hand, blank, foretold, informs
from analysis.planning.next_shot import NextShot, Reach, as_found_kg, effort, in_order, next_shots
from analysis.shot.shot import AnalysisError, Cancelled, Progress, Stop

Floats = NDArray[np.float64]
ALL = "all"
HALF = 0.5
_MOST = 3
_KEPT = 8  # shots that go on into sequences of several


@dataclass(frozen=True, slots=True)
class Sharper:
    """The shots that make a parameter surer: its standard uncertainty after them over that before, and both.

    For ``ALL`` ``ratio`` is the geometric mean over the parameters, and the uncertainties are not given.
    """

    parameter: str
    shots: tuple[NextShot, ...]
    ratio: float
    std_before: float | None
    std_after: float | None

    @property
    def words(self) -> str:
        """Get the promise in words, without the shots."""
        if self.parameter == ALL:
            return f"all parameters {1 / self.ratio:.2g} times as sure, on the geometric mean"
        return f"{self.parameter} {1 / self.ratio:.2g} times as sure ({self.std_before:.2g} to {self.std_after:.2g})"

    def to_json(self) -> dict[str, Any]:
        """Return the plan as the result file has it (docs/formats.md)."""
        return {
            "parameter": self.parameter,
            "shots": [shot.to_json() for shot in self.shots],
            "ratio": self.ratio,
            "std_before": self.std_before,
            "std_after": self.std_after,
        }


def sharpen(
    fitted: Fitted,
    parameter: str,
    reach: Reach | None = None,
    *,
    wanted: float = HALF,
    progress: Progress = lambda _what, _fraction: None,
    stop: Stop = lambda: False,
) -> Sharper:
    """Return the cheapest one to three shots that leave ``parameter`` ``wanted`` of its uncertainty; else the best.

    ``parameter`` is a shared one by its name in the fit ("contact_stiffness_n_per_m", "viscous_drag.coefficient_..."),
    or ``ALL``.  Raises AnalysisError for a name that is not the fit's, Cancelled.
    """
    hypothesis = fitted.hypothesis
    shared = hypothesis.shared
    names = [hypothesis.names[place][0] for place in shared]
    if parameter != ALL and parameter not in names:
        raise AnalysisError(f"no shared parameter is called {parameter!r}; there are {', '.join(names)}")
    slope = hypothesis.slope(fitted.z)[np.ix_(shared, shared)]
    row = None if parameter == ALL else slope[names.index(parameter)]
    samples, floor = hypothesis.data.shots, fitted.floor
    known = at_hand(fitted, floor).curvature
    candidates = next_shots(samples, reach or Reach())

    def of_shot(shot: NextShot) -> Floats | None:
        if stop():
            raise Cancelled
        try:
            return informs(fitted, foretold(fitted, blank(shot, fitted)), floor).curvature
        except Infeasible:
            return None

    progress("foretelling the next shots", 0.1)
    each = {shot: c for shot, c in zip(candidates, side_by_side(of_shot, candidates), strict=True) if c is not None}
    before = _spread(known, row)

    def ratio(shots: Sequence[NextShot]) -> float:
        return _spread(known + sum(each[shot] for shot in shots), row) / before

    on_the_block = samples[-1].moving_mass_kg - as_found_kg(samples)
    alone = {shot: ratio((shot,)) for shot in each}
    kept = sorted(alone, key=alone.__getitem__)[:_KEPT]
    sequences: list[tuple[NextShot, ...]] = [(shot,) for shot in alone]
    sequences += [some for length in range(2, _MOST + 1) for some in combinations_with_replacement(kept, length)]
    reached = {some: ratio(some) for some in sequences}

    def order(some: tuple[NextShot, ...]) -> tuple[float, float]:
        return (effort(some, on_the_block) if reached[some] <= wanted else inf, reached[some])

    best = min(reached, key=order)
    progress("planned", 1.0)
    stated = parameter != ALL
    return Sharper(
        parameter,
        in_order(best, on_the_block),
        reached[best],
        before if stated else None,
        before * reached[best] if stated else None,
    )


def _spread(curvature: Floats, row: Floats | None) -> float:
    """Return the standard uncertainty of ``row`` times the parameters; without a row the geometric mean of all."""
    scale = np.sqrt(np.diag(curvature))
    scaled = curvature / np.outer(scale, scale)
    if row is None:
        return exp(-0.5 * float(np.linalg.slogdet(scaled)[1] + 2 * np.log(scale).sum()) / scale.size)
    along = row / scale
    return float(np.sqrt(along @ np.linalg.solve(scaled, along)))

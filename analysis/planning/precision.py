"""Plan the shots that reduce the uncertainty of one parameter, or of all of them.

The information of independent shots adds up, each shot's own start eliminated.  For one parameter the criterion is its
variance (c-optimal), for all of them the determinant of their covariance (D-optimal; Fedorov, "Theory of Optimal
Experiments", ch. 2).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import exp, inf
from typing import Any

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.inference import Fitted
from analysis.planning.next_shot import NextShot, Reach, effort, in_order, mass_without_weights_kg, next_shots
from analysis.planning.predictions import blank_shot, information_of, predict, present_information
from analysis.shot import AnalysisError, Floats

ALL = "all"
HALF = 0.5
_MOST = 3
_KEPT = 8  # shots that are combined into sequences of several


@dataclass(frozen=True, slots=True)
class PrecisionPlan:
    """The shots that reduce a parameter's standard uncertainty; ``ratio`` is the uncertainty after over that before.

    For ``ALL`` the ratio is the geometric mean over the parameters, and the uncertainties are None.
    """

    parameter: str
    shots: tuple[NextShot, ...]
    ratio: float
    std_before: float | None
    std_after: float | None

    @property
    def words(self) -> str:
        if self.parameter == ALL:
            return f"all parameters {1 / self.ratio:.2g} times as sure, on the geometric mean"
        return f"{self.parameter} {1 / self.ratio:.2g} times as sure ({self.std_before:.2g} to {self.std_after:.2g})"

    def to_json(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "shots": [shot.to_json() for shot in self.shots],
            "ratio": self.ratio,
            "std_before": self.std_before,
            "std_after": self.std_after,
        }


def plan_precision(
    fitted: Fitted,
    parameter: str,
    reach: Reach | None = None,
    *,
    wanted: float = HALF,
) -> PrecisionPlan:
    """Return the cheapest one to three shots with an uncertainty ``ratio`` of at most ``wanted``, else the best ones.

    ``parameter`` is the name of a shared parameter in the fit ("contact_stiffness_n_per_m",
    "viscous_drag.coefficient_..."), or ``ALL``.  Raises AnalysisError for another name.
    """
    problem = fitted.problem
    shared = problem.shared
    names = [problem.names[place][0] for place in shared]
    if parameter != ALL and parameter not in names:
        raise AnalysisError(f"no shared parameter is called {parameter!r}; there are {', '.join(names)}")
    slope = problem.slopes(fitted.z)[0, : len(shared), : len(shared)]
    row = None if parameter == ALL else slope[names.index(parameter)]
    samples, floor = problem.data.shots, fitted.noise
    known = present_information(fitted, floor).curvature
    candidates = next_shots(samples, reach or Reach())

    def of_shot(shot: NextShot) -> Floats | None:
        try:
            return information_of(fitted, predict(fitted, blank_shot(shot, fitted)), floor).curvature
        except Infeasible:
            return None

    each = {shot: c for shot, c in zip(candidates, side_by_side(of_shot, candidates), strict=True) if c is not None}
    before = _spread(known, row)

    def ratio(shots: Sequence[NextShot]) -> float:
        return _spread(known + sum(each[shot] for shot in shots), row) / before

    on_the_block = samples[-1].moving_mass_kg - mass_without_weights_kg(samples)
    alone = {shot: ratio((shot,)) for shot in each}
    kept = sorted(alone, key=alone.__getitem__)[:_KEPT]
    sequences: list[tuple[NextShot, ...]] = [(shot,) for shot in alone]
    for length in range(2, _MOST + 1):
        sequences += [in_order(some, on_the_block) for some in combinations_with_replacement(kept, length)]
    reached = {some: ratio(some) for some in sequences}

    def order(some: tuple[NextShot, ...]) -> tuple[float, float]:
        return (effort(some, on_the_block) if reached[some] <= wanted else inf, reached[some])

    best = min(reached, key=order)
    stated = parameter != ALL
    return PrecisionPlan(
        parameter,
        best,
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

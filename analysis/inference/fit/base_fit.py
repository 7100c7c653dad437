"""Fit the base model at the diagnosis' sample rate, as the start of the search for effects."""

from collections.abc import Sequence

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.base import SearchStart
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.free_parameters import trials_of
from analysis.inference.fit.hypothesis import Hypothesis, JointData
from analysis.inference.fit.hypothesis_fit import Fitted, first_floor, fit_hypothesis
from analysis.inference.fit.samples import Samples
from analysis.inference.fit.situation import too_fast
from analysis.inference.noise.floor import white_by_differences
from analysis.shot import AnalysisError, Stop
from analysis.signal import LEAST_NOISE_M

_SAMPLES = 100  # at least
_SOFTER = 8  # times, at most, that a contact too stiff for the samples is softened tenfold


def base_fit(data: JointData, begin: SearchStart, stop: Stop, nuisances: Sequence[Effect] = ()) -> Fitted:
    """Return the base model's best fit at the diagnosis' sample rate, searched from ``begin``.

    ``nuisances`` are effects that every shot may have for itself and that do not count as findings.
    """
    along = trials_of(nuisances)
    values = tuple({kind.effect: kind.starts[0] for kind in along} for _ in data.shots)
    point = Point(begin.shared, begin.own, values)
    hypothesis = Hypothesis(data, along)
    point = slow_enough(hypothesis, point)
    z = hypothesis.pack(point)
    try:
        return fit_hypothesis(
            hypothesis, z, first_floor(hypothesis, z, white_of(data.shots)), anew=True, cancelled=stop
        )
    except Infeasible as why:
        raise AnalysisError(f"no motion of the base model comes near these shots: {why}") from why


def white_of(shots: Sequence[Samples]) -> float:
    """Return the white noise of an averaged sample in m from third differences; AnalysisError with too few samples."""
    if sum(int(np.count_nonzero(s.valid[3:] & s.valid[:-3])) for s in shots) < _SAMPLES:
        raise AnalysisError("too few samples for a diagnosis")
    return max(white_by_differences([s.displacement_m for s in shots], [s.valid for s in shots]), LEAST_NOISE_M)


def nuisances_pay(best: Fitted, nuisances: Sequence[Effect], stop: Stop) -> bool:
    """Return whether the ``nuisances`` effects lower the criterion (BIC), given the other effects of a fit."""
    hypothesis, point = best.hypothesis, best.point
    kinds = tuple(kind for kind in hypothesis.effects if kind.effect not in nuisances)
    bare = Hypothesis(hypothesis.data, kinds, hypothesis.fixed)
    values = tuple({effect: v for effect, v in of.items() if effect not in nuisances} for of in point.values)
    try:
        return (
            best.bic
            < fit_hypothesis(bare, bare.pack(Point(point.base, point.own, values)), best.floor, cancelled=stop).bic
        )
    except Infeasible:
        return True


def slow_enough(hypothesis: Hypothesis, point: Point) -> Point:
    """Return the point with a contact soft enough for the samples: a search cannot start from a rigid one."""
    shot = hypothesis.data.shots[0]
    for _ in range(_SOFTER):
        here = hypothesis.shot_at(0, point)
        if not too_fast(here.base, here.own, here.values, shot.moving_mass_kg, shot.spacing_s, shot.factor):
            break
        softer = point.base.copy()
        softer[hypothesis.data.base.contact_at] *= [0.1, 0.3]
        point = Point(softer, point.own, point.values)
    return point

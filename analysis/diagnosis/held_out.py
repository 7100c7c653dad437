"""How a model does on a shot that took no part in its fit."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.compare import Fitted, fit, square_of
from analysis.diagnosis.floor import Floor
from analysis.diagnosis.hypothesis import Hypothesis, Point, Rig
from analysis.model.least_squares import Infeasible, minimise

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Foretold:
    """A held-out shot as the others foretell it: its displacement on the motion's grid, and the whitened chi^2."""

    displacement_m: Floats
    chi2: float


def choose(rig: Rig) -> int | None:
    """Return the shot to hold out: the middle speed of three or more, the slower of two, none of one."""
    speeds = [abs(shot.course.velocity_in_m_per_s) for shot in rig.shots]
    order = [int(i) for i in np.argsort(speeds)]
    if len(order) < 2:
        return None
    return order[0] if len(order) == 2 else order[len(order) // 2]


def foretell(fitted: Fitted, held: int, floor: Floor, stop: Callable[[], bool]) -> Foretold | None:
    """Fit the shared parameters on all shots but ``held``, only the start of that one on itself; None where it fails.

    ``floor`` whitens the held-out shot: give the same one to what is compared.
    """
    hypothesis = fitted.hypothesis
    point = fitted.point
    others = [i for i in range(len(hypothesis.rig.shots)) if i != held]
    some = _subset(hypothesis, others)
    one = _subset(hypothesis, [held])
    try:
        begin = some.pack(Point(point.base, point.own[others], tuple(point.values[i] for i in others)))
        trained = fit(some, begin, fitted.floor, evaluations=10, cancelled=stop)
        learnt = trained.point
        values = {name: dict(v) for name, v in point.values[held].items()}
        for name, knob, shot in some.knobs:
            if shot < 0:
                values[name][knob.name] = learnt.values[0][name][knob.name]
        z = one.pack(Point(learnt.base, point.own[[held]], (values,)))
        low, high = one.bounds
        shared = [*range(hypothesis.rig.count)]
        shared += [one.offset + k for k, (_, _, shot) in enumerate(one.knobs) if shot < 0]
        low[shared] = high[shared] = z[shared]
        found = minimise(lambda at: square_of(one, floor, at), z, lower=low, upper=high, evaluations=10, tolerance=1e-2)
        return Foretold(one.full(one.unpack(found.parameters))[0], found.square.chi2)
    except (Infeasible, np.linalg.LinAlgError):
        return None


def _subset(hypothesis: Hypothesis, shots: list[int]) -> Hypothesis:
    rig = replace(hypothesis.rig, shots=tuple(hypothesis.rig.shots[i] for i in shots))
    return replace(hypothesis, rig=rig)

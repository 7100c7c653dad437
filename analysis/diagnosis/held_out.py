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
    """Held-out shots as the others foretell them: displacements on the motions' grids, whitened chi^2 of all.

    ``rms_m`` is how far they lie from what was measured, averaged samples of all held-out shots together.
    """

    displacement_m: tuple[Floats, ...]
    chi2: float
    rms_m: float

    def beats(self, other: "Foretold") -> bool:
        """Return whether this foretells better: more likely, and not further off."""
        return self.chi2 < other.chi2 and self.rms_m < 1.02 * other.rms_m


def choose(rig: Rig) -> tuple[int, ...]:
    """Return the shots to hold out, one at a time: all of four or more, of three the middle, of two the slower."""
    speeds = [abs(shot.course.velocity_in_m_per_s) for shot in rig.shots]
    order = [int(i) for i in np.argsort(speeds)]
    if len(order) < 2:
        return ()
    if len(order) > 3:
        return tuple(range(len(order)))
    return (order[0],) if len(order) == 2 else (order[1],)


def foretell(fitted: Fitted, held: tuple[int, ...], floor: Floor, stop: Callable[[], bool]) -> Foretold | None:
    """Foretell each held-out shot from a fit of the shared parameters to all others; None where one fails.

    Only its start is fitted on the shot itself.  ``floor`` whitens it: give the same one to what is compared.
    """
    shown, chi2, off = [], 0.0, []
    for shot in held:
        told = _foretell(fitted, shot, floor, stop)
        if told is None:
            return None
        shown.append(told[0])
        chi2 += told[1]
        measured = fitted.hypothesis.rig.shots[shot]
        off.append((measured.averaged(told[0]) - measured.displacement_m)[measured.valid])
    return Foretold(tuple(shown), chi2, float(np.sqrt(np.mean(np.concatenate(off) ** 2))))


def _foretell(fitted: Fitted, held: int, floor: Floor, stop: Callable[[], bool]) -> tuple[Floats, float] | None:
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
        return one.full(one.unpack(found.parameters))[0], found.square.chi2
    except (Infeasible, np.linalg.LinAlgError):
        return None


def _subset(hypothesis: Hypothesis, shots: list[int]) -> Hypothesis:
    rig = replace(hypothesis.rig, shots=tuple(hypothesis.rig.shots[i] for i in shots))
    return replace(hypothesis, rig=rig)

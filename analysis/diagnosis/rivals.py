"""What would do almost as well: an effect's nearest look-alikes, fitted in its place.

To first order one effect may stand well apart from another that a bent path leads to: a soft support is a second plate
mode at a frequency of its own.  So the nearest are fitted, from where they imitate the effect best.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from analysis.diagnosis.compare import Fitted, finish, fit, search
from analysis.diagnosis.explore import WORTH_FINISHING, Trail
from analysis.diagnosis.hypothesis import Hypothesis, Point
from analysis.diagnosis.knobs import Kind
from analysis.diagnosis.remainder import Remainder, judge
from analysis.diagnosis.screen import Projector, fixed_of, projector
from analysis.diagnosis.separate import LEAST_SEPARATION, Separation, separation
from analysis.model.least_squares import Infeasible
from analysis.shot import Cancelled

Stop = Callable[[], bool]
Separations = Mapping[str, Separation]

_FITTED = 2  # look-alikes of an effect at most
_ALIKE = 0.45  # of an effect's size is left beside a look-alike that is worth a fit
_BETTER = 1.0  # of the criterion, for a look-alike to take the place
_NEARLY = 20.0  # of the criterion behind the best: likely enough to be asked where the best misses something


def apart(before: Fitted, best: Fitted, at: Projector, catalogue: Sequence[Kind], stop: Stop) -> Separations:
    """Return how far each effect that ``before`` lacks stands from everything else in the catalogue."""
    out = {}
    for name in best.names:
        if stop():
            raise Cancelled
        if name not in before.names:
            out[name] = separation(best, at, name, catalogue)
    return out


def challenged(
    before: Fitted,
    best: Fitted,
    at: Projector,
    catalogue: Sequence[Kind],
    trail: Trail,
    foretells: Callable[[Fitted], bool],
    stop: Stop,
) -> tuple[Fitted, Projector, Separations]:
    """Fit every effect's nearest look-alikes in its place, and return what is best then, with its separations.

    One that takes the place must foretell the held-out shots, as the effect did.
    """
    far = apart(before, best, at, catalogue, stop)
    kept = best
    for name, distances in far.items():
        for kind in _nearest(distances, catalogue):
            if stop():
                raise Cancelled
            trial = _instead(best, name, kind, distances, stop)
            if trial is None:
                continue
            trail.keep(trial)
            if trial.bic < kept.bic - _BETTER:
                kept = trial
    if kept is best or not foretells(kept):
        return best, at, far
    kept = fit(kept.hypothesis, kept.z, kept.floor, evaluations=60, cancelled=stop)
    trail.keep(kept)
    at = projector(kept)
    return kept, at, apart(before, kept, at, catalogue, stop)


def unmissed(
    best: Fitted, at: Projector, rest: Remainder, trail: Trail, foretells: Callable[[Fitted], bool], stop: Stop
) -> tuple[Fitted, Projector, Remainder]:
    """Return another fit, nearly as likely and with as many effects, that misses nothing where the best does."""
    near = [
        other
        for key, other in trail.fits.items()
        if len(key) == len(best.names)
        and len(set(key) - set(best.names)) == 1
        and other.converged
        and other.bic < best.bic + _NEARLY
    ]
    for other in sorted(near, key=lambda fitted: fitted.bic)[:_FITTED]:
        if stop():
            raise Cancelled
        there = projector(other)
        left = judge(other, there)
        if not left.significant and foretells(other):
            return other, there, left
    return best, at, rest


def _nearest(distances: Separation, catalogue: Sequence[Kind]) -> list[Kind]:
    """Return the effects that do most of what one does, but not all to first order, nearest first."""
    near = sorted(
        (distance, name)
        for name, distance in distances.from_other.items()
        if LEAST_SEPARATION <= distance < _ALIKE * distances.snr
    )
    return [kind for _, name in near[:_FITTED] for kind in catalogue if kind.name == name]


def _instead(best: Fitted, name: str, kind: Kind, distances: Separation, stop: Stop) -> Fitted | None:
    """Return the fit with ``kind`` in place of an effect; None where there is no trajectory."""
    here = best.hypothesis
    start = distances.starts[kind.name]
    hypothesis = Hypothesis(
        here.rig,
        tuple(kind if effect.name == name else effect for effect in here.effects),
        {**{k: v for k, v in here.fixed.items() if k != name}, kind.name: fixed_of(kind, start[0])},
    )
    point = best.point
    values = tuple(
        {**{k: v for k, v in old.items() if k != name}, kind.name: dict(new)}
        for old, new in zip(point.values, start, strict=True)
    )
    low, high = hypothesis.bounds
    try:
        z = np.clip(hypothesis.pack(Point(point.base, point.own, values)), low, high)
        trial = finish(hypothesis, search(hypothesis, z, best.floor, evaluations=10, exact=False, cancelled=stop))
        if trial.bic < best.bic + WORTH_FINISHING:
            trial = fit(hypothesis, trial.z, trial.floor, evaluations=16, exact=False, cancelled=stop)
    except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
        return None
    return trial

"""Where a search begins: the base model's fit at the diagnosis' rate, with the effects that the model already has."""

from collections.abc import Sequence

import numpy as np

from analysis.diagnosis.fits.effective_parameters import Point
from analysis.diagnosis.fits.free_parameters import TrialEffect, trials_named
from analysis.diagnosis.fits.hypothesis import Hypothesis, JointData
from analysis.diagnosis.fits.hypothesis_fit import Fitted, finish, first_floor, fit, search
from analysis.diagnosis.fits.quick_shot import too_fast
from analysis.diagnosis.noise.joint_data import parameters_of
from analysis.diagnosis.search.forward_selection import Trail, better, climb, explore
from analysis.diagnosis.search.wider import narrower
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.fit import Fit
from analysis.model.base_minimum import first_guesses
from analysis.model.least_squares import Infeasible
from analysis.model.prepare import prepare_set
from analysis.model.response import Model
from analysis.model.search import own_start
from analysis.motion import Motion
from analysis.shot import AnalysisError, Stop

_SOFTENED = ((1.0, 1.0), (0.01, 0.1))  # of the stiffness and damping of the contact that was read
_SOFTER = 8  # times a tenth of the contact stiffness, at most


def base_fit(data: JointData, given: Fit, stop: Stop, taken_along: Sequence[str] = ()) -> Fitted:
    """Return the base model's best fit at the diagnosis' rate, from one that is given.

    ``taken_along`` are the effects that each shot has for itself and that are no finding.
    """
    along = trials_named(taken_along)
    values = tuple({kind.name: kind.starts[0] for kind in along} for _ in data.shots)
    point = Point(*parameters_of(given, data.base), values)
    hypothesis = Hypothesis(data, along)
    point = _slow_enough(hypothesis, point)
    quick = np.concatenate([np.diff(s.displacement_m, 3)[s.valid[3:] & s.valid[:-3]] for s in data.shots])
    if quick.size < 100:
        raise AnalysisError("too few samples for a diagnosis")
    white = max(1.4826 * float(np.median(np.abs(quick))) / np.sqrt(20.0), 1e-15)
    z = hypothesis.pack(point)
    try:
        return fit(hypothesis, z, first_floor(hypothesis, z, white), anew=True, cancelled=stop)
    except Infeasible as why:
        raise AnalysisError(f"no motion of the base model comes near these shots: {why}") from why


def pays_along(best: Fitted, taken_along: Sequence[str], stop: Stop) -> bool:
    """Return whether what each shot has for itself explains more than it costs, beside the effects of a fit."""
    hypothesis, point = best.hypothesis, best.point
    kinds = tuple(kind for kind in hypothesis.effects if kind.name not in taken_along)
    bare = Hypothesis(hypothesis.data, kinds, hypothesis.fixed)
    values = tuple({name: v for name, v in of.items() if name not in taken_along} for of in point.values)
    try:
        return best.bic < fit(bare, bare.pack(Point(point.base, point.own, values)), best.floor, cancelled=stop).bic
    except Infeasible:
        return True


def _slow_enough(hypothesis: Hypothesis, point: Point) -> Point:
    """Return the point with a contact that samples can follow: one drawn to a wall is no place to begin."""
    shot = hypothesis.data.shots[0]
    for _ in range(_SOFTER):
        here = hypothesis.shot_at(0, point)
        if not too_fast(here.base, here.own, here.values, shot.moving_mass_kg, shot.spacing_s, shot.factor):
            break
        softer = point.base.copy()
        softer[hypothesis.data.base.contact_at] *= [0.1, 0.3]
        point = Point(softer, point.own, point.values)
    return point


def accept(base: Fitted, catalogue: Sequence[TrialEffect], accepted: Sequence[str], stop: Stop) -> Fitted:
    """Return the fit with the effects that the model already has."""
    here = base
    for name in accepted:
        if name not in {kind.name for kind in catalogue}:
            raise ValueError(f"no effect is called {name!r}; there are {', '.join(k.name for k in catalogue)}")
    held = narrower(accepted)
    for name in (name for name in accepted if name not in held):
        kind = next(k for k in catalogue if k.name == name)
        better, _ = explore(here, [kind], stop, most=1, widens=False)
        if name not in better.names:
            hypothesis = Hypothesis(here.hypothesis.data, (*here.hypothesis.effects, kind), here.hypothesis.fixed)
            values = tuple({**v, name: dict(kind.starts[0])} for v in here.point.values)
            z = hypothesis.pack(Point(here.point.base, here.point.own, values))
            better = finish(hypothesis, search(hypothesis, z, here.floor, cancelled=stop), here.floor)
        here = better
    return here


def explored(
    before: Fitted,
    given: Fit,
    motions: Sequence[Motion],
    catalogue: Sequence[TrialEffect],
    stop: Stop,
    *,
    most: int = CRITERIA.most_effects,
) -> tuple[Fitted, Trail]:
    """Return the best fit with ``most`` effects, and what was tried from where; ``given`` is the base fit."""
    if not before.converged and given.reduced_chi2 > CRITERIA.drawn_far:
        return _from_the_guess(before, motions, catalogue, stop)
    best, trail = explore(before, catalogue, stop, most=most)
    again = trail.of(before.names)
    if again is not None and better(again, before):  # an effect's detour led the base itself to a better place
        return explore(again, catalogue, stop, most=most)
    return best, trail


def _from_the_guess(
    before: Fitted, motions: Sequence[Motion], catalogue: Sequence[TrialEffect], stop: Stop
) -> tuple[Fitted, Trail]:
    """Return the best fit with effects, begun where the collision was read, not where the base was drawn.

    What a base model lacks a thousandfold draws its own parameters to a wall: no step from there leads back.  It may
    have drawn the contact that was read too, so a softer one is a second place to begin.
    """
    hypothesis = before.hypothesis
    shots = prepare_set(motions)
    guess = first_guesses(hypothesis.data.base, shots, stop)[0]
    own = np.array([own_start(shot, Model(hypothesis.data.base)) for shot in shots])
    climbs = []
    for softer in _SOFTENED:
        contact = guess.copy()
        contact[hypothesis.data.base.contact_at] *= softer
        point = _slow_enough(hypothesis, Point(contact, own, before.point.values))
        try:
            found = search(hypothesis, hypothesis.pack(point), before.floor, evaluations=1, cancelled=stop)
            there = finish(hypothesis, found, before.floor)
        except Infeasible:
            continue
        trail = Trail(before, catalogue, stop)
        best = climb(there, trail)
        if best is not there and best.bic < before.bic:
            climbs.append((best, trail))
    return min(climbs, key=lambda climbed: climbed[0].bic) if climbs else explore(before, catalogue, stop)

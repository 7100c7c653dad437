"""The models that a diagnosis could not tell apart, each fitted to the shots at hand."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from analysis.collision.effects import named
from analysis.collision.parameters import Infeasible
from analysis.diagnosis.search.competing_models import fitted_instead
from analysis.diagnosis.search.forward_selection import Trail, without
from analysis.diagnosis.verdict.coincidence import unforetold
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.identifiability import separation
from analysis.inference.fit.base_fit import white_of
from analysis.inference.fit.begin import begin_of
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.free_parameters import trials_named
from analysis.inference.fit.hypothesis import Hypothesis
from analysis.inference.fit.hypothesis_fit import Fitted, finish, first_floor, fit, search
from analysis.inference.fit.samples import FINE_RATE_HZ, RATE_HZ
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.joint_data import joint_data, shakings_of, site_under
from analysis.inference.screen.columns import fixed_of
from analysis.inference.screen.projector import projector
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisError, Stop

_ARRIVED = 1e-2
_UNLIKELY = 9.0  # of chi^2 behind the best: three sigma, and a member need no longer be reckoned with as the true one


@dataclass(frozen=True, slots=True)
class Member:
    """One of the models that compete: the effect in which it differs from the others, its fit, what it leaves over."""

    effect: str
    fitted: Fitted
    chi2: float  # under the floor that all are compared under
    coincidence: float = 0.0  # what it costs beside that, as chi^2, that nothing foretells its numbers in every shot

    @property
    def misfit(self) -> float:
        """Get what members are compared by: chi^2, and the cost of numbers that nothing foretells."""
        return self.chi2 + self.coincidence


@dataclass(frozen=True, slots=True)
class Contest:
    """Models that the shots at hand do not tell apart, the likeliest first."""

    members: tuple[Member, ...]
    floor: Floor
    foretold_nats: float = inf  # what numbers cost that all shots share: those of every shot are charged what is more

    def charges(self, effect: str) -> bool:
        """Return whether an effect pays for numbers that nothing foretells: all a shot's own, where others' are not."""
        return named(effect).own and isfinite(self.foretold_nats)

    @property
    def likely(self) -> tuple[Member, ...]:
        """Get the members that may well be the true one."""
        return tuple(m for m in self.members if m.misfit < self.members[0].misfit + _UNLIKELY)

    @property
    def reached(self) -> float:
        """Get how far the likeliest member stands from the next, in noise norms: the root of what that leaves more."""
        return self.reached_from(())

    def reached_from(self, one_with: Collection[str]) -> float:
        """Get the same from the next that is not among those that are one with the likeliest; 0 where there is none."""
        best, *others = self.members
        left = [other.misfit - best.misfit for other in others if other.effect not in one_with]
        return float(np.sqrt(max(0.0, min(left, default=0.0))))


def contest(given: Fit, among: Sequence[str], motions: Sequence[Motion], stop: Stop = lambda: False) -> Contest | None:
    """Return the models in which each of the effects ``among`` stands for the one of them that is in ``given``.

    ``given`` is a joint fit of ``motions``.  None where none of them is in it, or no other has a motion for these
    shots.  Raises AnalysisError where the fit is not one of these shots, Cancelled.
    """
    name = next((name for name in among if name in given.effects), None)
    if name is None:
        return None
    others = [other for other in among if other != name]
    best = again(given, motions, stop, others)
    members = [Member(name, best, best.chi2(best.floor)), *rivals(best, name, others, stop)]
    if len(members) < 2:
        return None
    nats = _foretold_nats(members)
    members = [replace(member, coincidence=coincidence(member.effect, member.fitted, nats)) for member in members]
    return Contest(tuple(sorted(members, key=lambda member: member.misfit)), best.floor, nats)


def coincidence(effect: str, fitted: Fitted, foretold_nats: float) -> float:
    """Return what it costs, as chi^2, that nothing foretells the numbers of an effect that are all a shot's own."""
    if not named(effect).own:
        return 0.0
    theirs = unforetold(fitted, effect)
    return 0.0 if theirs is None else 2 * max(0.0, theirs.nats - foretold_nats)


def _foretold_nats(members: Sequence[Member]) -> float:
    """Return what the numbers cost of the best member whose numbers all shots share; no end of it where there is none.

    Only members that have numbers in every shot are charged for the difference: among the others the one with fewer
    parameters is not the true one for that alone.
    """
    shared = [member for member in members if not named(member.effect).own]
    best = min(shared, key=lambda member: member.chi2, default=None)
    if best is None or len(shared) == len(members):
        return inf
    ours = unforetold(best.fitted, best.effect)
    return inf if ours is None else ours.nats


def rivals(best: Fitted, name: str, others: Sequence[str], stop: Stop, tolerance: float = _ARRIVED) -> list[Member]:
    """Return the fits in which each of ``others`` takes the place of the effect ``name``, from where it imitates it.

    Compared under the floor of ``best``: their own may take for noise what they cannot do.  ``tolerance`` is what of
    chi^2 may still be to fall.
    """
    kinds = trials_named(others)
    far = separation(best, projector(best), name, kinds, stop)
    fewer = without(best, name, Trail(best, kinds, stop))
    frequency = best.point.values[0][name].get("frequency_hz")
    out = []
    for kind in kinds:
        if fewer is None or kind.name not in far.starts:
            continue
        rival = fitted_instead(best, projector(fewer), far, frequency, stop, kind)
        if rival is not None:
            ended = search(rival.hypothesis, rival.z, best.floor, evaluations=40, tolerance=tolerance, cancelled=stop)
            rival = finish(rival.hypothesis, ended, best.floor)
            out.append(Member(kind.name, rival, rival.chi2(best.floor)))
    return out


def again(given: Fit, motions: Sequence[Motion], stop: Stop, beside: Sequence[str] = ()) -> Fitted:
    """Return the fit that a diagnosis ended with as it was searched, fine enough for the effects ``beside`` it."""
    kinds = trials_named(given.effects)
    finely = any(named(name).ripples for name in (*given.effects, *beside))
    site = site_under(motions, shakings_of(motions, given.model, None), CRITERIA.site_nm)
    begin = begin_of(given, motions)
    data = joint_data(motions, begin, site, FINE_RATE_HZ if finely else RATE_HZ)
    values = tuple({kind.name: _values(given, kind.name, shot) for kind in kinds} for shot in range(len(motions)))
    fixed = {kind.name: fixed_of(kind, values[0][kind.name]) for kind in kinds}
    hypothesis = Hypothesis(data, kinds, fixed)
    z = hypothesis.pack(Point(begin.shared, begin.own, values))
    try:
        return fit(hypothesis, z, first_floor(hypothesis, z, white_of(data.shots)), cancelled=stop)
    except Infeasible as why:
        raise AnalysisError(f"the diagnosed model has no motion for these shots: {why}") from why


def _values(given: Fit, name: str, shot: int) -> Mapping[str, float]:
    every = {**given.parameters, **given.shots[shot].own_parameters}
    return {p.name: every[f"{name}.{p.name}"].value for p in named(name).parameters}

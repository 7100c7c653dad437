"""Compare the models that a diagnosis could not distinguish, each fitted to the same shots."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.diagnosis import CRITERIA, Trail, fitted_instead, per_shot_cost, separation, without
from analysis.inference import (
    FINE_RATE_HZ,
    RATE_HZ,
    Fitted,
    Floor,
    Point,
    Problem,
    averaged_shots,
    frame_motions_of,
    joint_data,
    site_under,
    start_from_fit,
    trials_of,
)
from analysis.shot import AnalysisError, Fit, Motion, Stop

_ARRIVED = 1e-2
_UNLIKELY = 9.0  # of chi^2 above the best: three sigma, beyond which a member is not considered as the true model


@dataclass(frozen=True, slots=True)
class ComparedModel:
    """One of the compared models: the effect in which it differs from the others, and its fit."""

    effect: Effect
    fitted: Fitted
    chi2: float  # under the noise by which all members are compared
    penalty: float = 0.0  # in addition, as chi^2: for parameters that are fitted per shot

    @property
    def misfit(self) -> float:
        """Get chi^2 with the penalty, by which members are compared."""
        return self.chi2 + self.penalty


@dataclass(frozen=True, slots=True)
class ModelComparison:
    """Models that the present shots do not distinguish, the likeliest first; ``floor`` is the noise of all of them.

    ``shared_nats`` is the cost, in ln L, of the parameters of the best member whose parameters all shots share.
    Members with per-shot parameters are charged the excess of their own cost.
    """

    members: tuple[ComparedModel, ...]
    floor: Floor
    shared_nats: float = inf

    def has_penalty(self, effect: Effect) -> bool:
        """Return whether an effect is charged for per-shot parameters because other members share theirs."""
        return effect.own and isfinite(self.shared_nats)

    @property
    def likely(self) -> tuple[ComparedModel, ...]:
        return tuple(m for m in self.members if m.misfit < self.members[0].misfit + _UNLIKELY)

    def separation_from(self, excluded: Collection[Effect]) -> float:
        """Return the likeliest member's separation in noise norms from the next one that is not among ``excluded``.

        That is the root of the difference of their misfits; 0 where there is no other.
        """
        best, *others = self.members
        left = [other.misfit - best.misfit for other in others if other.effect not in excluded]
        return float(np.sqrt(max(0.0, min(left, default=0.0))))


def compare_models(
    given: Fit, among: Sequence[Effect], motions: Sequence[Motion], stop: Stop = lambda: False
) -> ModelComparison | None:
    """Compare ``given``, a joint fit of ``motions``, with fits in which other effects ``among`` replace the one in it.

    None where none of these effects is in ``given``, or no other has a solution for these shots.  Raises AnalysisError
    where ``given`` is not a fit of these shots, Cancelled.
    """
    effect = next((effect for effect in among if effect in given.effects), None)
    if effect is None:
        return None
    others = [other for other in among if other != effect]
    best = refit_diagnosed(given, motions, stop, others)
    members = [ComparedModel(effect, best, best.chi2(best.noise)), *rivals(best, effect, others, stop)]
    if len(members) < 2:
        return None
    nats = _shared_nats(members)
    members = [replace(member, penalty=penalty(member.effect, member.fitted, nats)) for member in members]
    return ModelComparison(tuple(sorted(members, key=lambda member: member.misfit)), best.noise, nats)


def penalty(effect: Effect, fitted: Fitted, shared_nats: float) -> float:
    """Return the penalty, as chi^2, of an effect whose parameters are fitted per shot; 0 for other effects."""
    if not effect.own:
        return 0.0
    theirs = per_shot_cost(fitted, effect)
    return 0.0 if theirs is None else 2 * max(0.0, theirs.nats - shared_nats)


def _shared_nats(members: Sequence[ComparedModel]) -> float:
    """Return the cost (nats) of the best member with shared parameters; infinite where all members are of one kind.

    Only members with per-shot parameters are charged the difference: among others, fewer parameters are no advantage.
    """
    shared = [member for member in members if not member.effect.own]
    best = min(shared, key=lambda member: member.chi2, default=None)
    if best is None or len(shared) == len(members):
        return inf
    ours = per_shot_cost(best.fitted, best.effect)
    return inf if ours is None else ours.nats


def rivals(
    best: Fitted, effect: Effect, others: Sequence[Effect], stop: Stop, tolerance: float = _ARRIVED
) -> list[ComparedModel]:
    """Return the fits in which each of ``others`` replaces the ``effect``, started where it imitates the effect best.

    All are compared under the noise of ``best``: their own noise might absorb what they cannot describe.  ``tolerance``
    is the decrease of chi^2 at which a search may end.
    """
    kinds = trials_of(others)
    far = separation(best, best.linearise(), effect, kinds, stop)
    fewer = without(best, effect, Trail(best, kinds, stop))
    frequency = best.point.values[0][effect].get("frequency_hz")
    out = []
    for kind in kinds:
        if fewer is None or kind.effect not in far.starts:
            continue
        rival = fitted_instead(best, fewer.linearise(), far, frequency, stop, kind)
        if rival is not None:
            problem = rival.problem.with_noise(best.noise)
            rival = problem.fit_once(rival.z, evaluations=40, tolerance=tolerance, cancelled=stop)
            out.append(ComparedModel(kind.effect, rival, rival.chi2(best.noise)))
    return out


def refit_diagnosed(given: Fit, motions: Sequence[Motion], stop: Stop, others: Sequence[Effect] = ()) -> Fitted:
    """Return the final fit of a diagnosis, at a sample rate that suits the ``others`` as well."""
    kinds = trials_of(given.effects)
    finely = any(effect.needs_full_rate for effect in (*given.effects, *others))
    site = site_under(motions, frame_motions_of(motions, given.model, None), CRITERIA.site_nm)
    begin = start_from_fit(given, motions)
    data = joint_data(averaged_shots(motions, FINE_RATE_HZ if finely else RATE_HZ), begin, site)
    values = tuple({kind.effect: _values(given, kind.effect, shot) for kind in kinds} for shot in range(len(motions)))
    fixed = {kind.effect: kind.fixed_in(values[0][kind.effect]) for kind in kinds}
    problem = Problem(data, kinds, data.white_noise, fixed=fixed)
    z = problem.pack(Point(begin.shared, begin.own, values))
    try:
        return problem.with_start_noise(z).fit(z, cancelled=stop)
    except Infeasible as why:
        raise AnalysisError(f"the diagnosed model has no motion for these shots: {why}") from why


def _values(given: Fit, effect: Effect, shot: int) -> Mapping[str, float]:
    every = {**given.parameters, **given.shots[shot].own_parameters}
    return {p.name: every[f"{effect.key}.{p.name}"].value for p in effect.parameters}

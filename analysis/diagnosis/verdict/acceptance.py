"""The gates an effect must pass to be named: it pays on held-out shots, stands out, and leaves nothing unlike it.

What stands of the effects that a search found follows: after held-out shots, size, look-alikes and what is left.
"""

from dataclasses import dataclass, replace

from analysis.diagnosis.limit import Limit
from analysis.diagnosis.result import FoundEffect, Verdict
from analysis.diagnosis.search.competing_models import Separations, apart, challenged, unmissed
from analysis.diagnosis.search.forward_selection import Trail, another_way, better, without
from analysis.diagnosis.verdict.conclusion import conclude
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.cross_validation import Prediction, predict
from analysis.diagnosis.verdict.identifiability import missed_without, snr
from analysis.diagnosis.verdict.residual import Residual, judge
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.screen.projector import Projector
from analysis.shot.shot import Progress

Told = tuple[Prediction, Prediction]


def paying(best: Fitted, held: tuple[int, ...], trail: Trail) -> tuple[Fitted, Told | None]:
    """Return the fit without the effects that do not pay on the held-out shot, and what is foretold of it.

    All foretelling is compared under the best fit's floor.
    """
    if not held:
        return best, None
    before, floor = trail.start, best.floor
    first = predict(before, held, floor, trail.stop)
    while best is not before:
        told = predict(best, held, floor, trail.stop)
        if first is None or told is None:
            return best, None
        added = trail.added(best)
        if len(added) == 1:
            break
        shorter = [(f, predict(f, held, floor, trail.stop)) for f in (without(best, n, trail) for n in added) if f]
        worse = [(f.bic, f) for f, t in shorter if t is not None and not told.beats(t)]
        if not worse:
            break
        best = min(worse, key=lambda pair: pair[0])[1]
    else:
        return before, (first, first) if first is not None else None
    return (best, (first, told)) if told.earns_a_name(first) else (before, (first, first))


def without_the_faint(best: Fitted, trail: Trail) -> tuple[Fitted, Projector]:
    """Return the fit, with its projector, without the effects that do not stand out, the faintest taken out first."""
    at = trail.projector_of(best)
    while added := trail.added(best):
        fewer = {name: without(best, name, trail) for name in added}
        sizes = {name: min(snr(best, at, name), missed_without(best, fewer[name])) for name in added}
        faintest = min(added, key=sizes.__getitem__)
        if sizes[faintest] >= CRITERIA.size_of_one(len(added)):
            pay = {name: one.bic - best.bic for name, one in fewer.items() if one is not None}
            faintest = min(pay, key=pay.__getitem__, default="")
            if len(added) == 1 or not faintest or pay[faintest] >= CRITERIA.several_fall:
                break
        best = (fewer[faintest] if len(added) > 1 else None) or trail.start
        at = trail.projector_of(best)
    if best is not trail.start and not trail.pays(best, trail.start):
        best, at = trail.start, trail.projector_of(trail.start)
    return best, at


def accepted_effects(effects: list[FoundEffect], rest: Residual, best: Fitted) -> tuple[list[FoundEffect], Verdict]:
    """Return the effects that may be named, and the verdict."""
    if effects and not _pass(effects, rest, best):
        return [], conclude(explained=False, effects=())
    return effects, conclude(explained=not rest.significant, effects=effects)


def _pass(effects: list[FoundEffect], rest: Residual, best: Fitted) -> bool:
    """Return whether all effects of a fit pass the gates that depend on its residual."""
    if not best.converged or rest.rough:
        return False
    if not rest.significant:
        # Beside a floor that still wanders chance gives any freedom much: an effect must do more than the next one.
        free = rest.misfit.size if best.floor.wanders else 0.0
        return all(effect.evidence["snr"] > CRITERIA.clear_of_rest * free for effect in effects)
    # Several together imitate what none of them is, and a misfit says that the law is another one.
    doubtful = len(effects) > 1 or rest.misfitting
    times = CRITERIA.clear_of_misfit if doubtful else CRITERIA.clear_of_rest
    return all(clear(effect, rest, times) for effect in effects)


def clear(effect: FoundEffect, rest: Residual, times: float) -> bool:
    """Return whether an effect is ``times`` as large as what stays unexplained, and not merely one of many."""
    few = len(effect.indistinguishable_from) <= CRITERIA.undetermined
    return few and effect.evidence["snr"] > times * rest.missed


@dataclass(frozen=True, slots=True)
class Settled:
    """The fit that stands, its projector, its effects' separations, what it leaves over, what is foretold with it.

    ``passed`` is the fit of which the held-out shots were foretold.
    """

    best: Fitted
    at: Projector
    far: Separations
    rest: Residual
    told: Told | None
    passed: Fitted

    @classmethod
    def nothing(cls, start: Fitted, at: Projector) -> "Settled":
        """Return that nothing stands beside the fit that a search began with."""
        return cls(start, at, {}, judge(start, at), None, start)


def settle(
    best: Fitted, trail: Trail, held: tuple[int, ...], tell: Progress, limit: Limit, judged: Residual | None = None
) -> Settled:
    """Return what stands of ``best``, or of what another way leads to where that leaves something unexplained.

    ``judged`` is what ``best`` leaves over, where that is known.
    """
    stands = _settled(best, trail, held, tell, judged)
    if not stands.rest.significant:
        return stands
    tell("looking for another way", 0.75)
    timed = replace(trail, stop=limit)
    other = limit.within("the search from other first effects", lambda: another_way(stands.best, timed), stands.best)
    if not better(other, stands.best):
        return stands
    again = _settled(other, trail, held, lambda _what, _fraction: None)
    calmer = not again.rest.significant and again.best is not trail.start
    return again if calmer or better(again.best, stands.best) else stands


def _settled(
    best: Fitted, trail: Trail, held: tuple[int, ...], tell: Progress, judged: Residual | None = None
) -> Settled:
    tell("foretelling a held-out shot", 0.55)
    given = best
    passed, told = paying(best, held, trail)

    def foretells(other: Fitted) -> bool:
        if told is None:
            return True
        of_other = predict(other, held, passed.floor, trail.stop)
        return of_other is not None and of_other.earns_a_name(told[0])

    tell("testing what is left", 0.7)
    best, at = without_the_faint(passed, trail)
    best, at, far = challenged(best, at, trail, foretells)
    rest = judged if judged is not None and best is given else judge(best, at)
    if rest.significant and best is not trail.start:
        clean, there, left = unmissed(best, at, rest, trail, foretells)
        if clean is not best:
            return Settled(clean, there, apart(clean, there, trail), left, told, passed)
    return Settled(best, at, far, rest, told, passed)

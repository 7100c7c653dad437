"""The gates that an effect must pass to be named: it predicts validation shots, stands out, and leaves no misfit.

``settle`` applies the gates that may remove an effect from the fit that a search found; ``accepted_effects`` decides
which of the remaining effects are named; ``conclude`` decides the verdict, also on laws and of drives.
"""

from collections.abc import Collection
from dataclasses import dataclass

from analysis.compiled import side_by_side
from analysis.diagnosis.evidence.cross_validation import Predictions, predict
from analysis.diagnosis.evidence.identifiability import missed_without, snr
from analysis.diagnosis.evidence.residual import Residual, residual_of
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import FoundEffect, LearnedLaw, Verdict
from analysis.diagnosis.search.competing_models import (
    Separations,
    alternative_without_misfit,
    separations_of,
    with_look_alikes_tried,
)
from analysis.diagnosis.search.forward_selection import (
    RESTARTS,
    RESTARTS_IN_WANDERING_NOISE,
    Trail,
    better,
    restart_from_other_effects,
    without,
)
from analysis.inference import Fitted, Linearised
from analysis.shot import Progress


def without_unpredictive_effects(
    best: Fitted, held_out: tuple[int, ...], trail: Trail
) -> tuple[Fitted, Predictions | None]:
    """Remove effects that do not help to predict the validation shots; return the fit and its predictions.

    All predictions are compared under the noise of the best fit.
    """
    if not held_out:
        return best, None
    before, floor = trail.start, best.noise
    first = predict(before, held_out, floor, trail.stop)
    while best is not before:
        prediction = predict(best, held_out, floor, trail.stop)
        if first is None or prediction is None:
            return best, None
        added = trail.added(best)
        if len(added) == 1:
            break
        fewer = [one for effect in added if (one := without(best, effect, trail)) is not None]
        shorter = side_by_side(lambda one: (one, predict(one, held_out, floor, trail.stop)), fewer)
        no_worse = [
            (one.bic, one) for one, of_it in shorter if of_it is not None and not prediction.predicts_better(of_it)
        ]
        if not no_worse:
            break
        best = min(no_worse, key=lambda pair: pair[0])[1]
    else:
        return before, (first, first) if first is not None else None
    return (best, (first, prediction)) if prediction.predicts_significantly_better(first) else (before, (first, first))


def without_faint_effects(best: Fitted, trail: Trail) -> tuple[Fitted, Linearised]:
    """Remove effects that do not stand out, the faintest first; return the fit and its linearisation."""
    linearised = trail.linearised(best)
    while added := trail.added(best):
        fewer = {effect: without(best, effect, trail) for effect in added}
        sizes = {one: min(snr(best, linearised, one), missed_without(best, fewer[one])) for one in added}
        faintest = min(added, key=sizes.__getitem__)
        if sizes[faintest] >= CRITERIA.size_of_one(len(added)):
            pays = {effect: one.bic - best.bic for effect, one in fewer.items() if one is not None}
            if len(added) == 1 or not pays:
                break
            faintest = min(pays, key=pays.__getitem__)
            if pays[faintest] >= CRITERIA.several_fall:
                break
        best = (fewer[faintest] if len(added) > 1 else None) or trail.start
        linearised = trail.linearised(best)
    if best is not trail.start and not trail.pays(best, trail.start):
        best, linearised = trail.start, trail.linearised(trail.start)
    return best, linearised


def accepted_effects(
    effects: list[FoundEffect], residual: Residual, best: Fitted, *, nothing_pays: bool = False
) -> tuple[list[FoundEffect], Verdict]:
    """Return the effects of the fit ``best`` that may be named, all of them or none, and the verdict."""
    if effects and not _pass(effects, residual, best):
        return [], conclude(explained=False, effects=())
    return effects, conclude(
        explained=not residual.leaves_something(nothing_pays=nothing_pays and not effects), effects=effects
    )


def _pass(effects: list[FoundEffect], residual: Residual, best: Fitted) -> bool:
    """Return whether all effects of a fit pass the gates that depend on its residual."""
    if not best.converged or residual.rough:
        return False
    if not residual.significant:
        # Under wandering noise any freedom gains much by chance: an effect must gain more than the best freedom.
        # This does not apply to frame motion, whose strengths have a prior.
        by_chance = residual.misfit.size if best.noise.wander else 0.0
        return all(effect.evidence["snr"] > CRITERIA.clear_of_rest * by_chance for effect in effects)
    # Several effects may jointly imitate one that is none of them, and a misfit shows that the law is another one.
    doubtful = len(effects) > 1 or residual.misfit.significant
    times = CRITERIA.clear_of_misfit if doubtful else CRITERIA.clear_of_rest
    return all(exceeds_residual(effect, residual, times) for effect in effects)


def exceeds_residual(effect: FoundEffect, residual: Residual, times: float) -> bool:
    """Return whether an effect is ``times`` as large as the residual, with few enough look-alikes to form a class."""
    few = len(effect.indistinguishable_from) <= CRITERIA.undetermined
    return few and effect.evidence["snr"] > times * residual.unexplained_norms


@dataclass(frozen=True, slots=True)
class GatedFit:
    """A fit whose effects passed the gates so far, its linearisation, separations from look-alikes, and residual.

    ``predictions`` of the validation shots are by the model before and by the fit ``predicted``.
    """

    best: Fitted
    linearised: Linearised
    separations: Separations
    residual: Residual
    predictions: Predictions | None
    predicted: Fitted


def settle(
    best: Fitted,
    trail: Trail,
    held_out: tuple[int, ...],
    progress: Progress,
    residual: Residual | None = None,
) -> GatedFit:
    """Pass ``best`` through the gates; where that leaves a residual, restart from other first effects.

    Restart also where the noise wanders in contact but not in flight: that wander may be a further effect.  The better
    of both fits is returned.  ``residual`` is that of ``best``, where it is known.
    """
    settled = _through_gates(best, trail, held_out, progress, residual)
    wanders = settled.best.wanders_only_in_contact
    if not settled.residual.significant and not wanders:
        return settled
    firsts = RESTARTS_IN_WANDERING_NOISE if wanders else RESTARTS
    progress("searching from other first effects", 0.75)
    what = "the search from other first effects"
    other = trail.within(what, lambda: restart_from_other_effects(settled.best, trail, firsts), settled.best)
    if not better(other, settled.best):
        return settled
    again = _through_gates(other, trail, held_out, lambda _what, _fraction: None)
    calmer = not again.residual.significant and again.best is not trail.start
    return again if calmer or better(again.best, settled.best) else settled


def _through_gates(
    best: Fitted, trail: Trail, held_out: tuple[int, ...], progress: Progress, known: Residual | None = None
) -> GatedFit:
    progress("predicting a held-out shot", 0.55)
    given = best
    predicted, predictions = without_unpredictive_effects(best, held_out, trail)

    def predicts(other: Fitted) -> bool:
        if predictions is None:
            return True
        prediction = predict(other, held_out, predicted.noise, trail.stop)
        return prediction is not None and prediction.predicts_significantly_better(predictions[0])

    progress("testing the residual", 0.7)
    best, linearised = without_faint_effects(predicted, trail)
    best, linearised, separations = with_look_alikes_tried(best, linearised, trail, predicts)
    if not best.converged and (further := best.continued(trail.stop)).converged:  # two effects share a curved valley
        best, linearised = further, trail.linearised(further)
        separations = separations_of(best, linearised, trail)
    residual = known if known is not None and best is given else residual_of(best, linearised)
    if residual.significant and best is not trail.start:
        other, of_other, left = alternative_without_misfit(best, linearised, residual, trail, predicts)
        if other is not best:
            return GatedFit(other, of_other, separations_of(other, of_other, trail), left, predictions, predicted)
    return GatedFit(best, linearised, separations, residual, predictions, predicted)


def conclude(
    *,
    explained: bool,
    effects: Collection[FoundEffect],
    laws: Collection[LearnedLaw] = (),
    predicts_better: bool = False,
) -> Verdict:
    """Return the verdict on a model with these ``effects`` and ``laws``, all of which passed their gates.

    ``explained``: the residual of the model with them is consistent with noise (of a drive: with its repeatability).
    ``predicts_better``: effects that did not pass every gate predict the validation shots better than the model alone.
    """
    if explained:
        if laws:
            return Verdict.LAW_LEARNED
        return Verdict.EFFECT_FOUND if effects else Verdict.ADEQUATE
    return Verdict.PARTLY_EXPLAINED if effects or laws or predicts_better else Verdict.UNEXPLAINED

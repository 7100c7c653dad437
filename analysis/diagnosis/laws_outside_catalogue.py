"""Learn laws where the catalogue leaves a residual: alone, or jointly with effects of the catalogue."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from analysis.collision import Effect
from analysis.diagnosis.evidence.cross_validation import Prediction, Predictions, predict
from analysis.diagnosis.evidence.identifiability import missed_without, snr
from analysis.diagnosis.evidence.residual import residual_of
from analysis.diagnosis.explanation import Explanation, remainder
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import FoundEffect, Verdict
from analysis.diagnosis.learning.law_learning import Discovery, learn_law
from analysis.diagnosis.learning.learned_law import in_joint_fit
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.learning.two_laws import learn_laws, learn_second_law
from analysis.diagnosis.search.forward_selection import without_effect
from analysis.diagnosis.verdict.acceptance import conclude
from analysis.inference import Fitted, Linearised, effect_parameters
from analysis.shot import Quantity, Stop


def explain_with_laws(known: Explanation, law: SingleLaw, *, beat: float = math.inf) -> Explanation:
    """Learn laws where ``known`` leaves a residual; their BIC must be below ``beat``.

    ``law`` is the single law that may replace all effects.
    """
    if known.explained:
        return known
    beyond = (laws_given_effects if known.effects else beyond_catalogue)(known, law, beat)
    if beyond is not None:
        return beyond
    if not known.effects and known.predictions is not None and known.nearest is not known.before:
        return replace(known, predictions=(known.predictions[0], known.predictions[0]))
    return known


def beyond_catalogue(known: Explanation, alone: SingleLaw, beat: float) -> Explanation | None:
    """Return the likeliest laws or effects that predict the validation shots better, or None where there are none.

    Tried in turn, until one explains all: the law ``alone``, two laws, a law jointly with the effects of the catalogue
    that came nearest.  Two laws jointly with doubtful effects are not tried: so much freedom imitates nearly anything,
    and takes as long as all earlier steps.  ``beat`` is the BIC that laws must come below (``law_learning``).
    """
    found = []
    for one in _in_turn(known, alone, beat):
        if one.verdict is Verdict.LAW_LEARNED:
            return one
        found.append(one)
    return min(found, key=lambda one: one.bic, default=None)


def _in_turn(known: Explanation, alone: SingleLaw, beat: float) -> Iterator[Explanation]:
    nearest, held, tell, limit = known.nearest, alone.held, alone.tell, alone.limit
    helped = _helps(alone.start, nearest, held, alone.stop)
    instead = beat
    if helped is not None:
        rest = residual_of(nearest, nearest.linearise())
        # laws that explain all must be about as likely as effects that leave a residual, and likelier than effects
        # whose residual is within chance, also if the fit of the effects has not converged
        instead = min(beat, nearest.bic + (0.0 if rest.faint else CRITERIA.law_fall))
    if alone.one_or_two_laws_may_beat(instead) and (first := alone.found) is not None:
        if not first.explains:
            another = partial(learn_second_law, first, held, tell, limit, beat=instead)
            first = limit.within("a second law", another, first)
        if first.fitted.bic < instead:
            verdict = conclude(explained=first.explains, effects=(), laws=first.laws)
            yield _explained(known, held, verdict, first)
    if helped is None or not nearest.converged:
        return
    tell("learning a law beside the effects that came nearest", 0.83)
    what = "a law beside the effects that came nearest"
    joined = limit.within(what, lambda: learn_law(nearest, held, tell, limit, beat=beat), None)
    if joined is not None:
        yield _together(known, alone, joined, helped[0])
    verdict = conclude(explained=False, effects=(), predicts_better=True)
    without_law = Discovery(alone.start, (), nearest, rest, helped)
    yield _explained(known, held, verdict, without_law, imitations=known.imitations)


def laws_given_effects(known: Explanation, law: SingleLaw, beat: float) -> Explanation | None:
    """Learn laws jointly with effects that passed every test and left a residual; None where there are none."""
    law.tell("learning a law beside the effects that were found", 0.8)
    what = "a law beside the effects that were found"
    named, held = known.nearest, law.held
    found = law.limit.within(what, lambda: learn_laws(named, held, law.tell, law.limit, beat=beat), None)
    if found is None:
        return None
    return _together(known, law, found, predict(known.before, held, named.noise, law.stop) or found.predictions[0])


def _explained(
    known: Explanation,
    held: tuple[int, ...],
    verdict: Verdict,
    found: Discovery,
    *,
    effects: Sequence[FoundEffect] = (),
    imitations: Sequence[FoundEffect] = (),
) -> Explanation:
    """Return the explanation by the fit and the laws of ``found`` of shots that ``known`` does not explain."""
    return replace(
        known,
        verdict=verdict,
        after=found.fitted,
        effects=tuple(effects),
        laws=found.laws,
        imitations=tuple(imitations),
        remainder=remainder(found.fitted, found.residual),
        held_out=held,
        predictions=found.predictions,
    )


def _together(known: Explanation, law: SingleLaw, found: Discovery, base: Prediction) -> Explanation:
    """Return laws and effects with the parameters of their joint fit, not of the fit before the law was found.

    An effect that only imitated the law no longer pays given the law, and is removed.  Effects that had not passed
    their gates without the law count as passing where no residual remains, and as imitations where one does.
    """
    held, stop = law.held, law.stop
    fitted, kept, fewer = _without_idle(found.fitted, known.effects or known.imitations, stop)
    fitted = fitted.continued(stop)
    told, residual, at = found.predictions[1], found.residual, fitted.linearise()
    if fitted is not found.fitted:
        told, residual = predict(fitted, held, fitted.noise, stop) or told, residual_of(fitted, at)
    explains = found.explains and not residual.significant
    laws = tuple(in_joint_fit(one, fitted, one.form is not None) for one in found.laws)
    parameters = effect_parameters(fitted)
    anew = [_anew(one, parameters[one.effect], fitted, at, fewer[one.effect]) for one in kept]
    named, imitations = (anew, []) if known.effects or explains else ([], anew)
    verdict = conclude(explained=explains, effects=named, laws=laws)
    joined = Discovery(found.start, laws, fitted, residual, (base, told))
    return _explained(known, held, verdict, joined, effects=named, imitations=imitations)


def _without_idle(
    fitted: Fitted, kept: Sequence[FoundEffect], stop: Stop
) -> tuple[Fitted, Sequence[FoundEffect], dict[Effect, Fitted | None]]:
    """Return the fit without effects that do not pay, those that it keeps, and the fits without each of them."""
    while True:
        fewer = {one.effect: without_effect(fitted, one.effect, stop) for one in kept}
        idle = min(fewer, key=lambda one: _worth(fitted, fewer[one]), default=None)
        trial = None if idle is None else fewer[idle]
        if trial is None or _worth(fitted, trial) >= CRITERIA.least_fall:
            return fitted, kept, fewer
        fitted, kept = trial, [one for one in kept if one.effect != idle]


def _worth(fitted: Fitted, fewer: Fitted | None) -> float:
    """Return how much the BIC rises without an effect; infinite where there is no fit without it."""
    return float("inf") if fewer is None else fewer.bic - fitted.bic


def _anew(
    found: FoundEffect, parameters: Mapping[str, Quantity], fitted: Fitted, at: Linearised, fewer: Fitted | None
) -> FoundEffect:
    """Return an effect with its parameters and evidence updated to another fit."""
    evidence = {**found.evidence, "snr": min(snr(fitted, at, found.effect), missed_without(fitted, fewer))}
    if fewer is not None:
        evidence["delta_bic"] = -_worth(fitted, fewer)
    return replace(found, parameters=parameters, evidence=evidence)


def _helps(before: Fitted, nearest: Fitted, held: tuple[int, ...], stop: Stop) -> Predictions | None:
    """Return the predictions without and with the effects that came nearest; None where the effects do not help."""
    if nearest is before or not held:
        return None
    first, told = (predict(fitted, held, nearest.noise, stop) for fitted in (before, nearest))
    return (
        (first, told) if first is not None and told is not None and told.predicts_significantly_better(first) else None
    )

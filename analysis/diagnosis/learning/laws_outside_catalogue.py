"""Learn laws where the catalogue leaves a residual: alone, or jointly with effects of the catalogue."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from analysis.diagnosis.learning.law_learning import Discovery, learn_law
from analysis.diagnosis.learning.learned_law import in_joint_fit
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.learning.two_laws import learn_laws, learn_second_law
from analysis.diagnosis.result import FoundEffect, LearnedLaw, Verdict
from analysis.diagnosis.search.forward_selection import without_effect
from analysis.diagnosis.time_limit import Limit
from analysis.diagnosis.verdict.acceptance import conclude
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.cross_validation import Prediction, predict
from analysis.diagnosis.verdict.identifiability import missed_without, snr
from analysis.diagnosis.verdict.residual import Residual, residual_of
from analysis.inference import Fitted, Linearised, effect_parameters
from analysis.shot import Progress, Quantity, Stop


@dataclass(frozen=True, slots=True)
class LawExplanation:
    """Laws jointly with effects, or effects that only predict better, and the fit that contains them.

    ``imitations`` are effects of that fit which did not pass every gate.  ``predictions`` are of the validation shots,
    by the model before and by this fit.
    """

    fitted: Fitted
    verdict: Verdict
    effects: list[FoundEffect]
    laws: tuple[LearnedLaw, ...]
    predictions: tuple[Prediction, Prediction]
    residual: Residual
    imitations: Sequence[FoundEffect] = ()


def beyond_catalogue(
    alone: SingleLaw, nearest: Fitted, effects: Sequence[FoundEffect], *, beat: float = math.inf
) -> LawExplanation | None:
    """Return the likeliest laws or effects that predict the validation shots better, or None where there are none.

    ``nearest`` is the fit with the ``effects`` of the catalogue that came nearest.  Tried in turn, until one explains
    all: the law ``alone``, two laws, a law jointly with those effects.  Two laws jointly with doubtful effects are not
    tried: so much freedom imitates nearly anything, and takes as long as all earlier steps.  ``beat`` is the BIC that
    laws must come below (``law_learning``).
    """
    found = []
    for one in _in_turn(alone, nearest, effects, beat):
        if one.verdict is Verdict.LAW_LEARNED:
            return one
        found.append(one)
    return min(found, key=lambda one: one.fitted.bic, default=None)


def _in_turn(
    alone: SingleLaw, nearest: Fitted, effects: Sequence[FoundEffect], beat: float
) -> Iterator[LawExplanation]:
    before, held, tell, stop, limit = alone.start, alone.held, alone.tell, alone.stop, alone.limit
    helped = _helps(before, nearest, held, stop)
    instead = beat
    if helped is not None:
        rest = residual_of(nearest, nearest.linearise())
        # laws that explain all must be about as likely as effects that leave a residual, and likelier than effects
        # whose residual is within chance
        instead = min(beat, nearest.bic + (0.0 if rest.faint else CRITERIA.law_fall))
    if alone.one_or_two_laws_may_beat(instead) and (first := alone.found) is not None:
        if not first.explains:
            another = partial(learn_second_law, first, held, tell, limit, beat=instead)
            first = limit.within("a second law", another, first)
        if first.fitted.bic < instead:
            yield _alone(first)
    if helped is None:
        return
    tell("learning a law beside the effects that came nearest", 0.83)
    what = "a law beside the effects that came nearest"
    joined = limit.within(what, lambda: learn_law(nearest, held, tell, limit, beat=beat), None)
    if joined is not None:
        yield _together(joined, effects, helped[0], held, stop, passed=False)
    verdict = conclude(explained=False, effects=(), predicts_better=True)
    yield LawExplanation(nearest, verdict, [], (), helped, rest, tuple(effects))


def learn_laws_given_effects(
    named: Fitted,
    effects: Sequence[FoundEffect],
    before: Fitted,
    held: tuple[int, ...],
    tell: Progress,
    stop: Stop,
    limit: Limit,
    *,
    beat: float = math.inf,
) -> LawExplanation | None:
    """Learn laws jointly with ``effects`` that passed every test and left a residual; None where there are none.

    ``named`` is the fit with those effects, ``before`` that of the base model.
    """
    tell("learning a law beside the effects that were found", 0.8)
    what = "a law beside the effects that were found"
    found = limit.within(what, lambda: learn_laws(named, held, tell, limit, beat=beat), None)
    if found is None:
        return None
    base = predict(before, held, named.noise, stop) or found.predictions[0]
    return _together(found, effects, base, held, stop, passed=True)


def _alone(found: Discovery) -> LawExplanation:
    verdict = conclude(explained=found.explains, effects=(), laws=found.laws)
    return LawExplanation(found.fitted, verdict, [], found.laws, found.predictions, found.residual)


def _together(
    found: Discovery,
    effects: Sequence[FoundEffect],
    base: Prediction,
    held: tuple[int, ...],
    stop: Stop,
    *,
    passed: bool,
) -> LawExplanation:
    """Return laws and effects with the parameters of their joint fit, not of the fit before the law was found.

    An effect that only imitated the law no longer pays given the law, and is removed.  Effects that had not ``passed``
    their gates without the law count as passing where no residual remains, and as imitations where one does.
    """
    fitted, kept = found.fitted, list(effects)
    while True:
        fewer = {one.effect: without_effect(fitted, one.effect, stop) for one in kept}
        idle = min(fewer, key=lambda one: _worth(fitted, fewer[one]), default=None)
        trial = None if idle is None else fewer[idle]
        if trial is None or _worth(fitted, trial) >= CRITERIA.least_fall:
            break
        fitted, kept = trial, [one for one in kept if one.effect != idle]
    fitted = fitted.continued(stop)
    told, rest, at = found.predictions[1], found.residual, fitted.linearise()
    if fitted is not found.fitted:
        told, rest = predict(fitted, held, fitted.noise, stop) or told, residual_of(fitted, at)
    explains = found.explains and not rest.significant
    laws = tuple(in_joint_fit(law, fitted, law.form is not None) for law in found.laws)
    parameters = effect_parameters(fitted)
    anew = [_anew(one, parameters[one.effect], fitted, at, fewer[one.effect]) for one in kept]
    named, imitations = (anew, []) if passed or explains else ([], anew)
    verdict = conclude(explained=explains, effects=named, laws=laws)
    return LawExplanation(fitted, verdict, named, laws, (base, told), rest, imitations)


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


def _helps(before: Fitted, nearest: Fitted, held: tuple[int, ...], stop: Stop) -> tuple[Prediction, Prediction] | None:
    """Return the predictions without and with the effects that came nearest; None where the effects do not help."""
    if nearest is before or not held or not nearest.converged:
        return None
    first, told = (predict(fitted, held, nearest.noise, stop) for fitted in (before, nearest))
    return (
        (first, told) if first is not None and told is not None and told.predicts_significantly_better(first) else None
    )

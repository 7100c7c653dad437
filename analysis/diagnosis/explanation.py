"""Explain the shots: name effects in addition to the base model, and describe the residual."""

from dataclasses import dataclass

from analysis.collision import Effect
from analysis.diagnosis.diagnosis_input import DiagnosisInput
from analysis.diagnosis.evidence.cross_validation import Predictions, predict
from analysis.diagnosis.evidence.identifiability import Separation, missed_without
from analysis.diagnosis.evidence.residual import Residual, remainder_of, residual_of
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import FoundEffect, LearnedLaw, Remainder, Verdict
from analysis.diagnosis.search.competing_models import separations_of
from analysis.diagnosis.search.forward_selection import Trail, without
from analysis.diagnosis.search.scale_maxima import at_other_scales, with_std_over
from analysis.diagnosis.verdict.acceptance import GatedFit, accepted_effects, exceeds_residual
from analysis.diagnosis.verdict.indistinguishable import indistinguishable_effects
from analysis.inference import Fitted, Linearised, effect_parameters, with_profile_std
from analysis.shot import Quantity, Stop


@dataclass(frozen=True, slots=True)
class Explanation:
    """The explanation of the shots under one noise model.

    ``nearest`` is the likeliest fit of the search, ``linearised`` the same fit prepared for scores of further effects.
    ``after`` is the model with the named ``effects`` and ``laws``, each of which passed its gates.  ``imitations`` are
    effects of the nearest fit that did not.  ``held_out`` are the indices of the validation shots.
    """

    verdict: Verdict
    trail: Trail
    nearest: Fitted
    linearised: Linearised
    after: Fitted
    effects: tuple[FoundEffect, ...]
    remainder: Remainder | None
    held_out: tuple[int, ...]
    predictions: Predictions | None
    laws: tuple[LearnedLaw, ...] = ()
    imitations: tuple[FoundEffect, ...] = ()

    @property
    def before(self) -> Fitted:
        """Get the model that was diagnosed."""
        return self.trail.start

    @property
    def explained(self) -> bool:
        """Get whether the residual is consistent with noise."""
        return self.verdict in (Verdict.ADEQUATE, Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED)

    @property
    def bic(self) -> float:
        """Get the BIC of the model after."""
        return self.after.bic


def explain_with_effects(
    question: DiagnosisInput, trail: Trail, settled: GatedFit, held_out: tuple[int, ...]
) -> Explanation:
    """Name the effects of a settled fit that pass every gate, after removing those that its residual puts in doubt."""
    question.progress("distinguishing look-alikes", 0.8)
    best, linearised, separations, residual = settled.best, settled.linearised, settled.separations, settled.residual
    while True:
        sure = with_std_over(best.with_marginal_covariance(), at_other_scales(best, trail))
        sure = with_profile_std(sure, question.stop)
        parameters = effect_parameters(sure)
        found = [_found(best, n, parameters[n], residual, separations[n], trail) for n in trail.added(best)]
        effects, verdict = accepted_effects(found, residual, best, nothing_pays=trail.nothing_pays)
        doubtful = [one.effect for one in found if not exceeds_residual(one, residual, CRITERIA.clear_of_misfit)]
        if effects or not residual.significant or len(doubtful) in (0, len(found)):
            break
        # A small residual puts only those effects in doubt that are not much larger than it.
        fewer = without(best, doubtful[0], trail)
        if fewer is None:
            break
        best, linearised = fewer, trail.linearised(fewer)
        residual, separations = residual_of(best, linearised), separations_of(best, linearised, trail)
    if found and not effects and best.converged and not residual.significant:
        # They gain no more than any freedom does by chance.  Is anything missing without them?
        at = trail.linearised(trail.start)
        bare = residual_of(trail.start, at)
        if not bare.significant:
            best, linearised, residual, found = trail.start, at, bare, []
            effects, verdict = accepted_effects(found, residual, best)
    named = bool(effects) or verdict is Verdict.ADEQUATE
    imitating = () if named else trail.added(best)  # what comes near without having passed every gate
    return Explanation(
        verdict=verdict,
        trail=trail,
        nearest=best,
        linearised=linearised,
        after=sure if effects else trail.start,
        effects=tuple(effects),
        remainder=(remainder_of(trail.start, residual.misfit, imitating) if imitating else remainder(best, residual)),
        held_out=held_out,
        predictions=_predictions_of(best, settled, held_out, question.stop),
        imitations=() if named else tuple(found),
    )


def _predictions_of(best: Fitted, settled: GatedFit, held_out: tuple[int, ...], stop: Stop) -> Predictions | None:
    """Return the predictions before and by ``best``: those of the settled fit, if it is the one that predicted."""
    if best is settled.predicted or settled.predictions is None:
        return settled.predictions
    again = predict(best, held_out, best.noise, stop)
    return None if again is None else (settled.predictions[0], again)


def _found(
    best: Fitted,
    effect: Effect,
    parameters: dict[str, Quantity],
    residual: Residual,
    separation: Separation,
    trail: Trail,
) -> FoundEffect:
    """Return an effect of a fit with its evidence and its indistinguishable look-alikes."""
    trail.raise_if_cancelled()
    fewer = without(best, effect, trail)
    others, lead = indistinguishable_effects(best, effect, residual, separation, trail)
    evidence = {"snr": min(separation.snr, missed_without(best, fewer))}
    if fewer is not None:
        evidence["delta_bic"] = float(best.bic - fewer.bic)
    evidence["least_separation"] = float(min(separation.from_other.values(), default=0.0))
    if lead is not None:
        evidence["lead_over_runner_up"] = lead
    return FoundEffect(effect, parameters, evidence, others)


def remainder(fitted: Fitted, residual: Residual) -> Remainder | None:
    """Describe a fit's residual; None where it is noise."""
    return remainder_of(fitted, residual.misfit) if residual.significant else None

"""The closed loop over one or several shots: what is left, what it is traced to, what is left then."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from analysis.collision.effects import WIDER, findings
from analysis.diagnosis import words
from analysis.diagnosis.driven import diagnose_driven
from analysis.diagnosis.learning import contact_words
from analysis.diagnosis.learning.beyond_catalogue import beside, beyond_catalogue
from analysis.diagnosis.learning.law_instead import LawAlone
from analysis.diagnosis.learning.law_learning import may_reach
from analysis.diagnosis.limit import SECONDS, Limit
from analysis.diagnosis.result import Diagnosis, Errors, FoundEffect, LearnedLaw, Verdict
from analysis.diagnosis.search.competing_models import apart
from analysis.diagnosis.search.forward_selection import Trail, without
from analysis.diagnosis.search.full_rate import seen_finely
from analysis.diagnosis.search.search import Search, Searched
from analysis.diagnosis.verdict.acceptance import Settled, accepted_effects, clear, settle
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.cross_validation import Prediction, choose, predict
from analysis.diagnosis.verdict.identifiability import Separation, missed_without
from analysis.diagnosis.verdict.other_names import other_names
from analysis.diagnosis.verdict.residual import Residual, describe, errors, judge, looks_like
from analysis.diagnosis.verdict.told_beside import blind_spots, candidates, separating
from analysis.inference.fit.as_fit import as_fit, effect_parameters
from analysis.inference.fit.begin import begin_of
from analysis.inference.fit.first_fit import first_fit
from analysis.inference.fit.free_parameters import TrialEffect, trial_effects
from analysis.inference.fit.hypothesis import JointData
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.fit.likely_noises import under_likely_noises
from analysis.inference.fit.profile import with_profile_std
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.joint_data import shakings_of, site_under
from analysis.shot.disturbance import Shaking
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.shot.shot import Progress, Stop


def diagnose(
    motions: Sequence[Motion],
    *,
    fit: Fit | None = None,
    model: str = "paper",
    accepted: Sequence[str] = (),
    laws: Sequence[str] = (),
    hold_out: int | None = None,
    shakings: Sequence[Shaking | None] | None = None,
    seconds: float = SECONDS,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Diagnosis:
    """Diagnose ``motions`` (one or several shots of one rig) against the base ``model`` with ``accepted`` effects.

    ``laws`` are the keys of a person's own (``laws.own``), asked like the catalogue's effects.
    ``fit`` is a joint base fit of these motions, where there is one already; ``hold_out`` the index of the shot that
    is foretold from the others (default: the slowest, a middle one and the fastest in turn, of two the slower).
    ``shakings`` say what shook the frame of each shot, as its reading tells; where not given, they are read here.
    After ``seconds`` on two cores what may be left out is left out: other ways through the catalogue, laws.
    Everything is judged in displacement.  Raises ValueError for an unknown model or effect, AnalysisError where there
    is nothing to judge, Cancelled when asked to stop.
    """
    began = time.perf_counter()
    stop = cancelled or (lambda: False)
    tell = progress or (lambda _what, _fraction: None)
    if not motions:
        raise ValueError("no shot to diagnose")
    if model == "driven":
        return diagnose_driven(motions, accepted, progress, cancelled)
    catalogue = trial_effects([*laws, *(name for name in accepted if "{" in name or name in WIDER)])
    accepted = findings(accepted)
    tell("fitting the base model", 0.0)
    shakings = shakings_of(motions, model, shakings)
    site = site_under(motions, shakings, CRITERIA.site_nm)
    asked = _Asked(motions, fit, model, hold_out, tell, stop, Limit(seconds, stop), began)
    begin = first_fit(motions, model, site, stop) if fit is None else begin_of(fit, motions)
    search = Search(motions, begin, catalogue, accepted, tell, stop, asked.limit)
    under_site = [search.under(site)] if site is not None else []
    for searched in under_site:
        if not searched.rest.significant:
            told = _judged(asked, _standing(asked, searched, asked.law_alone(searched.trail.start)), laws=False)
            if told.explained and not search.likelier_without_site(searched):
                return told.diagnosis
    if under_site and asked.limit():
        return _judged(asked, _standing(asked, searched, asked.law_alone(searched.trail.start))).diagnosis
    # The last effect that may join is asked where no law explains all: it seldom does.
    wandering = search.under(None, most=CRITERIA.most_effects - (site is None))
    likelier = min([wandering, *under_site], key=lambda searched: searched.best.bic)
    alone = asked.law_alone(wandering.trail.start)
    wanders = likelier is wandering
    if likelier.rest.significant and alone.explains_instead(likelier.best, catalogue):
        likelier = likelier.with_pairs()
        if alone.ahead_of(likelier.best) and seen_finely(wandering.best, wandering.trail, motions) is None:
            return _judged(asked, _nothing_but(alone, wandering)).diagnosis
    if wanders:
        return _judged(asked, _standing(asked, likelier.to_the_end(), alone)).diagnosis
    at_site = _standing(asked, likelier, asked.law_alone(likelier.trail.start))
    told = _judged(asked, at_site, laws=False)
    if told.explained:
        return told.diagnosis
    if asked.limit():
        return _judged(asked, at_site).diagnosis
    # A law that bends flights may pass for a building, and a building with a name or two come nearer than no law.
    without_site = _judged(asked, _standing_before(told.bic, asked, wandering, alone), beat=told.bic)
    if without_site.explained and without_site.bic < told.bic:
        return without_site.diagnosis
    return _judged(asked, at_site).diagnosis


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a diagnosis was asked; ``began`` when."""

    motions: Sequence[Motion]
    fit: Fit | None
    model: str
    hold_out: int | None
    tell: Progress
    stop: Stop
    limit: Limit
    began: float

    def law_alone(self, start: Fitted) -> LawAlone:
        """Return the one law that may be what a fit lacks."""
        held = choose(start.hypothesis.data) if self.hold_out is None else (self.hold_out,)
        return LawAlone(start, held, self.tell, self.stop, self.limit)


@dataclass(frozen=True, slots=True)
class _Standing:
    """What stands of what a search found, on which trail; ``held`` are the shots foretold; the law it may be alone."""

    catalogue: Sequence[TrialEffect]
    trail: Trail
    held: tuple[int, ...]
    settled: Settled
    alone: LawAlone


@dataclass(frozen=True, slots=True)
class _Judged:
    """A diagnosis under one noise, and how likely what it ends with makes the shots."""

    diagnosis: Diagnosis
    bic: float

    @property
    def explained(self) -> bool:
        """Get whether nothing is left to explain."""
        return self.diagnosis.verdict in (Verdict.ADEQUATE, Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED)


def _nothing_but(alone: LawAlone, searched: Searched) -> _Standing:
    """Return that nothing of the catalogue stands: one law explains what it leaves."""
    start, trail = searched.trail.start, searched.trail
    return _Standing(searched.catalogue, trail, alone.held, Settled.nothing(start, trail.projector_of(start)), alone)


def _standing(asked: _Asked, searched: Searched, alone: LawAlone) -> _Standing:
    """Return what stands; ``alone`` is the law that what was searched from may lack."""
    best, trail = searched.best, searched.trail
    finely = seen_finely(best, trail, asked.motions)
    rest = searched.rest if finely is None else None
    if finely is not None:
        best, trail = finely
        alone = asked.law_alone(trail.start)
    data = trail.start.hypothesis.data
    held = choose(data, in_turn=best is not trail.start) if asked.hold_out is None else (asked.hold_out,)
    return _Standing(searched.catalogue, trail, held, settle(best, trail, held, asked.tell, asked.limit, rest), alone)


def _standing_before(beat: float, asked: _Asked, searched: Searched, alone: LawAlone) -> _Standing:
    """Return what stands that may come before the criterion ``beat``: nothing, where what was found is far behind."""
    start, best = searched.trail.start, searched.best
    if may_reach(beat, best.bic, start.bic):
        return _standing(asked, searched, alone)
    return _nothing_but(alone, searched)


def _judged(asked: _Asked, standing: _Standing, *, laws: bool = True, beat: float = math.inf) -> _Judged:
    """Judge what stands, learn ``laws`` that may ``beat`` a criterion where it leaves something, and tell it."""
    motions, tell, stop = asked.motions, asked.tell, asked.stop
    trail, held, stands = standing.trail, standing.held, standing.settled
    before, data = trail.start, trail.start.hypothesis.data
    best, at, far, rest, told = stands.best, stands.at, stands.far, stands.rest, stands.told
    tell("telling look-alikes apart", 0.8)
    while True:
        sure = with_profile_std(under_likely_noises(best), stop)
        parameters = effect_parameters(sure)
        found = [_found(best, n, parameters[n], rest, far[n], trail) for n in trail.added(best)]
        effects, verdict = accepted_effects(found, rest, best)
        unclear = [effect.name for effect in found if not clear(effect, rest, CRITERIA.clear_of_misfit)]
        if effects or not rest.significant or len(unclear) in (0, len(found)):
            break
        # What little stays unexplained leaves those in doubt that are not much larger, and no others.
        fewer = without(best, unclear[0], trail)
        if fewer is None:
            break
        best, at = fewer, trail.projector_of(fewer)
        rest, far = judge(best, at), apart(best, at, trail)
    if best is not stands.passed and told is not None:
        retold = predict(best, held, best.floor, stop)
        told = (told[0], retold) if retold is not None else None
    after = sure if effects else before
    left = rest.text if effects or verdict is Verdict.ADEQUATE else _unnamed(best, trail, rest)
    learned: tuple[LearnedLaw, ...] = ()
    certain = bool(effects)
    if laws and verdict in (Verdict.UNEXPLAINED, Verdict.PARTLY_EXPLAINED):
        in_turn = standing.alone.held
        beyond = (
            beside(best, effects, before, in_turn, tell, stop, asked.limit, beat=beat)
            if effects
            else beyond_catalogue(standing.alone, best, found, beat=beat)
        )
        if beyond is not None:
            held = in_turn
            after, verdict, effects, learned = beyond.fitted, beyond.verdict, beyond.effects, beyond.laws
            told, left = beyond.foretold, beyond.rest.text
        elif not effects:
            told = (told[0], told[0]) if told and best is not before else told
    tell("errors before and after", 0.9)
    error_before, error_after = (_errors(motions, f, after.floor) for f in (before, after))
    fall = error_after.displacement_rms_m / error_before.displacement_rms_m
    after_fit = as_fit(after, motions, asked.model, 0.0)
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence=words.verdict(verdict, effects, left, fall, learned, certain=certain)
        + contact_words.told(effects, learned)
        + words.taken_along(after_fit),
        effects=tuple(effects),
        candidates=candidates(best, trail),
        error_before=error_before,
        error_after=error_after,
        error_held_out_before=_held(motions, data, held, told[0] if told else None, after.floor),
        error_held_out_after=_held(motions, data, held, told[1] if told else None, after.floor),
        fit_before=asked.fit if asked.fit and not before.names else as_fit(before, motions, asked.model, 0.0),
        fit_after=replace(after_fit, seconds=time.perf_counter() - asked.began),
        remainder=left,
        blind_spots=blind_spots(at, standing.catalogue, best) if verdict is not Verdict.UNEXPLAINED else (),
        separating_shot=separating(effects, data),
        seconds=time.perf_counter() - asked.began,
        laws=learned,
        not_asked=asked.limit.left_out,
    )
    tell("diagnosed", 1.0)
    return _Judged(diagnosis, after.bic)


def _found(
    best: Fitted, name: str, parameters: dict[str, Quantity], remainder: Residual, far: Separation, trail: Trail
) -> FoundEffect:
    """Return an effect with its evidence and with what else it may be."""
    trail.go_on()
    fewer = without(best, name, trail)
    fall = fewer.bic - best.bic if fewer else 0.0
    others, lead = other_names(best, name, remainder, far, trail)
    evidence = {
        "snr": min(far.snr, missed_without(best, fewer)),
        "delta_bic": -float(fall),
        "least_separation": float(min(far.from_other.values(), default=0.0)),
    }
    if lead is not None:
        evidence["lead_over_runner_up"] = lead
    return FoundEffect(name, parameters, evidence, others, words.found(name, parameters, others))


def _unnamed(best: Fitted, trail: Trail, rest: Residual) -> str:
    """Return what the model leaves over, and what would imitate it without being sure of a name."""
    added = [words.plain(name) for name in trail.added(best)]
    if not added:
        return rest.text
    beyond = looks_like(rest.misfit, "what that leaves over")
    return f"{describe(trail.start)}; best imitated by {' with '.join(added)}, which did not pass every test{beyond}"


def _errors(motions: Sequence[Motion], fitted: Fitted, floor: Floor) -> Errors:
    hypothesis = fitted.hypothesis
    return errors(motions, hypothesis.data.shots, hypothesis.full(fitted.point), floor, hypothesis.size)


def _held(
    motions: Sequence[Motion], data: JointData, held: tuple[int, ...], told: Prediction | None, floor: Floor
) -> Errors | None:
    if not held or told is None:
        return None
    return errors([motions[i] for i in held], [data.shots[i] for i in held], told.displacement_m, floor, 3 * len(held))

"""Alternatives and detection limits: every effect that was tried, what the shots could not show, what would decide."""

from collections.abc import Sequence

from analysis.diagnosis import words
from analysis.diagnosis.result import Candidate, FoundEffect
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.verdict.candidate_curves import curve_of_fit, curve_to_first_order
from analysis.diagnosis.verdict.identifiability import least_seen
from analysis.inference.fit.as_fit import effect_parameters
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis import JointData
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.screen.projector import Projector
from analysis.shot.quantity import Quantity


def candidates(best: Fitted, trail: Trail) -> tuple[Candidate, ...]:
    """Return every effect tried, best first: by itself on top of the model before."""
    out = []
    before = trail.start
    at = trail.projector_of(before)
    for effect, score in trail.scores.items():
        fitted = trail.of((*before.effects, effect))
        if fitted is not None and fitted.log_likelihood < before.log_likelihood:
            fitted = None  # at zero strength it would be as likely: the search did not converge
        parameters: dict[str, Quantity] = effect_parameters(fitted)[effect] if fitted else {}
        delta = fitted.bic - before.bic if fitted else None
        if effect in best.effects:
            remark = "in the model now"
        elif fitted is None:
            remark = "scored only"
        else:
            remark = "does not pay" if delta is None or delta > -trail.least_fall() else "another does better"
        curves = curve_of_fit(fitted, before) if fitted is not None else curve_to_first_order(at, score)
        out.append(Candidate(effect, float(score.gain), delta, parameters, remark, curves))
    out.sort(key=lambda c: (c.delta_bic if c.delta_bic is not None else 0.0, -c.score))
    return tuple(out)


def blind_spots(at: Projector, catalogue: Sequence[TrialEffect], best: Fitted) -> tuple[str, ...]:
    """Return what these data could not have shown, with the size that would have stood out by 5 sigma."""
    out = []
    for kind in catalogue:
        if kind.effect in best.effects or len(kind.starts) > 12:
            continue
        if best.hypothesis.data.base.one_body and not kind.one_body:
            continue
        least = least_seen(at, kind)
        name = kind.amplitude[0]
        if least is None:
            out.append(f"{kind.effect.short_words} of any size")
        else:
            out.append(f"{kind.effect.short_words} below {least:.1g} {words.unit_of(name)}".strip())
    out.append("a wrong wavelength, a cosine error and a wrong mass, which only rescale the parameters")
    return tuple(out)


def separating(effects: Sequence[FoundEffect], data: JointData) -> str:
    """Return in words which further shot would separate effects from their look-alikes."""
    speeds = [abs(s.course.velocity_in_m_per_s) for s in data.shots]
    return "; ".join(
        dict.fromkeys(
            words.separating(e.effect, e.indistinguishable_from, speeds) for e in effects if e.indistinguishable_from
        )
    )

"""Where the catalogue leaves something: learned laws, alone or beside the effects that were found or came nearest."""

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.diagnosis.cross_validation import Prediction, predict
from analysis.diagnosis.hypothesis_fit import Fitted
from analysis.diagnosis.law_learning import Discovery, learn_laws
from analysis.diagnosis.projector import projector
from analysis.diagnosis.residual import Residual, judge
from analysis.diagnosis.result import FoundEffect, LearnedLaw, Verdict
from analysis.shot import Progress, Stop


@dataclass(frozen=True, slots=True)
class Beyond:
    """What explains something, or all, though no effect was named; ``foretold`` without it and with it."""

    fitted: Fitted
    verdict: Verdict
    effects: list[FoundEffect]
    laws: tuple[LearnedLaw, ...]
    foretold: tuple[Prediction, Prediction]
    rest: Residual


def beyond_catalogue(
    before: Fitted,
    nearest: Fitted,
    effects: Sequence[FoundEffect],
    held: tuple[int, ...],
    tell: Progress,
    stop: Stop,
) -> Beyond | None:
    """Return what lowers the error of the held-out shots, or None where nothing does.

    ``nearest`` is the fit with the ``effects`` of the catalogue that came nearest.  Laws alone
    that explain all are taken; otherwise the likeliest of laws alone, those effects alone, and laws beside them.
    """
    tell("learning a law", 0.8)
    alone = learn_laws(before, held, tell, stop)
    if alone is not None and alone.explains:
        return _learned(alone, [])
    helped = _helps(before, nearest, held, stop)
    if helped is None:
        return _learned(alone, []) if alone is not None else None
    tell("learning a law beside the effects that came nearest", 0.85)
    joined = learn_laws(nearest, held, tell, stop)
    if joined is not None:
        joined = Discovery(joined.laws, joined.fitted, joined.rest, (helped[0], joined.foretold[1]))
    found = [_learned(alone, []) if alone else None, _learned(joined, list(effects)) if joined else None]
    rest = judge(nearest, projector(nearest))
    found.append(Beyond(nearest, Verdict.PARTLY_EXPLAINED, list(effects), (), helped, rest))
    return min((one for one in found if one is not None), key=lambda one: one.fitted.bic)


def beside(
    named: Fitted, effects: Sequence[FoundEffect], before: Fitted, held: tuple[int, ...], tell: Progress, stop: Stop
) -> Beyond | None:
    """Return a law beside ``effects`` that passed every test and left something, or None where there is none.

    ``named`` is the fit with those effects, ``before`` the base model's.
    """
    tell("learning a law beside the effects that were found", 0.8)
    found = learn_laws(named, held, tell, stop)
    if found is None:
        return None
    base = predict(before, held, named.floor, stop) or found.foretold[0]
    return _learned(Discovery(found.laws, found.fitted, found.rest, (base, found.foretold[1])), list(effects))


def _learned(found: Discovery, effects: list[FoundEffect]) -> Beyond:
    verdict = Verdict.LAW_LEARNED if found.explains else Verdict.PARTLY_EXPLAINED
    return Beyond(found.fitted, verdict, effects, found.laws, found.foretold, found.rest)


def _helps(before: Fitted, nearest: Fitted, held: tuple[int, ...], stop: Stop) -> tuple[Prediction, Prediction] | None:
    """Return what is foretold without and with the effects that came nearest, or None where they do not help."""
    if nearest is before or not held or not nearest.converged:
        return None
    first, told = (predict(fitted, held, nearest.floor, stop) for fitted in (before, nearest))
    return (first, told) if first is not None and told is not None and told.beats(first) else None

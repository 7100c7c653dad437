"""Fit other frequencies of a mode, or other ranges of an attraction, that are nearly as likely.

The likelihood has one maximum for each number of periods within the contact, or for each range that ends between two
of the gaps that the bounces reach.  The curvature at one maximum ignores the others, so the parameters' covariance is
that of all maxima, weighted by their likelihood.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search.forward_selection import WORTH_FINISHING, Trail, better, converge, without
from analysis.inference import Fitted, Linearised, TrialEffect, distinct_starts, refit

Start = tuple[Mapping[str, float], ...]  # an effect's values per shot
_SCALES = ("frequency_hz", "range_m")  # parameters that set an effect's scale in time or space
_APART = 0.06  # in the logarithm: scores closer than this belong to the same maximum ...
_SAME = 0.02  # ... and fits closer than this
_MOST = 8  # maxima that are fitted
_STEP = 0.02  # in ln f, between start frequencies of a mode of natural size
_EVALUATIONS = 16
_BEYOND_EDGES = (-6.0, -3.0, 3.0, 6.0)  # standard deviations of a range, from which further fits start


def at_likeliest_scale(fitted: Fitted, trail: Trail, *, thoroughly: bool = True) -> Fitted:
    """Return the likeliest fit over the scales of its effects; ``thoroughly`` as in ``at_other_scales``."""
    best = min(at_other_scales(fitted, trail, thoroughly=thoroughly), key=lambda one: one.bic, default=fitted)
    if not better(best, fitted):
        return fitted
    key, polished = frozenset(fitted.effects), converge(best, trail)
    trail.elsewhere[key] = [polished, *(one for one in trail.elsewhere[key] if one is not best)]
    return polished


def at_other_scales(fitted: Fitted, trail: Trail, *, thoroughly: bool = True) -> list[Fitted]:
    """Return fits of the same effects with one at another frequency or range, nearly as likely or likelier.

    Cost: a short fit (20 ms) from each of 8 maxima, and 4 for a range.  With ``thoroughly``, a support that has several
    maxima is also fitted from 70 further frequencies.
    """
    scaled = [effect for effect in trail.added(fitted) if _scale_of(effect) is not None]
    if not scaled:
        return []
    key = frozenset(fitted.effects)
    if key not in trail.elsewhere:
        found = [fitted]
        none: list[Fitted] = []
        for kind in (kind for kind in fitted.problem.effects if kind.effect in scaled):
            found += trail.within("other frequencies and ranges", partial(_fits, fitted, kind, trail, thoroughly), none)
        trail.elsewhere[key] = found
    return [one for one in trail.elsewhere[key] if any(apart(one, fitted, effect) for effect in scaled)]


def _scale_of(effect: Effect) -> str | None:
    """Return the name of the shared parameter in which the likelihood has several maxima, or None."""
    shared = [free.name for free in effect.parameters if not free.own]
    return next((name for name in _SCALES if name in shared), None) if effect.wave is None else None


def with_std_over(fitted: Fitted, others: Sequence[Fitted]) -> Fitted:
    """Return the fit with the covariance, about its own values, of the mixture of the fit and ``others``.

    Each has the weight exp(-BIC / 2) (Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773).
    """
    if not others:
        return fitted
    weights = np.exp([0.0, *(min(0.5 * (fitted.bic - one.bic), 0.0) for one in others)])
    weights /= weights.sum()
    inverse = weights[0] * fitted.inverse
    for weight, one in zip(weights[1:], others, strict=True):
        same = [one.problem.names.index(name) for name in fitted.problem.names]  # effects may be in another order
        off = one.z[same] - fitted.z
        inverse += weight * (one.inverse[np.ix_(same, same)] + np.outer(off, off))
    return replace(fitted, inverse=inverse)


def _fits(fitted: Fitted, kind: TrialEffect, trail: Trail, thoroughly: bool) -> list[Fitted]:
    """Return the fits with the effect ``kind`` at other scales that are nearly as likely or likelier."""
    fewer = without(fitted, kind.effect, trail)
    if fewer is None:
        return []
    at = trail.linearised(fewer)
    # first-order scores of a large effect are unreliable: maxima that score much less than the best are fitted too
    maxima = [score.start for score in distinct_starts(at.scores(kind), _MOST, _APART)]
    found = _fitted_from(maxima, fitted, at, kind, trail)
    if kind.effect.range_at >= 0:
        found += _beyond_edges(fitted, kind.effect, trail)
    found = _nearly(fitted, found, kind.effect)
    if not (found and thoroughly and kind.effect.in_series):
        return found
    large = [(start,) * len(maxima[0]) for start in _of_natural_size(kind)]
    return _nearly(fitted, [*found, *_fitted_from(large, fitted, at, kind, trail)], kind.effect)


def _beyond_edges(fitted: Fitted, effect: Effect, trail: Trail) -> list[Fitted]:
    """Return fits that start with a force's range some standard deviations away, the other parameters following.

    chi^2 has an edge where the range equals a gap that a bounce reaches.  The scores, which are of coarse steps, may
    miss the better side: of 50 adhesions (seeds 119 to 121) three fits ended on the wrong one, chi^2 10 to 28 higher.
    """
    problem, place, std = fitted.problem, _place(fitted, effect), _std(fitted, effect)
    if not math.isfinite(std):
        return []

    def fit(times: float) -> Fitted | None:
        start = fitted.z + (times / std) * fitted.inverse[:, place]
        try:
            return problem.fit_once(start, evaluations=_EVALUATIONS, cancelled=trail.stop)
        except Infeasible:
            return None

    return [one for one in side_by_side(fit, _BEYOND_EDGES) if one is not None]


def _of_natural_size(kind: TrialEffect) -> list[Mapping[str, float]]:
    """Return starts of a mode of natural size, over the upper half of its frequency range (in ln f).

    The higher its frequency, the larger a mode must be to show alongside the plate's stiffness.  The motion is then not
    linear in the mode's size, as the scores assume.
    """
    sizes = {free.name: free.scale for free in kind.free_parameters if free.name in kind.amplitude}
    low, high = (math.log(of(start["frequency_hz"] for start in kind.starts)) for of in (min, max))
    frequencies = np.exp(np.arange((low + high) / 2, high, _STEP))
    return [{**kind.starts[0], **sizes, "frequency_hz": float(frequency)} for frequency in frequencies]


def _fitted_from(
    starts: Sequence[Start], like: Fitted, at: Linearised, kind: TrialEffect, trail: Trail
) -> list[Fitted]:
    """Return the likeliest fits from these starts of the effect, of those that may be nearly as likely as ``like``."""
    short = side_by_side(lambda start: refit(at, kind, start, trail.stop, least_bic=like.bic), starts)
    promising = [one for one in short if one is not None and one.bic < like.bic + WORTH_FINISHING]
    promising.sort(key=lambda one: one.bic)
    return side_by_side(lambda one: one.refitted(evaluations=_EVALUATIONS, cancelled=trail.stop), promising[:_MOST])


def _nearly(fitted: Fitted, found: Sequence[Fitted], effect: Effect) -> list[Fitted]:
    """Return the nearly as likely ones of ``found``, one for each scale other than that of ``fitted``."""
    out: list[Fitted] = []
    for one in sorted(found, key=lambda one: one.bic):
        determined = bool(np.all(np.isfinite(one.inverse)))
        if (
            determined
            and one.bic < fitted.bic + CRITERIA.nearly
            and all(apart(one, other, effect) for other in (fitted, *out))
        ):
            out.append(one)
    return out


def apart(one: Fitted, other: Fitted, effect: Effect) -> bool:
    """Return whether two fits have an effect at different scales; False if it has none.

    Ranges also differ if they are more than a standard deviation of the second apart, as across an edge of chi^2.
    """
    if _scale_of(effect) is None:
        return False
    first, second = (fitted.z[_place(fitted, effect)] for fitted in (one, other))
    same = min(_SAME, _std(other, effect)) if effect.range_at >= 0 else _SAME
    return bool(abs(first - second) > same)


def _std(fitted: Fitted, effect: Effect) -> float:
    """Return the standard deviation of the logarithm of an effect's scale; infinite if it is not determined."""
    place = _place(fitted, effect)
    variance = fitted.inverse[place, place]
    return math.sqrt(variance) if variance > 0.0 else math.inf


def _place(fitted: Fitted, effect: Effect) -> int:
    """Return the index of the logarithm of an effect's scale in the search vector."""
    return fitted.problem.names.index((f"{effect.key}.{_scale_of(effect)}", -1))

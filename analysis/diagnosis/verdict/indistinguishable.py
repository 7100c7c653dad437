"""Find the other effects that could be meant instead of a found one."""

import math

from analysis.collision import Effect
from analysis.diagnosis.search.competing_models import fitted_instead
from analysis.diagnosis.search.forward_selection import Trail, without
from analysis.diagnosis.verdict.coincidence import imitates_by_coincidence
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.identifiability import Separation
from analysis.diagnosis.verdict.residual import Residual
from analysis.inference import Fitted


def indistinguishable_effects(
    best: Fitted, effect: Effect, remainder: Residual, far: Separation, trail: Trail
) -> tuple[tuple[Effect, ...], float | None]:
    """Return the effects that may be meant instead of one of a fit, and its lead in BIC over the best of them.

    These are the effects that nearly coincide with it to first order, and those whose fit in its place is nearly as
    likely.  The lead is None where none was fitted.  Raises Cancelled.
    """
    others = list(far.too_close(remainder.size))
    kept = {one for one in best.effects if one != effect}
    lead = math.inf
    for key, other in trail.fits.items():
        swapped = set(key) - set(best.effects)
        if len(key) == len(best.effects) and len(swapped) == 1 and kept <= set(key):
            new = next(iter(swapped))
            if new.widens == effect.key:  # the wider variant of the effect: its further parameter did not pay
                continue
            lead = min(lead, other.bic - best.bic)
            # Having fewer parameters does not alone make one of two look-alikes the true one.
            if min(other.bic - best.bic, _behind(other, best)) < CRITERIA.least_lead and new not in others:
                others.append(new)
    if not remainder.significant:
        others = [
            other
            for other in others
            if not imitates_by_coincidence(trail.of((*kept, other)), other, best, effect)
            and not _falls_behind(best, effect, other, trail.of((*kept, other)), far, trail)
        ]
    return tuple(others), lead if math.isfinite(lead) else None


def _behind(other: Fitted, best: Fitted) -> float:
    """Return how much less likely a fit is than the best, as chi^2, each under its own noise."""
    return 2 * (best.log_likelihood - other.log_likelihood)


def _falls_behind(
    best: Fitted, effect: Effect, other: Effect, found: Fitted | None, far: Separation, trail: Trail
) -> bool:
    """Return whether a line that coincides with an effect to first order no longer does when fitted.

    To first order every shot has its own amplitude; in fact all shots share one.  The line is fitted to convergence
    from the fit ``found`` in the search and from where it imitates the effect best.
    """
    if other.wave is None or other not in far.starts:
        return False
    fewer = without(best, effect, trail)
    if fewer is None or found is None:
        return False
    kind = next(kind for kind in trail.catalogue if kind.effect == other)
    instead = fitted_instead(best, trail.linearised(fewer), far, None, trail.stop, kind)
    ends = [one.continued(trail.stop) for one in ([found] if instead is None else [found, instead])]
    for end in ends:
        trail.keep(end)
    return all(end.converged for end in ends) and min(_behind(end, best) for end in ends) > CRITERIA.separation**2

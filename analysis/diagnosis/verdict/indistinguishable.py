"""Find the other effects that could be meant instead of a found one.

One kind is excluded: an effect whose parameters, fitted per shot, lie where another effect predicts them.  A plate that
swings when the block arrives has two parameters per shot.  With them it can imitate one shared parameter of another
effect.  Each shot in which it does exactly that is a coincidence, which chi^2 does not count.  The evidence does
(MacKay, "Information Theory, Inference, and Learning Algorithms", ch. 28): the likelihood averaged over a prior of
these parameters.  The prior scatters about zero by the amount that the data favour most (empirical Bayes), which gives
the effect every benefit.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis.evidence.identifiability import Separation
from analysis.diagnosis.evidence.residual import Residual
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search.competing_models import fitted_instead
from analysis.diagnosis.search.forward_selection import Trail, without
from analysis.inference import Fitted
from analysis.shot import Floats

_ROUNDS = 300  # of expectation maximisation; microseconds each


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


@dataclass(frozen=True, slots=True)
class PerShotCost:
    """The cost, in ``nats`` of ln L, of per-shot parameters that no model predicts.

    ``prior_width`` is the width of the prior of each parameter of one shot, in the shot's order and the vector's units.
    """

    nats: float
    prior_width: Floats


def per_shot_cost(fitted: Fitted, effect: Effect) -> PerShotCost | None:
    """Return the cost of one effect's per-shot parameters in a fit; None where the data do not determine them."""
    free = fitted.problem.free_parameters
    places = [fitted.problem.offset + k for k, (one, _, _) in enumerate(free) if one == effect]
    names = [parameter.name for one, parameter, _ in free if one == effect]
    here, known = fitted.z[places], fitted.inverse[np.ix_(places, places)]
    if not places or not np.all(np.isfinite(known)) or np.any(np.diag(known) <= 0.0):
        return None
    unit = np.sqrt(np.diag(known))
    kinds = np.array([list(dict.fromkeys(names)).index(name) for name in names])
    count = np.bincount(kinds)
    # The unit of each kind of parameter is the smallest standard deviation among the shots' values of that kind.
    of_kind = np.array([unit[kinds == k].min() for k in range(len(count))])
    here, known = here / of_kind[kinds], known / np.outer(of_kind[kinds], of_kind[kinds])
    variance = np.bincount(kinds, here**2) / count + 1.0
    for _ in range(_ROUNDS):
        prior = variance[kinds]
        gain = prior[:, None] * np.linalg.inv(known + np.diag(prior))
        likely = (gain @ here) ** 2 + prior - np.einsum("ij,ji->i", gain, np.diag(prior))
        variance = np.bincount(kinds, likely) / count
    spread = known + np.diag(variance[kinds])
    nats = 0.5 * (np.linalg.slogdet(spread)[1] - np.linalg.slogdet(known)[1] + here @ np.linalg.solve(spread, here))
    return PerShotCost(float(nats), np.sqrt(variance) * of_kind)


def imitates_by_coincidence(rival: Fitted | None, effect: Effect, best: Fitted, instead: Effect) -> bool:
    """Return whether ``effect`` of a rival fit imitates ``instead`` of the best fit only by coincidence.

    That holds where all parameters of ``effect`` and not all of ``instead`` are fitted per shot, and ``instead`` makes
    the shots likelier by the gain of a separate effect (``Criteria.separation``), both under the noise of ``best``.
    """
    if rival is None or not effect.own or instead.own:
        return False
    theirs, ours = per_shot_cost(rival, effect), per_shot_cost(best, instead)
    if theirs is None or ours is None:
        return False
    less_likely = 2 * (theirs.nats - ours.nats) + rival.chi2(best.noise) - best.chi2(best.noise)
    return less_likely > CRITERIA.separation**2

"""Evidence against an effect whose parameters, fitted per shot, lie where another effect predicts them.

A plate that swings when the block arrives has two parameters per shot.  With them it can imitate one shared parameter
of another effect.  Each shot in which it does exactly that is a coincidence, which chi^2 does not count.  The evidence
does (MacKay, "Information Theory, Inference, and Learning Algorithms", ch. 28): the likelihood averaged over a prior of
these parameters.  The prior scatters about zero by the amount that the data favour most (empirical Bayes), which gives
the effect every benefit.
"""

from dataclasses import dataclass

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference import Fitted
from analysis.shot import Floats

_ROUNDS = 300  # of expectation maximisation; microseconds each


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

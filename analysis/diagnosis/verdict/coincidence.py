"""Evidence against an effect whose numbers, free in every shot, lie where another effect predicts them.

A plate that swings when the block arrives has two numbers in every shot, and with them can do what one shared number of
another effect does.  Each shot in which it does so and nothing else is a coincidence, which chi^2 does not see.  The
evidence does (MacKay, "Information Theory, Inference, and Learning Algorithms", ch. 28): the likelihood averaged over
what the numbers might have been, which scatter about zero by as much as the data themselves like best (empirical Bayes,
so the effect is given every benefit).
"""

from dataclasses import dataclass

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference import Fitted
from analysis.shot import Floats

_ROUNDS = 300  # of expectation and maximisation; microseconds each


@dataclass(frozen=True, slots=True)
class Unforetold:
    """The cost in ``nats`` of ln L of numbers that no model predicts.

    ``scatter`` is how far each of a shot's is from zero, in their order there and in the vector's units.
    """

    nats: float
    scatter: Floats


def unforetold(fitted: Fitted, effect: Effect) -> Unforetold | None:
    """Return the cost of the numbers of one effect of a fit, None where the data do not determine them."""
    free = fitted.problem.free_parameters
    places = [fitted.problem.offset + k for k, (one, _, _) in enumerate(free) if one == effect]
    names = [parameter.name for one, parameter, _ in free if one == effect]
    here, known = fitted.z[places], fitted.inverse[np.ix_(places, places)]
    if not places or not np.all(np.isfinite(known)) or np.any(np.diag(known) <= 0.0):
        return None
    unit = np.sqrt(np.diag(known))
    kinds = np.array([list(dict.fromkeys(names)).index(name) for name in names])
    count = np.bincount(kinds)
    # The unit of a kind is its best known number: what scatters is reckoned in it, and the others may be known less.
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
    return Unforetold(float(nats), np.sqrt(variance) * of_kind)


def by_chance(rival: Fitted | None, effect: Effect, best: Fitted, instead: Effect) -> bool:
    """Return whether ``effect`` of a rival fit would do what ``instead`` of the best does only by coincidence.

    That is told where its numbers are all a shot's own and the others are not, and where ``instead`` makes the shots
    likelier by as much as one does that stands apart (``Criteria.separation``), both beside the noise of ``best``.
    """
    if rival is None or not effect.own or instead.own:
        return False
    theirs, ours = unforetold(rival, effect), unforetold(best, instead)
    if theirs is None or ours is None:
        return False
    less_likely = 2 * (theirs.nats - ours.nats) + rival.chi2(best.noise) - best.chi2(best.noise)
    return less_likely > CRITERIA.separation**2

"""Add effects to a fit, one after the other, each from the start values that explain most of the residual."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.collision import Infeasible
from analysis.inference.fit.added_effect import refit
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.problem import Fitted, Problem
from analysis.inference.screen.screening import distinct_starts
from analysis.shot import Floats, Stop

_FOLLOWED = 3  # start values from which an effect is fitted
_EVALUATIONS = 30  # of a search from an effect's natural size
_SHORT = 16  # of the search that ends it


def with_effect(problem: Problem, z: Floats, kinds: Sequence[TrialEffect], stop: Stop) -> Fitted:
    """Return the fit of a problem at ``z`` with effects of these ``kinds`` added, the noise learnt at each step.

    Raises Infeasible where an effect has no trajectory from any start values.
    """
    return joined(problem.fit_once(z, evaluations=1, anew=True, cancelled=stop), kinds, stop)


def joined(here: Fitted, kinds: Sequence[TrialEffect], stop: Stop) -> Fitted:
    """Return a fit with effects of these kinds added, one after the other."""
    for kind in kinds:
        here = _with_one_more(here, kind, stop)
    return here


def _with_one_more(here: Fitted, kind: TrialEffect, stop: Stop) -> Fitted:
    at = here.linearise()
    starts = [score.start for score in distinct_starts(at.scores(kind))[:_FOLLOWED]]
    if here.noise.coloured:  # noise learnt from a residual may have taken up the effect
        starts += [score.start for score in distinct_starts(at.under(here.unlearned_noise).scores(kind))[:1]]
    trials = [trial for start in starts if (trial := refit(at, kind, start, stop)) is not None]
    if not trials or min(trial.bic for trial in trials) > here.bic:
        natural = (_from_natural_size(here, kind, start, stop) for start in kind.starts[:_FOLLOWED])
        trials += [trial for trial in natural if trial is not None]
    if not trials:
        raise Infeasible(f"no start of {kind.effect.name} gives a trajectory")
    trials.sort(key=lambda trial: trial.bic)
    return trials[0].fitted_on(evaluations=_SHORT, cancelled=stop)


def _from_natural_size(here: Fitted, kind: TrialEffect, start: Mapping[str, float], stop: Stop) -> Fitted | None:
    """Return a fit from an effect's natural size, for where other parameters absorb it to first order; None if none."""
    problem = here.problem.with_effect(kind, start)
    effective = here.effective
    values = tuple({**v, kind.effect: dict(start)} for v in effective.values)
    low, high = problem.bounds
    try:
        z = np.clip(problem.pack_effective(Point(effective.base, effective.own, values)), low, high)
        return problem.fit_once(z, evaluations=_EVALUATIONS, cancelled=stop)
    except (Infeasible, np.linalg.LinAlgError, FloatingPointError):
        return None

"""Closed forms fitted to the shots: each as far as it may still come to the front, the nearest to its end."""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible, LawError
from analysis.compiled import side_by_side
from analysis.diagnosis.learning.closed_forms import Fitting
from analysis.diagnosis.learning.curve_fit import Learned
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference import Fitted, Point, Problem, trial_effect
from analysis.shot import Cancelled, Stop

_SHORT = 8  # evaluations of a search that only compares
_STAGES, _A_STAGE = 4, 10  # of a search to the end, and evaluations of each
_MORE = 3.0  # times what its last stage gained: all that a search may still gain ...
_LITTLE = 1.0  # ... of the criterion: where a stage gained less, who is ahead is decided
_REACH = 200.0  # of the criterion behind the best: what a short search may have left, and no more
_REACH_SHARE = 0.02  # of what the best explains, the same where that is much
_OVER_A_KINK = 0.2  # of a safe step
_UNDECIDED = 3.0  # times that, where the short search had not come to its end

Forms = tuple[Fitting, ...]  # one for every curve of a fit


def fit_forms(
    start: Fitted, learned: Learned, each: Sequence[Forms], stop: Stop, *, beat: float = math.inf
) -> list[Fitted | None]:
    """Return the fits of closed forms in place of the curves of ``learned``, in order; None where there is none.

    What falls far short of the best, or of the criterion ``beat``, is left where a short search ended; what comes
    nearer so slowly that it will not reach them is left on the way.
    Cost: some 0.1 to 0.5 s a form that is no good, up to several seconds for one that is.
    """

    def begun(forms: Forms) -> Fitted | None:
        if stop():
            raise Cancelled
        try:
            problem, z = _begin(start, learned, forms)
            return problem.fit_once(z, evaluations=_SHORT, cancelled=stop)
        except (Infeasible, LawError, np.linalg.LinAlgError):
            return None

    def ended(here: Fitted, best: float = math.inf) -> Fitted:
        with contextlib.suppress(Infeasible, np.linalg.LinAlgError):
            for _ in range(_STAGES):
                before, here = here.bic, here.fitted_on(evaluations=_A_STAGE, cancelled=stop)
                gained = before - here.bic
                too_slow = here.bic - _MORE * gained > best + CRITERIA.form_excluded
                if here.converged or gained < _LITTLE or too_slow:
                    break
        return here

    short = side_by_side(begun, each)
    ahead = min((one for one in short if one is not None), key=lambda one: one.bic, default=None)
    if ahead is None:
        return short
    first = ended(ahead)
    best = min(first.bic, beat)
    reach = max(_REACH, _REACH_SHARE * (start.bic - best))

    def decided(one: Fitted | None) -> Fitted | None:
        if one is None or one is ahead:
            return None if one is None else first
        return one if one.bic > best + reach * (1.0 if one.converged else _UNDECIDED) else ended(one, best)

    return side_by_side(decided, short)


def over_kinks(fitted: Fitted, stop: Stop) -> Fitted:
    """Return the fit of a law with a corner led to its end in steps so short that the corner is met; others as is.

    What a step over a corner misses goes as the square of its length, and so do the numbers that a fit ends with: at
    the length that serves to compare up to five standard deviations of a corner of the overlap, of a bend's a tenth.
    """
    if not any(effect.kinked for effect in fitted.effects):
        return fitted
    finer = replace(fitted.problem, stride=_OVER_A_KINK)
    try:
        return finer.fit(fitted.z, cancelled=stop).continued(stop)
    except (Infeasible, np.linalg.LinAlgError):
        return fitted


def _begin(start: Fitted, learned: Learned, forms: Forms) -> tuple[Problem, np.ndarray]:
    """Return base, effects and closed forms, and where a search of them begins."""
    base = start.problem.unpack(learned.z + sum(form.base_step for form in forms))
    kinds, values = [], base.values
    for form, term in zip(forms, learned.terms, strict=True):
        span = max(abs(term.basis.knots[0]), abs(term.basis.knots[-1]))
        kind = trial_effect(form.form.law(term.argument, form.parameters, span))
        kinds.append(kind)
        values = tuple({**one, kind.effect: dict(kind.starts[0])} for one in values)
    problem = learned.problem.with_effects((*learned.problem.effects, *kinds), learned.problem.fixed)
    return problem, problem.pack(Point(base.base, base.own, values))

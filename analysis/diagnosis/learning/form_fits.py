"""Fit closed forms to the shots in stages: stop each form that cannot win, bring the best to convergence."""

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from analysis.collision import FORMS, Infeasible, LawError
from analysis.compiled import side_by_side
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.learning.closed_forms import Fitting
from analysis.diagnosis.learning.curve_fit import Learned
from analysis.inference import Fitted, Point, Problem, trial_effect
from analysis.shot import Cancelled, Stop

_SHORT = 8  # evaluations of a search that only compares
_STAGES, _A_STAGE = 4, 10  # stages of a search to convergence, and evaluations of each
_MORE = 3.0  # times the gain of its last stage: the most that a search is assumed to gain still
_LITTLE = 1.0  # BIC: after a stage that gains less, the order of the forms is decided
_REACH = 200.0  # BIC behind the best after a short search: the most that a longer search may make up
_REACH_SHARE = 0.02  # the same as a share of the best form's gain in BIC, where that is larger
_OVER_A_KINK = 0.2  # of a safe step
_UNDECIDED = 3.0  # factor on that reach where the short search had not converged

_EQUAL = 0.1  # BIC: closer forms are one function over the range visited, and rounding orders them

Forms = tuple[Fitting, ...]  # one for every curve of a fit
Item = TypeVar("Item")


def likeliest(fits: Iterable[Item], bic: Callable[[Item], float], forms: Callable[[Item], Forms]) -> Item:
    """Return the likeliest of ``fits``; of those equally likely, the one whose forms are declared first.

    A power and an odd power, for example, are one function on the side of zero that the shots visit.
    """
    by_bic = sorted(((bic(one), one) for one in fits), key=lambda pair: pair[0])
    equal = [one for value, one in by_bic if value < by_bic[0][0] + _EQUAL]
    return equal[0] if len(equal) == 1 else min(equal, key=lambda one: [FORMS.index(form.form) for form in forms(one)])


def fit_forms(
    start: Fitted, learned: Learned, each: Sequence[Forms], stop: Stop, *, beat: float = math.inf
) -> list[Fitted | None]:
    """Return the fits of closed forms in place of the curves of ``learned``, in order; None where there is none.

    A form far above the best, or above the BIC ``beat``, is left as a short search found it.  A form that gains too
    slowly to reach them is stopped early.  Cost: about 0.1 to 0.5 s for a poor form, up to several seconds for a good
    one.
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
                before, here = here.bic, here.refitted(evaluations=_A_STAGE, cancelled=stop)
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


def refit_resolving_kinks(fitted: Fitted, stop: Stop) -> Fitted:
    """Refit a law with a kink to convergence, with time steps short enough to resolve it; return others unchanged.

    The error of a step over a kink, and with it the parameters' error, scales as the square of its length.  At the
    length used for comparisons it is up to five standard deviations for a kink in the overlap, 0.1 in the deflection.
    """
    if not any(effect.kinked for effect in fitted.effects):
        return fitted
    finer = replace(fitted.problem, stride=_OVER_A_KINK)
    try:
        return finer.fit(fitted.z, cancelled=stop).continued(stop)
    except (Infeasible, np.linalg.LinAlgError):
        return fitted


def _begin(start: Fitted, learned: Learned, forms: Forms) -> tuple[Problem, np.ndarray]:
    """Return the problem of base, effects and closed forms, and the vector at which its search starts."""
    base = start.problem.unpack(learned.z + sum(form.base_step for form in forms))
    kinds, values = [], base.values
    for form, term in zip(forms, learned.terms, strict=True):
        span = max(abs(term.basis.knots[0]), abs(term.basis.knots[-1]))
        kind = trial_effect(form.form.law(term.argument, form.parameters, span))
        kinds.append(kind)
        values = tuple({**one, kind.effect: dict(kind.starts[0])} for one in values)
    problem = learned.problem.with_effects((*learned.problem.effects, *kinds), learned.problem.fixed)
    return problem, problem.pack(Point(base.base, base.own, values))

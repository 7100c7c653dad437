"""Learn two laws where one does not explain all: both at once, or, if that fails, a second in addition to the first.

One law alone absorbs part of the other, and may then have the wrong argument or no closed form at all.  Two free curves
fitted jointly do not.  Forms are fitted to each curve with the other curve free, then the forms are fitted jointly.
"""

import itertools
import math
from collections.abc import Iterable

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.evidence.cross_validation import Predictions, predict
from analysis.diagnosis.evidence.residual import residual_of
from analysis.diagnosis.findings.criteria import CRITERIA, may_beat
from analysis.diagnosis.learning.closed_forms import likely_forms
from analysis.diagnosis.learning.curve_fit import Learned, fit_terms, likeliest_pairs
from analysis.diagnosis.learning.curve_motion import Term, fit_with_motions
from analysis.diagnosis.learning.form_fits import fit_forms, likeliest, refit_resolving_kinks
from analysis.diagnosis.learning.law_learning import (
    FIRST_PIECES,
    FIRST_STEPS,
    FOLLOWED,
    Discovery,
    arguments_of,
    converge_contenders,
    curves_may_beat,
    finer,
    forms_may_beat,
    learn_law,
)
from analysis.diagnosis.learning.learned_law import FormFit, as_learned, in_joint_fit
from analysis.diagnosis.search.forward_selection import without_effect
from analysis.inference import Fitted
from analysis.shot import Progress, Stop

_PAIRS = 4  # of arguments that are fitted, the likeliest to first order
_MAX_PIECES = 48
_FORMS = 4  # of each curve, nearest to it first
_AT_FIRST = 2  # of these, fitted with as many of the other curve; then all forms with the other's best


def learn_laws(
    start: Fitted, held: tuple[int, ...], tell: Progress, stop: Stop, *, beat: float = math.inf
) -> Discovery | None:
    """Return the law that ``start`` lacks, or two: a second is learned where the first leaves more than noise."""
    first = learn_law(start, held, tell, stop)
    return first if first is None or first.explains else learn_second_law(first, held, tell, stop, beat=beat)


def learn_second_law(
    first: Discovery, held: tuple[int, ...], tell: Progress, stop: Stop, *, beat: float = math.inf
) -> Discovery:
    """Return two laws, or the first where there is no second.  Raises Cancelled.

    Two laws learned at once are returned where they explain all, else a second law in addition to the first.  A form
    that was worse than its curve only for lack of the second law is then accepted for the first law.  Two laws must
    come below the BIC ``beat`` (``law_learning``); both at once must also come below the first law by ``law_fall``.
    """
    tell("learning two laws at once", 0.86)
    together = learn_two(first.start, held, stop, beat=min(beat, first.fitted.bic - CRITERIA.law_fall))
    if together is not None and together.explains:
        return together
    if not may_beat(beat, first.fitted.bic, first.start.bic):
        return first
    tell("learning a second law", 0.88)
    law = first.laws[0]
    second = learn_law(first.fitted, held, tell, stop, beside=law, beat=beat)
    if second is None:
        return first
    both = (in_joint_fit(law, second.fitted, law.form is not None or second.explains), *second.laws)
    return Discovery(first.start, both, second.fitted, second.residual, (first.predictions[0], second.predictions[1]))


class _Pairs:
    """Pairs of closed forms in place of two curves, with the fits made so far: at first those nearest to the curves."""

    def __init__(self, start: Fitted, curves: Learned, stop: Stop) -> None:
        self.curves, self._start, self._stop = curves, start, stop
        self._with_last = [curves.with_last(which) for which in (0, 1)]
        self.forms = [likely_forms(one, _FORMS) for one in self._with_last]
        self.fits: dict[tuple[int, int], Fitted] = {}
        first, other = (range(min(_AT_FIRST, len(one))) for one in self.forms)
        self.fit(itertools.product(first, other))

    def fit(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Fit pairs of forms, given by their indices, unless they were fitted before."""
        new = [pair for pair in pairs if pair not in self.fits]
        each = [(self.forms[0][i], self.forms[1][j]) for i, j in new]
        fits = fit_forms(self._start, self.curves, each, self._stop, beat=self.curves.bic)
        self.fits.update({pair: one for pair, one in zip(new, fits, strict=True) if one is not None})

    def fit_with_best(self) -> None:
        """Fit all forms of either law with the best of the other, and continue those near the best to convergence."""
        self.fit((i, self.best[1]) for i in range(len(self.forms[0])))
        self.fit((self.best[0], j) for j in range(len(self.forms[1])))
        within = self.bic + CRITERIA.form_excluded
        near = [pair for pair, one in self.fits.items() if one.bic < within]
        led_on = side_by_side(lambda pair: self.fits[pair].continued(self._stop), near)
        self.fits.update(zip(near, led_on, strict=True))

    @property
    def best(self) -> tuple[int, int]:
        """Get the indices of the likeliest pair."""
        first, other = self.forms
        return likeliest(self.fits, lambda pair: self.fits[pair].bic, lambda pair: (first[pair[0]], other[pair[1]]))

    @property
    def bic(self) -> float:
        """Get the BIC of the likeliest pair; infinite where none could be fitted."""
        return self.fits[self.best].bic if self.fits else math.inf

    def of_law(self, which: int, at: tuple[int, int]) -> list[FormFit]:
        """Return the forms of one law, each with the other law's form in the pair ``at``; that pair's form first."""
        pairs = [pair for pair in self.fits if pair[1 - which] == at[1 - which]]
        curves, forms = self._with_last[which], self.forms[which]
        read = [FormFit(self.fits[pair], curves, forms[pair[which]], which - 2) for pair in pairs]
        return sorted(read, key=lambda one: (one.fitted is not self.fits[at], one.bic))


def learn_two(start: Fitted, held: tuple[int, ...], stop: Stop, *, beat: float = math.inf) -> Discovery | None:
    """Return two laws that ``start`` lacks, learned at once, or None where there are none.  Raises Cancelled."""
    curves = two_curves(start, stop, beat=beat)
    if not curves or curves[0].bic > start.bic - 2 * CRITERIA.law_fall:
        return None
    pairs = min((_Pairs(start, one, stop) for one in curves), key=lambda one: one.bic)
    if not pairs.fits or min(curves[0].bic, pairs.bic) > beat:
        return None
    pairs.fit_with_best()
    at = pairs.best
    fitted = pairs.fits[at]
    judged = _judged(start, fitted, held, stop)
    if (
        judged is not None and (finer := refit_resolving_kinks(fitted, stop)) is not fitted
    ):  # takes as long as all before
        pairs.fits[at] = fitted = finer
        judged = _judged(start, fitted, held, stop)
    if judged is None or fitted.bic > curves[0].bic + CRITERIA.form_meets:
        return None
    fewer, predictions = judged
    laws = (as_learned(fewer[which] or start, pairs.of_law(which, at), True, predictions[1], held) for which in (0, 1))
    return Discovery(start, tuple(laws), fitted, residual_of(fitted, fitted.linearise()), predictions)


def _judged(
    start: Fitted, fitted: Fitted, held: tuple[int, ...], stop: Stop
) -> tuple[list[Fitted | None], Predictions] | None:
    """Return the fits without the first and without the second of two laws, and the predictions without and with both.

    None where the shots are nearly as likely without one of them, or where both jointly do not predict better.
    """
    fewer = [without_effect(fitted, law, stop) for law in fitted.effects[-2:]]
    if any(one is not None and fitted.bic > one.bic - CRITERIA.law_fall for one in fewer):
        return None
    before, after = (predict(one, held, fitted.noise, stop) for one in (start, fitted))
    if before is None or after is None or not after.predicts_better(before):
        return None
    return fewer, (before, after)


def two_curves(start: Fitted, stop: Stop, *, beat: float = math.inf) -> list[Learned]:
    """Return the pairs of free curves, fitted jointly, that explain most, with as many knots as pay.

    A few pairs that the shots do not distinguish are returned, the likeliest first: position, deflection and overlap
    are nearly the same in contact, and only one of them has a short form.  [] where there are none, or none whose
    closed forms may come below the BIC ``beat``.
    """
    pairs = likeliest_pairs(fit_with_motions(start), arguments_of(start), FIRST_PIECES, stop)[:_PAIRS]

    def fitted(terms: tuple[Term, Term]) -> Learned | None:
        try:
            return fit_terms(start.problem, start.z, terms, stop, steps=FIRST_STEPS, to_the_end=False)
        except (Infeasible, np.linalg.LinAlgError):
            return None

    rough = sorted((one for one in side_by_side(fitted, pairs) if one is not None), key=lambda one: one.bic)
    if not curves_may_beat(beat, rough, start):
        return []
    ahead = converge_contenders(start, rough, stop)
    if not forms_may_beat(beat, ahead[:1], start):
        return []

    def in_finer_pieces(learned: Learned) -> Learned:
        for _ in learned.terms:
            learned = finer(learned.with_last(0), _MAX_PIECES, stop)
        return learned

    alike = [one for one in ahead[:FOLLOWED] if one.bic < ahead[0].bic + CRITERIA.form_excluded]
    return sorted(side_by_side(in_finer_pieces, alike), key=lambda one: one.bic)

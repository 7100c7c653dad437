"""Learn a law outside the catalogue from the shots: its argument, its free curve, and its closed form.

Every argument gets a free curve (``curve_fit``); the best curves get finer knots, until that no longer pays.  Closed
forms are fitted to these curves (``closed_forms``), and the nearest forms are fitted to the shots like any effect of
the catalogue: with the same solver, the same tests and the same validation shots.  Finally arguments are compared by
their closed forms.

``beat`` is a BIC that a law must come below to count.  Curves so far above it that no closed form can come below it are
not continued.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision import ARGUMENTS, Argument, Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.evidence.cross_validation import Predictions, predict
from analysis.diagnosis.evidence.residual import Residual, residual_of
from analysis.diagnosis.findings.criteria import CRITERIA, may_beat
from analysis.diagnosis.findings.result import LearnedLaw
from analysis.diagnosis.learning.closed_forms import Fitting, likely_forms
from analysis.diagnosis.learning.curve_fit import Learned, fit_terms, refine, screen
from analysis.diagnosis.learning.curve_motion import fit_with_motions
from analysis.diagnosis.learning.form_fits import fit_forms, likeliest, refit_resolving_kinks
from analysis.diagnosis.learning.learned_law import FormFit, as_learned
from analysis.inference import Fitted, with_frame_relinearised
from analysis.shot import Cancelled, Progress, Stop

FIRST_PIECES, MAX_PIECES = 12, 96
FIRST_STEPS, _ALL_STEPS = 3, 7  # of a search; the first ones show which arguments may become the likeliest
_FINER_STEPS = 4  # of a fit with twice the pieces, started from the coarser curve
_GO_ON = 6  # arguments that are searched to convergence at most
_FINER_PAYS = 10.0  # fall of the BIC that justifies twice the knots
FOLLOWED = 3  # arguments that are given finer knots
FORMS_FITTED = 6  # of an argument, the nearest to its curve; more if the curve does not distinguish them
_SHORT = 0.2  # of a free curve's gain: forms with a step or a kink may gain this much more
_NEAR, _NEAR_NORMS = 4.0, 200.0  # forms up to this multiple of the nearest squared distance plus this are fitted first


@dataclass(frozen=True, slots=True)
class Discovery:
    """Learned laws, the fit that contains them, its residual, and the predictions of the validation shots.

    ``start`` is the fit without the laws.
    """

    start: Fitted
    laws: tuple[LearnedLaw, ...]
    fitted: Fitted
    residual: Residual
    predictions: Predictions  # without the laws and with them

    @property
    def explains(self) -> bool:
        """Return whether the laws explain the shots down to the noise, each by a closed form that meets its curve."""
        named = all(law.form is not None for law in self.laws)
        return named and self.fitted.converged and not self.residual.significant


def curves_may_beat(beat: float, rough: Sequence[Learned], start: Fitted) -> bool:
    """Return whether further steps of one of these ``rough`` curves may lower the BIC from ``start`` below ``beat``."""
    return any(may_beat(beat, curve.bic, start.bic) for curve in rough)


def forms_may_beat(beat: float, curves: Sequence[Learned], start: Fitted) -> bool:
    """Return whether a closed form in place of one of these curves may lower the BIC from ``start`` below ``beat``."""
    return any(curve.least_form_bic - _SHORT * (start.bic - curve.least_form_bic) < beat for curve in curves)


def learn_law(
    start: Fitted,
    held: tuple[int, ...],
    tell: Progress,
    stop: Stop,
    *,
    beside: LearnedLaw | None = None,
    beat: float = math.inf,
    curves: Sequence[Learned] | None = None,
) -> Discovery | None:
    """Return the law that ``start`` lacks, or None where the shots show none.  Raises Cancelled.

    The validation shots ``held`` are predicted in turn; without any, as of a single shot, a law could not be tested.
    ``beside`` is a law already in ``start``; ``curves`` are those of ``refine_contenders`` where they are known.
    """
    if not held:
        return None
    if curves is None:
        rough = rough_curves(start, tell, stop, beside)
        if not curves_may_beat(beat, rough, start):
            return None
        curves = refine_contenders(start, rough, stop)
    if not forms_may_beat(beat, curves, start):
        return None
    fits = _likeliest_forms(_fitted_forms(start, curves, tell, stop), stop)
    if not fits or fits[0].bic > start.bic - CRITERIA.law_fall:
        return None
    best = fits[0].fitted
    residual = residual_of(best, best.linearise())
    before, after = (predict(f, held, best.noise, stop) for f in (start, best))
    if before is None or after is None or not after.predicts_significantly_better(before):
        return None
    named = _meets(fits[0], curves)
    return Discovery(start, (as_learned(start, fits, named, after, held),), best, residual, (before, after))


def _fitted_forms(start: Fitted, curves: Sequence[Learned], tell: Progress, stop: Stop) -> list[FormFit]:
    """Return the fits of closed forms near the likeliest curves, except near those that no form can make likeliest."""
    fits: list[FormFit] = []
    for place, learned in enumerate(curves[:FOLLOWED]):
        if fits and learned.least_form_bic > min(one.bic for one in fits) + CRITERIA.form_excluded:
            continue
        tell(f"fitting closed forms to the curve of {learned.terms[-1].argument.name}", 0.84 + 0.03 * place)
        forms = likely_forms(learned, FORMS_FITTED)
        near = [form for form in forms if form.distance <= _NEAR * forms[0].distance + _NEAR_NORMS]
        met = _refined(start, learned, near, fits, stop)
        if not any(_meets(one, curves) for one in met):  # distances were to first order
            met += _refined(start, learned, [form for form in forms if form not in near], [*fits, *met], stop)
        fits += met
    return fits


def _likeliest_forms(fits: list[FormFit], stop: Stop) -> list[FormFit]:
    """Return fits, the likeliest first, after continuing those that may be it to convergence."""
    if not fits:
        return []
    fits = sorted(fits, key=lambda one: one.bic)
    within = fits[0].bic + CRITERIA.form_excluded
    ends = side_by_side(lambda one: _converged(one, stop) if one.bic < within else one, fits)
    best = likeliest(ends, lambda one: one.bic, lambda one: (one.form,))
    others = sorted((one for one in ends if one is not best), key=lambda one: one.bic)
    return [replace(best, fitted=refit_resolving_kinks(best.fitted, stop)), *others]


def arguments_of(start: Fitted) -> list[Argument]:
    """Return the arguments that a law added to a fit may have."""
    plate_moves = start.problem.data.base.plate_moves
    return [argument for argument in ARGUMENTS if plate_moves or argument.where != "plate"]


def _meets(one: FormFit, curves: Sequence[Learned]) -> bool:
    """Return whether a closed form is nearly as likely as the best free curve (``form_meets``)."""
    return one.bic < min(curve.bic for curve in curves) + CRITERIA.form_meets


def rough_curves(
    start: Fitted,
    tell: Progress,
    stop: Stop,
    beside: LearnedLaw | None = None,
    *,
    steps: int = FIRST_STEPS,
    where: str = "",
) -> list[Learned]:
    """Fit a curve for every argument that a law missing in ``start`` may have, in a few ``steps``; the best first.

    ``beside`` is a law already in ``start``.  ``where`` restricts the search to laws that act there (see
    ``Argument.where``).  Raises Cancelled.
    """
    known = (beside.where, beside.argument) if beside is not None else None
    arguments = [a for a in arguments_of(start) if (a.where, a.name) != known and where in ("", a.where)]
    try:
        before_law = fit_with_motions(start)
    except Infeasible:  # the missing law made the fitted contact too stiff to compute paths
        return []

    def one(argument: Argument) -> Learned | None:
        if stop():
            raise Cancelled
        tell(f"trying a force as a function of {argument.name}", 0.8)
        try:
            return screen(before_law, argument, FIRST_PIECES, stop, steps=steps)
        except (Infeasible, ValueError, np.linalg.LinAlgError):
            return None

    rough = side_by_side(one, arguments)
    return sorted((curve for curve in rough if curve is not None), key=lambda curve: curve.bic)


def refine_contenders(start: Fitted, rough: Sequence[Learned], stop: Stop) -> list[Learned]:
    """Continue the curves that may become the likeliest to convergence, with as many knots as pay; the best first.

    Returns [] where no closed form may pay.
    """
    found = converge_contenders(start, rough[:_GO_ON], stop)
    ahead = [curve for curve in found[:FOLLOWED] if curve.least_form_bic < start.bic - CRITERIA.law_fall]
    curves = sorted(side_by_side(lambda curve: finer(curve, MAX_PIECES, stop), ahead), key=lambda curve: curve.bic)
    if not curves or curves[0].least_form_bic > start.bic - CRITERIA.law_fall:
        return []
    # A form saves at most the BIC's price of its curve's coefficients: other curves cannot become the likeliest.
    return [curve for curve in curves if curve.least_form_bic < curves[0].bic + CRITERIA.form_excluded]


def converge_contenders(start: Fitted, rough: Sequence[Learned], stop: Stop) -> list[Learned]:
    """Continue those ``rough`` curves (best first) to convergence that may become the likeliest; the best first."""

    def further(learned: Learned) -> Learned:
        try:
            rest = _ALL_STEPS - FIRST_STEPS
            return fit_terms(learned.problem, learned.z, learned.terms, stop, steps=rest)
        except (Infeasible, np.linalg.LinAlgError):
            return learned

    ahead = [one for one in rough if one is rough[0] or may_beat(rough[0].bic, one.bic, start.bic)]
    return sorted(side_by_side(further, ahead), key=lambda curve: curve.bic)


def finer(learned: Learned, most_pieces: int, stop: Stop) -> Learned:
    """Double the knots of a fit's last curve as often as that pays, up to ``most_pieces`` pieces."""
    pieces = FIRST_PIECES
    while 2 * pieces <= most_pieces:
        pieces *= 2
        try:
            trial = refine(learned, pieces, stop, steps=_FINER_STEPS)
        except (Infeasible, ValueError, np.linalg.LinAlgError):
            break
        if trial.bic > learned.bic - _FINER_PAYS:
            break
        learned = trial
    return learned


def _refined(
    start: Fitted, learned: Learned, forms: Sequence[Fitting], known: Sequence[FormFit], stop: Stop
) -> list[FormFit]:
    """Return the fits of closed forms to the shots, where they may come near the best of those ``known``."""
    best = min([learned.bic, *(one.bic for one in known)])
    fits = fit_forms(start, learned, [(form,) for form in forms], stop, beat=best)
    return [FormFit(one, learned, form) for one, form in zip(fits, forms, strict=True) if one is not None]


def _converged(one: FormFit, stop: Stop) -> FormFit:
    """Continue a fit to convergence, with the response to frame motion recomputed given the law."""
    return replace(one, fitted=with_frame_relinearised(one.fitted.continued(stop), stop))

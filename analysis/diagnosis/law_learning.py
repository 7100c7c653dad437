"""A law that the catalogue does not hold, learned from the shots: its argument, its curve, and the form it has.

Every argument is given a free curve (``curve_fit``); the best ones finer knots, until that no longer pays; their curves
are read as closed forms (``closed_forms``), and the nearest forms are fitted to the shots like any effect of the
catalogue, on the same solver, judged by the same tests and on the same held-out shots.  Decided is after that: two
arguments whose curves end in forms are compared as forms.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.closed_forms import Fitting, compress, information
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.cross_validation import Prediction, predict
from analysis.diagnosis.curve_fit import Learned, screen
from analysis.diagnosis.effective_parameters import Point
from analysis.diagnosis.free_parameters import trial_effect
from analysis.diagnosis.hypothesis import Hypothesis
from analysis.diagnosis.hypothesis_fit import Fitted, fit
from analysis.diagnosis.projector import projector
from analysis.diagnosis.residual import Residual, judge
from analysis.diagnosis.result import LearnedLaw, OtherForm
from analysis.laws.arguments import ARGUMENTS, Argument
from analysis.laws.own import LawError, from_key
from analysis.model.least_squares import Infeasible
from analysis.quantity import Quantity
from analysis.shot import Cancelled, Progress, Stop
from analysis.side_by_side import side_by_side

Floats = NDArray[np.float64]
FIRST_PIECES, MOST_PIECES = 12, 96
FINER_PAYS = 10.0  # of the criterion: worth twice the knots
FOLLOWED = 3  # arguments that are given finer knots
FORMS_FITTED = 4  # of an argument, by their distance from its curve
_SHOWN = 81  # points of a curve that is told


@dataclass(frozen=True, slots=True)
class Discovery:
    """A learned law: how it is told, the fit that holds it, what that leaves over, and how the held-out shots fare.

    ``named``: the closed form meets the curve; otherwise it is only the nearest of the forms.
    """

    law: LearnedLaw
    fitted: Fitted
    rest: Residual
    foretold: tuple[Prediction, Prediction]  # without the law and with it
    named: bool

    @property
    def explains(self) -> bool:
        """Return whether the law accounts for everything down to the noise."""
        return self.named and self.fitted.converged and not self.rest.significant


def learn_law(start: Fitted, held: tuple[int, ...], tell: Progress, stop: Stop) -> Discovery | None:
    """Return the law that ``start`` lacks, if the shots show one; Cancelled when asked to stop.

    ``held`` are the shots that are foretold in turn.  A single shot shows no law: it could not be tested.
    """
    if len(start.hypothesis.data.shots) < 2 or not held:
        return None
    one_body = start.hypothesis.data.base.one_body
    arguments = [a for a in ARGUMENTS if not (one_body and a.where == "plate")]
    curves = _screened(start, arguments, tell, stop)
    if not curves or curves[0].bic > start.bic - CRITERIA.law_fall:
        return None
    fits: list[tuple[Fitted, Learned, Fitting]] = []
    for place, learned in enumerate(curves[:FOLLOWED]):
        tell(f"reading the curve of the {_argument(learned).name}", 0.84 + 0.03 * place)
        forms = [form for form in compress(learned) if form.form.bent or form.form.name != "constant"][:FORMS_FITTED]
        fits += [(f, learned, form) for f, form in _refined(start, learned, forms, stop)]
    if not fits:
        return None
    fits.sort(key=lambda one: one[0].bic)
    best, learned, fitting = fits[0]
    if best.bic > start.bic - CRITERIA.law_fall:
        return None
    at = projector(best)
    rest = judge(best, at)
    before, after = (predict(f, held, best.floor, stop) for f in (start, best))
    if before is None or after is None or not after.beats(before):
        return None
    named = best.bic < min(curve.bic for curve in curves) + CRITERIA.form_meets
    law = _told(start, best, learned, fitting, fits, named, after, held)
    return Discovery(law, best, rest, (before, after), named)


def _argument(learned: Learned) -> Argument:
    return learned.terms[-1].argument


def _screened(start: Fitted, arguments: Sequence[Argument], tell: Progress, stop: Stop) -> list[Learned]:
    """Return the curves that explain most, best first, those in front with the knots they ask for."""

    def one(argument: Argument, pieces: int = FIRST_PIECES) -> Learned | None:
        if stop():
            raise Cancelled
        tell(f"trying a force of the {argument.name}", 0.8)
        try:
            return screen(start, argument, pieces, stop)
        except (Infeasible, ValueError, np.linalg.LinAlgError):
            return None

    def finer(learned: Learned) -> Learned:
        pieces = FIRST_PIECES
        while 2 * pieces <= MOST_PIECES:
            pieces *= 2
            trial = one(_argument(learned), pieces)
            if trial is None or trial.bic > learned.bic - FINER_PAYS:
                break
            learned = trial
        return learned

    found = [curve for curve in side_by_side(one, arguments) if curve is not None]
    found.sort(key=lambda curve: curve.bic)
    ahead = [curve for curve in found[:FOLLOWED] if curve.bic < start.bic - CRITERIA.law_fall]
    return sorted(side_by_side(finer, ahead), key=lambda curve: curve.bic)


def _refined(start: Fitted, learned: Learned, forms: Sequence[Fitting], stop: Stop) -> list[tuple[Fitted, Fitting]]:
    """Return the fits of closed forms to the shots."""
    base = start.hypothesis.unpack(learned.z)

    def one(form: Fitting) -> tuple[Fitted, Fitting] | None:
        try:
            law = form.form.law(_argument(learned), form.parameters, _span(learned))
            kind = trial_effect(law.effect)
            hypothesis = Hypothesis(start.hypothesis.data, (*start.hypothesis.effects, kind), start.hypothesis.fixed)
            values = tuple({**v, kind.name: dict(kind.starts[0])} for v in base.values)
            z = hypothesis.pack(Point(base.base, base.own, values))
            return fit(hypothesis, z, learned.floor, evaluations=40, cancelled=stop), form
        except (Infeasible, LawError, np.linalg.LinAlgError):
            return None

    return [found for found in side_by_side(one, forms) if found is not None]


def _span(learned: Learned) -> float:
    knots = learned.terms[-1].basis.knots
    return max(abs(knots[0]), abs(knots[-1]))


def _told(
    start: Fitted,
    best: Fitted,
    learned: Learned,
    fitting: Fitting,
    fits: Sequence[tuple[Fitted, Learned, Fitting]],
    named: bool,
    after: Prediction,
    held: tuple[int, ...],
) -> LearnedLaw:
    """Return the law as it is told."""
    argument, term = _argument(learned), learned.terms[-1]
    low, high = term.basis.knots[0], term.basis.knots[-1]
    at = np.linspace(low, high, _SHOWN)
    design = term.basis.design(at)
    known = np.linalg.pinv(information(learned, len(learned.terms) - 1) + learned.penalty_of(-1), hermitian=True)
    std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", design, known, design), 0.0))
    key = best.names[-1]
    law = from_key(key)
    values = best.point.values[0][key]
    places = {
        free.name: best.hypothesis.offset + k
        for k, (name, free, _) in enumerate(best.hypothesis.free_parameters)
        if name == key
    }
    parameters = {
        p.name: (Quantity(values[p.name], float(best.std[places[p.name]]), "fit of the law"), p.unit)
        for p in law.parameters
    }
    others = [
        OtherForm(
            _argument(of).where,
            _argument(of).name,
            f.form.name,
            f.form.formula(_argument(of)).text,
            trial.bic - best.bic,
        )
        for trial, of, f in fits[1:]
        if trial.bic < best.bic + CRITERIA.form_excluded and trial.names[-1] != key
    ]
    measured = [best.hypothesis.data.shots[i] for i in held]
    white = [
        best.floor.whiten((s.displacement_m - s.averaged(x))[:, None], s.valid, s.weight)
        for s, x in zip(measured, after.displacement_m, strict=True)
    ]
    chi2 = float(sum(np.sum(w**2) for w in white) / sum(w.size for w in white))
    return LearnedLaw(
        name=key,
        where=argument.where,
        argument=argument.name,
        form=fitting.form.name if named else None,
        formula=fitting.form.formula(argument).text if named else None,
        nearest_form=fitting.form.name,
        parameters=parameters if named else {},
        other_forms=tuple(others),
        same_by_gauge=(argument.unseen,) if argument.unseen else (),
        curve_argument=at,
        curve_unit=argument.unit,
        curve_force_n=term.curve(at),
        curve_std_n=std,
        visited=(low, high),
        not_observable=tuple(filter(None, (argument.unseen, "any part outside the range visited"))),
        evidence={
            "delta_bic": best.bic - start.bic,
            "held_out_chi2": chi2,
            "degrees_of_freedom": learned.freedom,
        },
    )

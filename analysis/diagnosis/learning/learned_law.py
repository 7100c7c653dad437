"""Results of a learned law: its parameters, its curve with uncertainty, and the forms that the shots cannot exclude."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision import Argument, UserLaw
from analysis.diagnosis.evidence.cross_validation import Prediction
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import LearnedLaw, OtherForm
from analysis.diagnosis.learning.closed_forms import Fitting, gauge, information
from analysis.diagnosis.learning.curve_fit import Learned
from analysis.inference import Fitted
from analysis.shot import Floats, Quantity

_SHOWN = 81  # points of the curve
_SAME = 1e-3  # of the largest force that the base model lacks: curves that differ by less are the same function


@dataclass(frozen=True, slots=True)
class FormFit:
    """A closed form fitted to the shots, and the curve that it replaces: the last one of ``learned``.

    ``place`` is the index of the law among the effects of ``fitted``.
    """

    fitted: Fitted
    learned: Learned
    form: Fitting
    place: int = -1

    @property
    def bic(self) -> float:
        """Get the BIC, by which forms are compared."""
        return self.fitted.bic

    @property
    def law(self) -> UserLaw:
        """Get the law in the model."""
        law = self.fitted.effects[self.place]
        assert isinstance(law, UserLaw)
        return law

    def curve(self, at: Floats) -> Floats:
        """Return the form's curve in N at arguments ``at``, any shape."""
        return self.form.form.values(at, dict(self.fitted.point.values[0][self.law]))


def as_learned(
    start: Fitted, fits: Sequence[FormFit], named: bool, after: Prediction, held: tuple[int, ...]
) -> LearnedLaw:
    """Return the law of the first of ``fits`` (best first) with its curve; the others are its alternative forms."""
    best = fits[0]
    learned, fitted = best.learned, best.fitted
    term = learned.terms[-1]
    argument = term.argument
    low, high = term.basis.knots[0], term.basis.knots[-1]
    at = np.linspace(low, high, _SHOWN)
    design = term.basis.design(at)
    last = slice(-term.basis.count, None)
    known = np.linalg.pinv(information(learned) + learned.penalty[last, last], hermitian=True)
    std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", design, known, design), 0.0))
    shown = best.curve(at)
    near = [one for one in fits[1:] if one.bic < best.bic + CRITERIA.form_excluded and one.law != best.law]
    others = [_other(one, best, at, shown) for one in near]
    new_n = part_beyond_base(argument, at, shown)
    twins = [other for other in others if is_same_function(other, shown, new_n)]
    curve = term.curve(at)
    return LearnedLaw(
        effect=best.law,
        where=argument.where,
        argument=argument.name,
        form=best.form.form.name if named else None,
        formula=best.law.formula.text if named else None,
        nearest_form=best.form.form.name,
        parameters=_parameters(best.law, fitted) if named else {},
        other_forms=tuple(other for other in others if not is_same_function(other, shown, new_n)),
        same_by_gauge=tuple(
            filter(None, (argument.unseen, *(f"{t.form}, {t.formula}: the same over the range covered" for t in twins)))
        ),
        curve_argument=at,
        curve_unit=argument.unit,
        curve_force_n=_as(curve, shown, gauge(argument, at), std),
        curve_std_n=std,
        visited=(low, high),
        not_observable=tuple(filter(None, (argument.unseen, "any part outside the range covered"))),
        evidence={
            "delta_bic": best.bic - start.bic,
            "held_out_chi2": _held_out_chi2(fitted, after, held),
            "degrees_of_freedom": learned.freedom,
        },
        form_force_n=shown,
    )


def in_joint_fit(law: LearnedLaw, beside: Fitted, named: bool) -> LearnedLaw:
    """Return a law with its parameters from the joint fit ``beside``, which contains other laws or effects as well."""
    if not named:
        return law
    formula = law.effect.formula.text
    return replace(law, form=law.nearest_form, formula=formula, parameters=_parameters(law.effect, beside))


def _parameters(law: UserLaw, fitted: Fitted) -> dict[str, tuple[Quantity, str]]:
    values = fitted.point.values[0][law]
    std = fitted.with_marginal_covariance().std
    places = {
        free.name: fitted.problem.offset + k
        for k, (effect, free, _) in enumerate(fitted.problem.free_parameters)
        if effect == law
    }
    return {
        p.name: (Quantity(values[p.name], float(std[places[p.name]]), "fit of the law"), p.unit) for p in law.parameters
    }


def _other(one: FormFit, best: FormFit, at: Floats, shown: Floats) -> OtherForm:
    argument = one.learned.terms[-1].argument
    same = argument is best.learned.terms[-1].argument
    curve = _as(one.curve(at), shown, gauge(argument, at), np.ones(at.size)) if same else None
    form = one.form.form
    return OtherForm(argument.where, argument.name, form.name, form.formula(argument).text, one.bic - best.bic, curve)


def part_beyond_base(argument: Argument, at: Floats, shown: Floats) -> Floats:
    """Return the part of a curve that the base model lacks: a nearly linear law may be almost entirely k_N."""
    return _as(shown, np.zeros(at.size), gauge(argument, at), np.ones(at.size))


def is_same_function(other: OtherForm, shown: Floats, new_n: Floats) -> bool:
    """Return whether another form is the same curve over the range visited, as y|y| is y^2 where y has one sign.

    ``shown`` is the curve, ``new_n`` the part of it that the base model lacks, by which forms differ.
    """
    if other.curve_force_n is None:
        return False
    return bool(np.max(np.abs(other.curve_force_n - shown)) <= _SAME * float(np.max(np.abs(new_n))))


def _as(curve: Floats, shown: Floats, columns: Floats, std: Floats) -> Floats:
    """Return a curve moved as close to ``shown`` as possible by ``columns`` that the base model can absorb."""
    if not columns.shape[1]:
        return curve
    weight = 1.0 / np.maximum(std, 1e-3 * float(std.max()) or 1.0)
    scale = np.maximum(np.linalg.norm(columns * weight[:, None], axis=0), 1e-300)
    moved = np.linalg.lstsq(columns * weight[:, None] / scale, (curve - shown) * weight, rcond=None)[0] / scale
    return np.asarray(curve - columns @ moved)


def _held_out_chi2(fitted: Fitted, after: Prediction, held: tuple[int, ...]) -> float:
    measured = [fitted.problem.data.shots[i] for i in held]
    white = [
        s.whitened(fitted.noise, s.left_m(s.averaged(x))[:, None])
        for s, x in zip(measured, after.displacement_m, strict=True)
    ]
    return float(sum(np.sum(w**2) for w in white) / sum(w.size for w in white))

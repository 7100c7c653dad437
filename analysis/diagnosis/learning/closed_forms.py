"""Fit closed forms to a free curve, within the uncertainty that the shots leave in the curve.

The distance of a form from the curve is measured with the curvature of the likelihood in the curve's coefficients, base
and starts eliminated.  Curves that the base model already contains (a law linear in the deflection is k_p) cost
nothing: they are columns of their own, fitted jointly with every form.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from analysis.collision import FORMS, Argument, Form
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.learning.curve_fit import Learned
from analysis.diagnosis.learning.curve_motion import places_of
from analysis.inference import orthonormal
from analysis.shot import Floats

_BEYOND = 1e60  # a form of size 1 with larger values is rejected
_FINE = 12  # samples per piece of the basis, for the projection of a form onto the splines


@dataclass(frozen=True, slots=True)
class Fitting:
    """A form fitted to a curve: its parameters, its squared distance in units of the noise, and the base's step.

    ``base_step``, shape (z,), moves base and starts to where, to first order, they fit the shots best with the form in
    place of the curve.  The base thereby takes over the part of the curve that it can describe.
    """

    form: Form
    parameters: dict[str, float]
    distance: float
    base_step: Floats

    def cost(self, samples: int) -> float:
        """Return the squared distance plus the price of the form's parameters in the BIC."""
        return self.distance + (1 + len(self.form.nonlinear_parameters)) * float(np.log(samples))


def fit_closed_forms(learned: Learned) -> list[Fitting]:
    """Fit every closed form to the last curve of a fit; return them in the order of ``Fitting.cost``."""
    term = learned.terms[-1]
    knots = np.array(term.basis.knots)
    fine = np.unique(np.concatenate([np.linspace(a, b, _FINE) for a, b in itertools.pairwise(knots)]))
    into = np.asarray(np.linalg.pinv(term.basis.design(fine)), dtype=np.float64)  # maps ``fine`` to coefficients
    weights, directions = np.linalg.eigh(information(learned))
    root: Floats = np.asarray((directions * np.sqrt(np.maximum(weights, 0.0))).T)  # coefficients to units of the noise
    target = root @ term.coefficients
    columns = root @ (into @ gauge(term.argument, fine))
    basis = orthonormal(columns) if columns.shape[1] else columns
    target = target - basis @ (basis.T @ target)

    def seen(curve: Floats) -> Floats:
        row = root @ (into @ curve)
        return np.asarray(row - basis @ (basis.T @ row))

    low, high = float(knots[0]), float(knots[-1])
    laid = [(form, *_laid(form, fine, seen, target, low, high)) for form in FORMS if is_distinct_over(form, low, high)]
    toll = _toll(learned)
    found = [
        Fitting(form, values, distance, toll @ (into @ form.values(fine, values) - term.coefficients))
        for form, values, distance in laid
    ]
    return sorted(found, key=lambda one: one.cost(learned.samples))


def likely_forms(learned: Learned, most: int) -> list[Fitting]:
    """Return the forms of a law nearest to the last curve, the nearest first.

    There are ``most`` of them, or more if the curve does not distinguish them: a faint law's curve may be near ten.
    """
    argument = learned.terms[-1].argument
    forms = [form for form in fit_closed_forms(learned) if is_outside_base(form.form, argument)]
    within = forms[0].cost(learned.samples) + CRITERIA.form_excluded
    alike = sum(form.cost(learned.samples) < within for form in forms)
    return forms[: max(most, alike)]


def is_outside_base(form: Form, argument: Argument) -> bool:
    """Return whether a form is not in the base model: a constant is new only as a force while the bodies touch."""
    return form.name != "constant" or (argument.where == "contact" and not argument.factor)


def _toll(learned: Learned) -> Floats:
    """Return the step of base and starts per change of each coefficient of the last curve, shape (z, count)."""
    of_all, size = np.arange(learned.curvature.size), learned.z.size
    return learned.curvature.followed(of_all[places_of(learned.terms, size)[-1]], of_all < size)[:size]


def information(learned: Learned) -> Floats:
    """Return the shots' information on the last curve's coefficients, all else eliminated, shape (count, count)."""
    of_all = np.arange(learned.curvature.size)
    mine = of_all[places_of(learned.terms, learned.z.size)[-1]]
    followed = learned.curvature.followed(mine, ~np.isin(of_all, mine))
    left = np.stack([(learned.curvature @ moves)[mine] for moves in followed.T])
    return np.asarray(0.5 * (left + left.T))


def gauge(argument: Argument, at: Floats) -> Floats:
    """Return curves of ``argument`` that the base model already contains, at ``at``, shape (n,): shape (n, k)."""
    if argument.where == "block" and argument.name == "place":
        inside = (at < 0).astype(np.float64)  # in contact: a constant moves the rest position, a slope is k_p
        return np.column_stack([inside, inside * at])
    columns = {"1": np.ones_like(at), "x": at}
    return np.column_stack([columns[name] for name in argument.gauge]) if argument.gauge else np.zeros((at.size, 0))


def is_distinct_over(form: Form, low: float, high: float) -> bool:
    """Return whether a form is distinct over a range: on one side of zero, some forms are the same function."""
    one_sided = low > -0.02 * high or high < -0.02 * low
    twins = ("quadratic, odd", "power, odd", "falling exponential" if high > -low else "rising exponential")
    return not (one_sided and form.name in twins)


def _laid(form: Form, fine: Floats, seen, target: Floats, low: float, high: float) -> tuple[dict[str, float], float]:  # type: ignore[no-untyped-def]
    """Return the parameters with which a form is nearest to the curve, and its squared distance."""
    span = max(abs(low), abs(high))
    names = form.nonlinear_parameters
    unit = np.array([1.0 if name in form.powers else span for name in names])

    def values_at(u: Floats) -> dict[str, float]:
        each = zip(names, u, unit, strict=True)
        return {name: float(np.exp(v) * span if name in form.positive else v * w) for name, v, w in each}

    def size_and_rest(u: Floats) -> tuple[float, Floats]:
        with np.errstate(all="ignore"):
            curve = form.values(fine, {"a": 1.0, **values_at(u)})
        if not np.all(np.abs(curve) < _BEYOND):
            return 0.0, target
        row = seen(curve)
        square = float(row @ row)
        a = float(row @ target) / square if square > 0 else 0.0
        return a, target - a * row

    if not names:
        a, rest = size_and_rest(np.zeros(0))
        return {"a": a}, float(rest @ rest)
    begins = []
    for start in form.starts(low, high):
        u = np.array(
            [np.log(start[n] / span) if n in form.positive else start[n] / w for n, w in zip(names, unit, strict=True)]
        )
        rest = size_and_rest(u)[1]
        begins.append((float(rest @ rest), u))
    bounds = _bounds(form, names, low, high, span)
    ends = []
    for _, u in sorted(begins, key=lambda begin: begin[0])[:3]:
        inside = np.clip(u, bounds[0] + 1e-9, bounds[1] - 1e-9)
        ends.append(
            least_squares(lambda v: size_and_rest(v)[1], inside, bounds=bounds, xtol=1e-10, ftol=1e-12, max_nfev=60)
        )
    best = min(ends, key=lambda end: end.cost)
    return {"a": size_and_rest(best.x)[0], **values_at(best.x)}, 2 * float(best.cost)


def _bounds(form: Form, names: tuple[str, ...], low: float, high: float, span: float) -> tuple[Floats, Floats]:
    lower, upper = [], []
    for name in names:
        if name in form.positive:
            lower.append(np.log(1e-4))
            upper.append(np.log(1e2))
        elif name in form.powers:
            lower.append(-7.0 if form.name == "sine" else 0.1)
            upper.append(7.0 if form.name == "sine" else 10.0)
        else:
            lower.append(low / span - 0.1)
            upper.append(high / span + 0.1)
    return np.array(lower), np.array(upper)

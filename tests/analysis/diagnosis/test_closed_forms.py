"""A closed form in place of a learned curve: how far it lies from it, and what base and starts take over."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis, graded_basis
from analysis.collision.laws.forms import FORMS, Form
from analysis.diagnosis.learning.closed_forms import _bounds, _laid, fit_closed_forms, information, likely_forms
from analysis.diagnosis.learning.curve_fit import Learned
from analysis.diagnosis.learning.curve_motion import Term
from analysis.inference.model.normal_matrix import NormalMatrix

BEND = next(one for one in ARGUMENTS if one.name == "bend against motion")  # the base model holds no part of it
UNITS = np.array([1.0, 1e-7, 1e6])  # of base and starts, as far apart as m and N/m


def _learned(curve: NDArray[np.float64], known: float) -> Any:
    """Return a curve at 60 points from 0 to 2 mm whose coefficients the shots know ``known`` times as well as one."""
    basis = Basis(tuple(np.linspace(0.0, 2e-3, 6)))
    coefficients = np.linalg.lstsq(basis.design(np.linspace(0.0, 2e-3, 60)), curve, rcond=None)[0]
    curvature = NormalMatrix.of(np.diag([1.0, *np.full(basis.count, known**2)]))
    return SimpleNamespace(z=np.zeros(1), terms=(Term(BEND, basis, coefficients),), curvature=curvature, samples=400)


def test_forms_that_the_shots_do_not_tell_apart_are_all_fitted() -> None:
    """Six were, and the true law of a faint magnet was the seventh."""
    falling = 1e-3 * np.exp(-np.linspace(0.0, 2e-3, 60) / 5e-4)
    sure, faint = (likely_forms(_learned(falling, known), 2) for known in (1e7, 5e3))
    assert [form.form.name for form in sure] == ["exponential", "Yukawa"]  # the one with a number more
    assert len(faint) > 6 and "inverse square" in [form.form.name for form in faint]


def test_base_and_starts_take_over_what_they_can_of_the_difference_whatever_their_units() -> None:
    basis = Basis(tuple(np.linspace(0.0, 2e-3, 6)))
    argument = np.linspace(0.0, 2e-3, 60)
    design = basis.design(argument)
    cubic = 1e6 * argument**3 + 2.0 * argument
    coefficients = np.asarray(np.linalg.lstsq(design, cubic, rcond=None)[0], dtype=np.float64)
    random = np.random.default_rng(2)
    by_base = random.normal(size=(400, 3))
    by_curve = random.normal(size=(400, basis.count)) + by_base @ random.normal(size=(3, basis.count))
    whole = np.hstack([by_base / UNITS, by_curve])  # the shots' displacement by every number
    term = Term(BEND, basis, coefficients)
    curvature = NormalMatrix.of(whole.T @ whole)
    learned: Any = SimpleNamespace(z=np.zeros(3), terms=(term,), curvature=curvature, samples=400)

    linear = next(found for found in fit_closed_forms(learned) if found.form.name == "linear")
    as_splines = np.linalg.lstsq(design, linear.form.values(argument, linear.parameters), rcond=None)[0]
    difference = by_curve @ (as_splines - coefficients)
    taken = -np.linalg.lstsq(by_base, difference, rcond=None)[0]
    assert linear.base_step == pytest.approx(taken * UNITS, rel=1e-6)
    left = difference + by_base @ taken
    assert linear.distance == pytest.approx(left @ left, rel=1e-6)


@pytest.mark.parametrize(("sign", "name"), [(1, "hinge"), (-1, "hinge below")])
@pytest.mark.parametrize("place_m", [1e-4, 1e-3, 1.9e-3])
def test_a_place_is_looked_for_all_over_the_range_that_was_visited(sign: int, name: str, place_m: float) -> None:
    """A stop that only the deepest shot touches lies near the end of what was visited."""
    visited = sign * np.linspace(0.0, 2e-3, 400)
    basis = Basis(tuple(np.sort(sign * np.linspace(0.0, 2e-3, 6))))
    force = 50.0 * np.maximum(0.0, np.abs(visited) - place_m)
    coefficients = np.linalg.lstsq(basis.design(visited), force, rcond=None)[0]
    curvature = NormalMatrix.of(np.diag([1.0, *np.full(basis.count, 1e14)]))
    learned: Any = SimpleNamespace(
        z=np.zeros(1), terms=(Term(BEND, basis, coefficients),), curvature=curvature, samples=400
    )
    found = next(one for one in fit_closed_forms(learned) if one.form.name == name)
    assert found.parameters["c"] == pytest.approx(sign * place_m, abs=2e-5)


OF_FORMS = {  # parameters of curves over [-1, 2]
    "power": {"n": 2.5}, "power, odd": {"n": 0.7}, "exponential": {"b": 0.3}, "rising exponential": {"b": 1.4},
    "falling exponential": {"b": 0.9}, "inverse": {"b": 0.5}, "inverse square": {"b": 0.8},
    "inverse power": {"b": 0.6, "n": 3.0}, "Yukawa": {"b": 1.2, "c": 0.4}, "Gaussian": {"b": 0.7},
    "Gaussian off zero": {"b": 0.4, "c": 1.1}, "Lorentzian": {"b": 0.6}, "Lorentzian off zero": {"b": 0.5, "c": -0.4},
    "tanh": {"b": 0.5}, "saturating": {"b": 0.8}, "sine": {"b": 0.5, "c": 0.4}, "hinge": {"c": 0.7},
    "hinge below": {"c": 0.2},
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
@pytest.mark.parametrize("span", [1.0, 1e-3])
def test_a_curve_that_is_a_form_is_that_form_with_its_numbers(form: Form, span: float) -> None:
    """Whatever the unit of the argument, and with every sample known by itself."""
    fine = np.linspace(-span, 2.0 * span, 240)
    truth = {
        name: value if name in form.powers else value * span for name, value in OF_FORMS.get(form.name, {}).items()
    }
    curve = form.values(fine, {"a": -3.0, **truth})
    found, distance = _laid(form, fine, lambda values: values, curve, -span, 2.0 * span)
    assert distance < 1e-12 * float(curve @ curve)
    np.testing.assert_allclose(form.values(fine, found), curve, atol=1e-5 * np.abs(curve).max())
    if form.name not in ("Yukawa", "sine"):  # whose two lengths are nearly one, and which turns round by half a turn
        assert found == pytest.approx({"a": -3.0, **truth}, rel=1e-4)


def test_the_distance_of_a_form_is_that_of_the_nearest_with_any_size() -> None:
    """Of a form that does not meet the curve: the least of a grid of its lengths, each at its best size."""
    form = next(one for one in FORMS if one.name == "Gaussian")
    fine = np.linspace(-1.0, 1.0, 100)
    curve, weight = np.exp(-np.abs(fine) / 0.3), np.linspace(0.5, 2.0, 100)
    _, distance = _laid(form, fine, lambda values: weight * values, weight * curve, -1.0, 1.0)

    def left(b: float) -> float:
        row = weight * form.values(fine, {"a": 1.0, "b": b})
        return float(np.sum((weight * curve - row * (row @ (weight * curve)) / (row @ row)) ** 2))

    assert distance == pytest.approx(min(left(b) for b in np.geomspace(0.05, 2.0, 2000)), rel=1e-4)


def test_the_numbers_of_a_form_are_sought_where_a_law_may_have_them() -> None:
    by_name = {form.name: form for form in FORMS}

    def bounds(name: str) -> list[tuple[float, float]]:
        form = by_name[name]
        lower, upper = _bounds(form, form.nonlinear_parameters, -1.0, 3.0, 3.0)
        return list(zip(lower.tolist(), upper.tolist(), strict=True))

    length = (pytest.approx(np.log(1e-4)), pytest.approx(np.log(1e2)))  # of the span
    place = (pytest.approx(-1 / 3 - 0.1), pytest.approx(1.1))
    assert bounds("inverse power") == [length, (0.1, 10.0)]
    assert bounds("sine") == [length, (-7.0, 7.0)] and bounds("Gaussian off zero") == [length, place]
    assert bounds("hinge") == [place]


@pytest.mark.parametrize("which", [0, 1])
def test_each_of_two_curves_is_read_beside_the_other(which: int) -> None:
    """Against both fitted together: what a form in one place leaves once base and the other curve have given way."""
    random = np.random.default_rng(5)
    bases = graded_basis(0.0, 1.0, 5), graded_basis(0.0, 2.0, 4)
    terms = [Term(BEND, basis, random.standard_normal(basis.count)) for basis in bases]
    size = 2 + sum(basis.count for basis in bases)
    whole = random.standard_normal((200, size))
    curvature = NormalMatrix.of(whole.T @ whole)
    problem: Any = SimpleNamespace(data=SimpleNamespace(shots=[SimpleNamespace(valid=np.ones(200, np.bool_))]))
    free = np.zeros((size - 2, size - 2))
    learned = Learned(problem, tuple(terms), np.zeros(2), (), 0.0, curvature, free, 5.0).with_last(which)
    found = fit_closed_forms(learned)
    assert [one.cost(200) for one in found] == sorted(one.cost(200) for one in found)
    linear = next(one for one in found if one.form.name == "linear")
    assert linear.cost(200) == pytest.approx(linear.distance + np.log(200))
    power = next(one for one in found if one.form.name == "power")
    assert power.cost(200) == pytest.approx(power.distance + 2 * np.log(200))
    begin = 2 + (bases[0].count if which else 0)
    mine = np.arange(begin, begin + bases[which].count)
    at = np.linspace(*np.array(bases[which].knots)[[0, -1]], 400)
    design = bases[which].design(at)
    (fitted,) = np.linalg.lstsq(design, at, rcond=None)[0][None]  # a line, in these splines
    others = np.setdiff1d(np.arange(size), mine)
    columns = np.column_stack([whole[:, mine] @ fitted, whole[:, others]])
    target = whole[:, mine] @ terms[which].coefficients
    numbers, (square,), *_ = np.linalg.lstsq(columns, target, rcond=None)
    assert linear.parameters["a"] == pytest.approx(numbers[0], rel=1e-6)
    assert linear.distance == pytest.approx(square, rel=1e-6)
    known = whole[:, mine] - whole[:, others] @ np.linalg.lstsq(whole[:, others], whole[:, mine], rcond=None)[0]
    np.testing.assert_allclose(information(learned), known.T @ known, rtol=1e-8, atol=1e-8)


def test_so_many_forms_are_likely_as_are_asked_for_or_as_cannot_be_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.diagnosis.learning import closed_forms as module

    costs = {"constant": -1.0, "a": 0.0, "b": 9.9, "c": 10.1, "d": 11.0}
    forms = [SimpleNamespace(form=SimpleNamespace(name=name), cost=lambda n, c=c: c + n) for name, c in costs.items()]
    asked: list[Any] = []
    monkeypatch.setattr(module, "fit_closed_forms", lambda learned: asked.append(learned) or forms)
    learned: Any = SimpleNamespace(terms=(None, SimpleNamespace(argument=BEND)), samples=100)

    def likely(most: int) -> list[str]:
        return [one.form.name for one in likely_forms(learned, most)]

    assert likely(1) == ["a", "b"] and likely(3) == ["a", "b", "c"] and asked == [learned, learned]

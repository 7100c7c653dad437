"""Closed forms: which are distinct over a range, and their starting values."""

import math

import numpy as np
import pytest

from analysis.collision.laws.arguments import ARGUMENTS, Argument
from analysis.collision.laws.forms import FORMS, Form
from analysis.diagnosis.learning.closed_forms import is_distinct_over

AT = np.linspace(0.01, 1.0, 40)


def form(name: str) -> Form:
    return next(one for one in FORMS if one.name == name)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_of_forms_that_are_one_function_on_a_side_of_zero_one_is_tried(side: float) -> None:
    low, high = sorted((0.0, side))
    tried = [one for one in FORMS if is_distinct_over(one, low, high)]
    values = {"a": 1.0, "b": 0.4, "c": 0.3, "n": 1.5}
    curves = {one.name: one.values(side * AT, values) for one in tried if one.positive == ("b",) and not one.powers}
    assert {"exponential", "rising exponential" if side > 0 else "falling exponential"} <= curves.keys()
    names = list(curves)
    same = [(p, q) for p in names for q in names if p < q and np.allclose(np.abs(curves[p]), np.abs(curves[q]))]
    assert same == []


@pytest.mark.parametrize("name", ["Gaussian off zero", "Lorentzian off zero"])
def test_a_narrow_bump_lies_near_where_its_search_begins(name: str) -> None:
    low, high, width = -3e-3, 4e-3, 3e-4
    for place in np.linspace(-2.5e-3, 3.5e-3, 30):
        begins = form(name).starts(low, high)
        assert any(abs(s["c"] - place) <= width and width / 2 <= s["b"] <= 2 * width for s in begins)


PLACE, SPEED, TIMES, OVERLAP = (
    next(one for one in ARGUMENTS if one.name == name)
    for name in ("place", "speed one way", "bend times rate", "overlap")
)


@pytest.mark.parametrize(
    ("name", "argument", "unit"),
    [
        ("constant", OVERLAP, "N"), ("linear", PLACE, "N/m"), ("quadratic", PLACE, "N/m²"), ("cubic", PLACE, "N/m³"),
        ("hinge", PLACE, "N/m"), ("exponential", PLACE, "N"), ("linear", SPEED, "N s/m"), ("cubic", SPEED, "N s³/m³"),
        ("power, odd", PLACE, "N per (argument)^n"), ("quadratic", TIMES, "N/m² s/m"), ("tanh", TIMES, "N s/m"),
    ],
)  # fmt: skip
def test_the_size_of_a_form_has_its_unit(name: str, argument: Argument, unit: str) -> None:
    made = form(name)
    law = made.law(argument, dict.fromkeys(("a", "b", "c", "n"), 1e-5), 1.0)
    units = {parameter.name: parameter.unit for parameter in law.parameters}
    assert units["a"] == unit
    assert {units[n] for n in made.lengths} <= {argument.unit} and {units[n] for n in made.powers} <= {""}
    assert law.where == argument.where and tuple(units) == ("a", *made.nonlinear_parameters)


def test_a_form_is_the_law_of_its_formula_with_its_factor() -> None:
    for made in FORMS:
        names = ("a", *made.nonlinear_parameters)
        values = dict(zip(names, (2.0, 0.4, 0.3), strict=False))
        formula = made.formula(TIMES)
        assert formula.parameters == names
        state = {"y": AT, "u": 3.0}
        np.testing.assert_allclose(formula.values(state, values), 3.0 * made.values(AT, values), rtol=1e-12)
        np.testing.assert_allclose(made.values(AT, values | {"a": 4.0}), 2 * made.values(AT, values), rtol=1e-12)
        assert made.values(AT, values).shape == AT.shape


def test_forms_mean_what_their_names_say() -> None:
    values = {"a": 2.0, "b": 0.5, "c": 0.25, "n": 1.5}
    x = np.array([-1.0, 0.5])
    expected = {
        "constant": [2, 2], "linear": [-2, 1], "quadratic": [2, 0.5], "quadratic, odd": [-2, 0.5], "cubic": [-2, 0.25],
        "power": [2, 2 * 0.5**1.5], "power, odd": [-2, 2 * 0.5**1.5], "exponential": 2 * np.exp([-2.0, -1.0]),
        "rising exponential": 2 * np.exp([-2.0, 1.0]), "falling exponential": 2 * np.exp([2.0, -1.0]),
        "inverse": [2 / 3, 1], "inverse square": [2 / 9, 0.5], "inverse power": [2 / 3**1.5, 2 / 2**1.5],
        "Yukawa": 2 * np.exp([-2.0, -1.0]) / [5, 3], "Gaussian": 2 * np.exp([-4.0, -1.0]),
        "Gaussian off zero": 2 * np.exp([-6.25, -0.25]), "Lorentzian": [0.4, 1], "Lorentzian off zero": [2 / 7.25, 1.6],
        "tanh": 2 * np.tanh([-2.0, 1.0]), "saturating": [-2 / 1.5, 1], "sine": 2 * np.sin([-1.75, 1.25]),
        "hinge": [0, 0.5], "hinge below": [2.5, 0],
    }  # fmt: skip
    assert {made.name for made in FORMS} == set(expected)
    for made in FORMS:
        np.testing.assert_allclose(made.values(x, values), expected[made.name], rtol=1e-12, err_msg=made.name)


def test_a_law_begins_within_its_bounds_whatever_its_curve_was() -> None:
    far = form("inverse power").law(PLACE, {"a": 0.0, "b": 1e9, "n": 99.0}, 2.0)
    near = form("inverse power").law(PLACE, {"a": -3.0, "b": 1e-9, "n": 0.0}, 2.0)
    a, b, n = far.parameters
    assert (a.tried, b.tried, n.tried) == ((1e-12,), (1e3,), (11.0,))
    assert [one.tried[0] for one in near.parameters] == [-3.0, 4e-5, 0.1]
    assert (b.lower, b.upper, n.lower, n.upper) == (2e-5, 2e3, 0.05, 12.0) and a.upper == math.inf


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_the_strength_of_a_form_grows_as_the_power_of_the_argument_that_it_multiplies(form: Form) -> None:
    """In another unit of length: all lengths a thousand times as large, powers and angles as they were."""
    z = np.linspace(-2.0, 3.0, 41)
    values = {name: 0.4 + 0.3 * k for k, name in enumerate(form.nonlinear_parameters)}
    larger = {name: 1e3 * value if name in form.lengths else value for name, value in values.items()}
    power = values[form.argument_power] if isinstance(form.argument_power, str) else form.argument_power
    one, other = form.values(z, {"a": 2.0} | values), form.values(1e3 * z, {"a": 2.0} | larger)
    np.testing.assert_allclose(other, 1e3**power * one, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(form.values(z, {"a": -6.0} | values), -3.0 * one, rtol=1e-12)
    assert set(form.positive) <= set(form.lengths)
    assert ("b" in form.lengths) is ("b" in form.positive)  # a length over which it changes; c may be a place

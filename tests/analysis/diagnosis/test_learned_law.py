"""What else a learned law may be: other forms, and other readings of the same function."""

import numpy as np
import pytest

from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.forms import FORMS
from analysis.collision.laws.own import from_mapping
from analysis.diagnosis import words
from analysis.diagnosis.learning.learned_law import is_same_function, news
from analysis.diagnosis.result import FoundEffect, OtherForm
from analysis.shot.quantity import Quantity

BEND = next(one for one in ARGUMENTS if (one.where, one.name) == ("plate", "bend"))
AT_M = np.linspace(-1.5e-3, 0.0, 50)


def curve(form: str, **values: float) -> np.ndarray:
    (found,) = (one for one in FORMS if one.name == form)
    return np.asarray(found.values(AT_M, values))


@pytest.mark.parametrize(
    ("form", "values", "same"),
    [("quadratic, odd", {"a": -200.0}, True), ("quadratic", {"a": 201.0}, False), ("power", {"a": 200, "n": 2}, True)],
)
def test_forms_that_are_one_curve_over_the_range_are_readings_of_one_function(
    form: str, values: dict[str, float], same: bool
) -> None:
    other, shown = OtherForm(BEND.where, BEND.name, form, "", 0.1, curve(form, **values)), curve("quadratic", a=200.0)
    assert is_same_function(other, shown, news(BEND, AT_M, shown)) is same


def test_a_form_of_another_argument_is_never_the_same_function() -> None:
    assert not is_same_function(OtherForm("block", "place", "quadratic", "", 0.0), curve("quadratic", a=200.0), AT_M)


def test_forms_that_differ_only_beside_what_the_base_model_holds_are_not_one_function() -> None:
    overlap = next(one for one in ARGUMENTS if (one.where, one.name) == ("contact", "overlap"))
    at_m = np.linspace(0.0, 3.5e-5, 50)
    saturating = -2.5e-3 * at_m / (at_m + 1.66e-4)
    power = 5900.0 * at_m**1.74
    (linear,) = np.linalg.lstsq(at_m[:, None], saturating - power, rcond=None)[0]
    moved = power + linear * at_m  # what is linear in the overlap is k_N
    apart = float(np.max(np.abs(moved - saturating)))
    close = saturating + (moved - saturating) * 5e-4 * float(np.max(np.abs(saturating))) / apart
    other = OtherForm("contact", "overlap", "power", "", 0.3, close)
    assert is_same_function(other, saturating, saturating)
    assert not is_same_function(other, saturating, news(overlap, at_m, saturating))


def test_a_law_of_ones_own_is_told_with_its_formula_and_its_units() -> None:
    parameters = {"a": {"unit": "N s/m", "start": 1e-3}, "b": {"unit": "m", "start": 1e-3}}
    law = from_mapping({"name": "brake", "where": "block", "formula": "-a*exp(x/b)*v", "parameters": parameters})
    found = FoundEffect(law, {"a": Quantity(4e-4, 1e-6, ""), "b": Quantity(1.2e-3, 1e-6, "")}, {})
    assert words.found(found) == "brake: -a*exp(x/b)*v with a (4.000 ± 0.010)e-4 N s/m, b (1.2000 ± 0.0010)e-3 m"


@pytest.mark.parametrize(("share", "same"), [(0.99e-3, True), (1.01e-3, False)])
def test_curves_of_one_function_differ_by_less_than_a_thousandth_of_what_is_new(share: float, same: bool) -> None:
    shown, new_n = np.array([1.0, 5.0, -2.0]), np.array([0.5, -2.0, 1.0])
    for moved in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.5]):
        other = OtherForm("block", "place", "power", "", 0.0, shown + 2.0 * share * np.array(moved))
        assert is_same_function(other, shown, new_n) is same

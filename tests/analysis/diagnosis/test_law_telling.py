"""What else a learned law may be: other forms, and other readings of the same function."""

import numpy as np
import pytest

from analysis.diagnosis import words
from analysis.diagnosis.learning.law_telling import is_same_function
from analysis.diagnosis.result import OtherForm
from analysis.laws.arguments import ARGUMENTS
from analysis.laws.forms import FORMS
from analysis.laws.own import from_mapping
from analysis.quantity import Quantity

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
    other = OtherForm(BEND.where, BEND.name, form, "", 0.1, curve(form, **values))
    assert is_same_function(other, curve("quadratic", a=200.0)) is same


def test_a_form_of_another_argument_is_never_the_same_function() -> None:
    assert not is_same_function(OtherForm("block", "place", "quadratic", "", 0.0), curve("quadratic", a=200.0))


def test_a_law_of_ones_own_is_told_with_its_formula_and_its_units() -> None:
    parameters = {"a": {"unit": "N s/m", "start": 1e-3}, "b": {"unit": "m", "start": 1e-3}}
    law = from_mapping({"name": "brake", "where": "block", "formula": "-a*exp(x/b)*v", "parameters": parameters})
    said = words.found(law.key, {"a": Quantity(4e-4, 1e-6, ""), "b": Quantity(1.2e-3, 1e-6, "")}, ())
    assert said == "brake: -a*exp(x/b)*v with a (4.000 ± 0.010)e-4 N s/m, b (1.2000 ± 0.0010)e-3 m"

"""Closed forms: which are distinct over a range, and their starting values."""

import numpy as np
import pytest

from analysis.collision.laws.forms import FORMS, Form
from analysis.diagnosis.learning.closed_forms import is_its_own

AT = np.linspace(0.01, 1.0, 40)


def form(name: str) -> Form:
    return next(one for one in FORMS if one.name == name)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_of_forms_that_are_one_function_on_a_side_of_zero_one_is_tried(side: float) -> None:
    low, high = sorted((0.0, side))
    tried = [one for one in FORMS if is_its_own(one, low, high)]
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

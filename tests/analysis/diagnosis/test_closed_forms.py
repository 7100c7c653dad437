"""A closed form in place of a learned curve: how far it lies from it, and what base and starts take over."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.diagnosis.learning.closed_forms import compress
from analysis.diagnosis.learning.curve_motion import Term

BEND = next(one for one in ARGUMENTS if one.name == "bend against motion")  # the base model holds no part of it
UNITS = np.array([1.0, 1e-7, 1e6])  # of base and starts, as far apart as m and N/m


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
    learned: Any = SimpleNamespace(z=np.zeros(3), terms=(term,), curvature=whole.T @ whole, samples=400)

    linear = next(found for found in compress(learned) if found.form.name == "linear")
    as_splines = np.linalg.lstsq(design, linear.form.values(argument, linear.parameters), rcond=None)[0]
    difference = by_curve @ (as_splines - coefficients)
    taken = -np.linalg.lstsq(by_base, difference, rcond=None)[0]
    assert linear.base_step == pytest.approx(taken * UNITS, rel=1e-6)
    left = difference + by_base @ taken
    assert linear.distance == pytest.approx(left @ left, rel=1e-6)

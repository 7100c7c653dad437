"""A closed form in place of a learned curve: how far it lies from it, and what base and starts take over."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.diagnosis.learning.closed_forms import compress, likely_forms
from analysis.diagnosis.learning.curve_motion import Term

BEND = next(one for one in ARGUMENTS if one.name == "bend against motion")  # the base model holds no part of it
UNITS = np.array([1.0, 1e-7, 1e6])  # of base and starts, as far apart as m and N/m


def _learned(curve: NDArray[np.float64], known: float) -> Any:
    """Return a curve at 60 points from 0 to 2 mm whose coefficients the shots know ``known`` times as well as one."""
    basis = Basis(tuple(np.linspace(0.0, 2e-3, 6)))
    coefficients = np.linalg.lstsq(basis.design(np.linspace(0.0, 2e-3, 60)), curve, rcond=None)[0]
    curvature = np.diag([1.0, *np.full(basis.count, known**2)])
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
    learned: Any = SimpleNamespace(z=np.zeros(3), terms=(term,), curvature=whole.T @ whole, samples=400)

    linear = next(found for found in compress(learned) if found.form.name == "linear")
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
    curvature = np.diag([1.0, *np.full(basis.count, 1e14)])
    learned: Any = SimpleNamespace(
        z=np.zeros(1), terms=(Term(BEND, basis, coefficients),), curvature=curvature, samples=400
    )
    found = next(one for one in compress(learned) if one.form.name == name)
    assert found.parameters["c"] == pytest.approx(sign * place_m, abs=2e-5)

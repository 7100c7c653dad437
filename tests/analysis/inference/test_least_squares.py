"""Where a minimisation says that it has converged."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analysis.inference.fit.least_squares import Minimum, Square, damped_step, minimise


@pytest.mark.parametrize("at", [0.0, 1e12])
@pytest.mark.parametrize(("promise", "converged"), [(1e-3, True), (0.5, False)])
def test_an_end_in_rounding_is_a_minimum_only_where_little_was_promised(
    promise: float, converged: bool, at: float
) -> None:
    """No step lowers the sum, until its fall is lost in the digits of the sum, or it in those of the parameter."""
    start = np.array([at])

    def square(z: np.ndarray) -> Square:
        chi2 = 1000.0 if np.array_equal(z, start) else 1000.0 + 1e-4
        return Square(chi2, np.eye(1), np.array([np.sqrt(promise)]), 1000)

    found = minimise(square, start)
    assert found.converged is converged
    assert np.array_equal(found.parameters, start)


def test_a_quadratic_form_is_minimised_in_a_step() -> None:
    curvature = np.array([[4.0, 1.0], [1.0, 3.0]])
    lowest = np.array([1.0, -2.0])
    evaluated = []

    def square(z: np.ndarray) -> Square:
        evaluated.append(z)
        away = z - lowest
        return Square(float(away @ curvature @ away) + 5.0, curvature, curvature @ away, 100)

    found = minimise(square, np.zeros(2))
    assert found.converged and len(evaluated) <= 4
    np.testing.assert_allclose(found.parameters, lowest, atol=1e-3)  # of standard deviations of about a half


def quadratic(curvature: np.ndarray, lowest: np.ndarray, rest: float = 5.0) -> Callable[[np.ndarray], Square]:
    def square(z: np.ndarray) -> Square:
        away = z - lowest
        return Square(float(away @ curvature @ away) + rest, curvature, curvature @ away, 100)

    return square


def test_a_bound_holds_what_presses_against_it_and_the_rest_goes_to_its_minimum_beside_it() -> None:
    curvature = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.0], [0.5, 0.0, 2.0]])
    lowest = np.array([1.0, -2.0, 0.3])
    low, high = np.array([-9.0, -1.0, -9.0]), np.array([9.0, 9.0, 9.0])
    found = minimise(quadratic(curvature, lowest), np.array([0.0, 5.0, 0.0]), bounds=(low, high))
    # with the second at -1, one beyond its lowest, the others solve their own equations
    rest = lowest[[0, 2]] - np.linalg.solve(curvature[np.ix_([0, 2], [0, 2])], curvature[[0, 2], 1]) * 1.0
    assert found.converged and found.at_bound == (1,)
    np.testing.assert_allclose(found.parameters, [rest[0], -1.0, rest[1]], atol=1e-3)
    mirrored = minimise(quadratic(curvature, -lowest), np.array([0.0, -5.0, 0.0]), bounds=(-high, -low))
    np.testing.assert_allclose(mirrored.parameters, -found.parameters, atol=2e-3)
    assert mirrored.at_bound == (1,)
    held = minimise(quadratic(curvature, lowest), np.array([7.0, 0.0, 0.0]), bounds=(low, np.array([-9.0, 9.0, 9.0])))
    assert held.parameters[0] == -9.0 and 0 in held.at_bound


def test_a_bent_valley_is_followed_to_its_end() -> None:
    """Rosenbrock's, as residuals: 10 (y - x^2) and 1 - x."""
    evaluated = []

    def square(z: np.ndarray) -> Square:
        evaluated.append(z)
        left = np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0]])
        slope = np.array([[-20.0 * z[0], 10.0], [-1.0, 0.0]])
        return Square(float(left @ left), slope.T @ slope, slope.T @ left, 2)

    found = minimise(square, np.array([-1.2, 1.0]), tolerance=1e-10)
    assert found.converged and len(evaluated) < 40
    np.testing.assert_allclose(found.parameters, [1.0, 1.0], atol=1e-4)
    evaluated.clear()
    assert not minimise(square, np.array([-1.2, 1.0]), evaluations=3).converged and len(evaluated) == 3
    evaluated.clear()
    stopped = minimise(square, np.array([-1.2, 1.0]), cancelled=lambda: len(evaluated) >= 2)
    assert not stopped.converged and len(evaluated) == 2


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_damped_step_solves_the_damped_equations(damping: float) -> None:
    units = np.array([1.0, 1e6, 1e-7])
    root = np.random.default_rng(1).standard_normal((9, 3))
    curvature, pull = root.T @ root, np.array([1.0, -2.0, 0.5])
    step = damped_step(curvature * np.outer(units, units), pull * units, damping)
    expected = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), pull)
    assert step is not None
    np.testing.assert_allclose(step * units, expected, rtol=1e-9)
    assert damped_step(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2), 0.0) is None
    assert damped_step(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2), 1.5) is not None
    assert damped_step(np.eye(2), np.array([np.inf, 0.0]), 0.0) is None


def test_a_refused_step_is_followed_by_one_that_is_clearly_shorter() -> None:
    """Two directions a million times apart in curvature, uphill everywhere: no two points are nearly the same."""
    curvature, start = np.array([[1.0, 0.9], [0.9, 1.0]]) * np.outer([1e3, 1.0], [1e3, 1.0]), np.zeros(2)
    asked: list[np.ndarray] = []

    def square(z: np.ndarray) -> Square:
        asked.append(z)
        return Square(1e3 + 1e-3 * len(asked), curvature, np.array([2e4, -3.0]), 1000)

    found = minimise(square, start, evaluations=30)
    lengths = np.sqrt(np.array(asked[1:]) ** 2 @ np.diag(curvature))
    assert not found.converged and np.array_equal(found.parameters, start)
    assert np.all(lengths[1:] <= 0.7 * lengths[:-1]) and np.all(lengths[1:] >= 0.05 * lengths[:-1])
    assert 5 < len(asked) < 20


def followed(square: Callable[[np.ndarray], Square], start: np.ndarray, **options: Any) -> tuple[Minimum, list[Any]]:
    """Return the minimum of a search, and where it has been."""
    asked: list[np.ndarray] = []

    def noted(z: np.ndarray) -> Square:
        asked.append(z)
        return square(z)

    return minimise(noted, start, **options), asked


def test_every_step_between_bounds_promises_a_fall_and_ends_within_them() -> None:
    """Cut at the bounds, Newton's step would lead uphill in nearly every valley that crosses a corner."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        root = rng.standard_normal((6, 4)) * [1.0, 0.1, 1.0, 3.0]
        curvature, lowest = root.T @ root, rng.normal(0.0, 3.0, 4)
        start = rng.uniform(-1.0, 1.0, 4)
        found, asked = followed(quadratic(curvature, lowest), start, bounds=(np.full(4, -1.0), np.full(4, 1.0)))
        values = [quadratic(curvature, lowest)(z).chi2 for z in asked]
        assert found.converged and np.all(np.diff(values) < 0) and np.all(np.abs(asked) <= 1.0)
        pull = found.square.gradient  # nothing presses but against its bound
        inside = np.abs(found.parameters) < 1.0
        assert np.all(np.abs(pull[inside]) < 1e-2 * np.sqrt(np.diag(curvature)[inside]))
        assert np.all(pull[~inside] * found.parameters[~inside] <= 1e-9)

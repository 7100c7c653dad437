"""Where a minimisation says that it has converged."""

import numpy as np
import pytest

from analysis.inference.fit.least_squares import Square, minimise


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

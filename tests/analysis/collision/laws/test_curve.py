"""A curve of a force is the same on arrays, in a kernel and as the sum of its basis, in every piece and beyond."""

import numpy as np
import pytest
from numba import njit

from analysis.collision.laws.curve import Basis, curve_at, graded_basis, visited_range

RANGES = [(-0.3, 0.7), (0.02, 0.9), (-2.0, -0.5)]
STEP = 1e-20  # of a complex step: its square is nothing beside a number
in_kernel = njit(lambda address, argument: curve_at(address, argument))


def _drawn(basis: Basis) -> np.ndarray:
    return np.random.default_rng(basis.count).normal(size=basis.count)


@pytest.mark.parametrize("ends", RANGES)
def test_arrays_kernel_and_basis_agree_in_every_piece_and_beyond_the_ends(ends: tuple[float, float]) -> None:
    basis = graded_basis(*ends, 7)
    assert (basis.knots[0], basis.knots[-1]) == pytest.approx(ends) and np.all(np.diff(basis.knots) > 0.0)
    coefficients = _drawn(basis)
    curve = basis.curve(coefficients)
    width = ends[1] - ends[0]
    at = np.concatenate([np.linspace(ends[0] - width, ends[1] + width, 301), basis.knots])
    summed = basis.design(at) @ coefficients  # constant beyond its ends
    np.testing.assert_allclose(curve(at), summed, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose([in_kernel(curve.address, x) for x in at], summed, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("ends", RANGES)
def test_a_kernel_carries_a_curves_slope_and_the_largest_is_found_in_any_piece(ends: tuple[float, float]) -> None:
    basis = graded_basis(*ends, 7)
    curve = basis.curve(_drawn(basis))
    fine = np.linspace(*ends, 4001)
    middle, slopes = 0.5 * (fine[1:] + fine[:-1]), np.diff(curve(fine)) / np.diff(fine)
    carried = np.array([in_kernel(curve.address, complex(x, STEP)).imag / STEP for x in middle[::40]])
    np.testing.assert_allclose(carried, slopes[::40], rtol=1e-3, atol=1e-3 * np.abs(slopes).max())
    assert curve.largest_slope == pytest.approx(np.abs(slopes).max(), rel=0.1)  # it looks at some 280 places
    assert in_kernel(curve.address, complex(ends[1] + 1.0, STEP)).imag == 0.0


def test_what_is_visited_is_inside_with_a_hundredth_to_spare() -> None:
    assert visited_range([np.array([0.0, 1.0]), np.array([-1.0, 0.5])]) == pytest.approx((-1.02, 1.02))

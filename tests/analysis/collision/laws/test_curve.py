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


@pytest.mark.parametrize("ends", RANGES)
def test_the_roughness_is_the_integral_of_the_squared_second_derivative(ends: tuple[float, float]) -> None:
    """Over a range scaled to one; midpoints of quarters of a piece see a straight line's square to a part in fifty."""
    basis = graded_basis(*ends, 7)
    span, fine = ends[1] - ends[0], np.linspace(*ends, 8001)
    for coefficients in (_drawn(basis), np.linspace(-1.0, 2.0, basis.count) ** 2):
        curve = basis.curve(coefficients)(fine)
        second = np.diff(curve, 2) / (fine[1] - fine[0]) ** 2 * span**2
        exact = float(np.sum(second**2)) * (fine[1] - fine[0]) / span
        assert coefficients @ basis.roughness @ coefficients == pytest.approx(exact, rel=0.04)
    np.testing.assert_allclose(basis.roughness, basis.roughness.T)
    line = np.linalg.lstsq(basis.design(fine), 3.0 * fine - 1.0, rcond=None)[0]
    assert abs(line @ basis.roughness @ line) < 1e-9 * np.abs(basis.roughness).max()  # a line bends nowhere
    larger = graded_basis(1e3 * ends[0], 1e3 * ends[1], 7)
    np.testing.assert_allclose(larger.roughness, basis.roughness, rtol=1e-9, atol=1e-9)


def test_knots_are_denser_near_zero_where_the_range_comes_near_it() -> None:
    both = np.array(graded_basis(-1.0, 3.0, 8).knots)
    assert both.size == 9 and 0.0 in both
    np.testing.assert_allclose(both[2:], 3.0 * (np.arange(7) / 6) ** 1.6)
    np.testing.assert_allclose(both[:3], [-1.0, -(0.5**1.6), 0.0])
    one = np.array(graded_basis(0.0, 2.0, 5).knots)
    np.testing.assert_allclose(one, 2.0 * (np.arange(6) / 5) ** 1.6)
    np.testing.assert_allclose(graded_basis(-2.0, -0.1, 5).knots, -0.1 - 1.9 * (np.arange(5, -1, -1) / 5) ** 1.6)
    np.testing.assert_allclose(graded_basis(0.21, 2.0, 4).knots, np.linspace(0.21, 2.0, 5))  # far from zero: even
    few = graded_basis(-1e-3, 1.0, 6).knots
    assert few[0] == -1e-3 and few[1] == 0.0 and len(few) == 7  # one piece at least on either side
    assert len(graded_basis(-1.0, 1e-3, 6).knots) == 8
    for low, high in ((1.0, 1.0), (2.0, 1.0)):
        with pytest.raises(ValueError, match="constant"):
            graded_basis(low, high, 5)


def test_two_bases_of_the_same_knots_are_equal() -> None:
    one, other = (graded_basis(-1.0, 2.0, 6) for _ in range(2))
    assert one == other and hash(one) == hash(other) and one != graded_basis(-1.0, 2.0, 7)

"""Search coordinates: the slowest swing of block, contact and plate, there and back, with true slopes."""

import math

import numpy as np
import pytest

from analysis.collision.parameters import Infeasible
from analysis.inference.model.coordinates import Coordinates

BLOCK_KG = 0.0179
BASE = np.array([221.0, 2e-4, 1e4, 0.4, 180.0, 3e-4])
OWN = np.array([[-0.26, 0.0123, 2e-3], [-0.31, 0.0201, -1e-3]])


def made() -> Coordinates:
    """Return the coordinates of two plates and two shots."""
    return Coordinates(BLOCK_KG, True, reference_s=np.array([0.012, 0.02]), further_at=(4,))


def test_coordinates_are_the_slowest_swing_the_mass_and_the_contact_over_it() -> None:
    z, own = made().base_to_search(BASE), made().own_to_search(OWN)
    for at in (0, 4):
        k_p, m_p, k_n = BASE[at], BASE[at + 1], BASE[2]
        stiffness = np.array([[k_n, -k_n], [-k_n, k_p + k_n]])
        slowest = np.linalg.eigvals(stiffness / np.array([[BLOCK_KG], [m_p]])).min()
        assert z[at] == pytest.approx(math.log(slowest), abs=1e-10)
        assert z[at + 1] == pytest.approx(math.log(m_p))
    assert z[2:4] == pytest.approx([math.log(1e4 / 2e-4), 0.4 / 2e-4])
    # the height of each line of flight at the expected touch
    assert own[:, 2] == pytest.approx([2e-3 - 0.26 * (0.012 - 0.0123), -1e-3 + 0.31 * 1e-4])
    np.testing.assert_array_equal(own[:, :2], OWN[:, :2])


def test_they_lead_back_with_true_slopes() -> None:
    coordinates = made()
    z, own = coordinates.base_to_search(BASE), coordinates.own_to_search(OWN)
    found, slope = coordinates.base_parameters(z)
    np.testing.assert_allclose(found, BASE, rtol=1e-9)
    found_own, slope_of_own = coordinates.own_parameters(own)
    np.testing.assert_allclose(found_own, OWN, rtol=1e-9)
    for k in range(z.size):
        step = np.zeros(z.size)
        step[k] = 1e-5 * max(1.0, abs(z[k]))
        sides = [coordinates.base_parameters(z + sign * step)[0] for sign in (1.0, -1.0)]
        numeric = (sides[0] - sides[1]) / (2.0 * step[k])
        np.testing.assert_allclose(slope[:, k] / BASE, numeric / BASE, rtol=1e-5, atol=1e-6)
    for k in range(own.shape[1]):
        step = np.zeros(own.shape)
        step[:, k] = 1e-5 * np.maximum(1.0, np.abs(own[:, k]))
        sides = [coordinates.own_parameters(own + sign * step)[0] for sign in (1.0, -1.0)]
        numeric = (sides[0] - sides[1]) / (2.0 * step[:, k : k + 1])
        np.testing.assert_allclose(slope_of_own[:, :, k] / OWN, numeric / OWN, rtol=1e-5, atol=1e-6)


def test_one_body_is_searched_as_it_is() -> None:
    coordinates = Coordinates(BLOCK_KG, False, np.array([0.5]))
    base, own = np.array([1e4, 0.4]), np.array([[-0.2, 0.6, 1e-3]])
    np.testing.assert_array_equal(coordinates.base_to_search(base), base)
    np.testing.assert_array_equal(coordinates.base_parameters(base)[0], base)
    z = coordinates.own_to_search(own)
    np.testing.assert_allclose(z, [[-0.2, 0.6, 1e-3 - 0.2 * (0.5 - 0.6)]])
    np.testing.assert_allclose(coordinates.own_parameters(z)[0], own)


@pytest.mark.parametrize("place", [0, 1, 2, 4, 5])
def test_coordinates_beyond_any_plate_are_refused(place: int) -> None:
    z = made().base_to_search(BASE)
    for far in (61.0, -61.0):
        z[place] = far
        with pytest.raises(Infeasible, match="beyond any plate"):
            made().base_parameters(z)
    soft = made().base_to_search(BASE)
    soft[0] = math.log(1e4 / BLOCK_KG) + 0.01
    with pytest.raises(Infeasible, match="softer than"):
        made().base_parameters(soft)
    soft[0] -= 0.02
    assert made().base_parameters(soft)[0][0] > 0.0

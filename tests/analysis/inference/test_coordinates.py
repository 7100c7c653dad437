"""Search coordinates: the slowest swing of block, contact and plate, there and back, with true slopes."""

import math

import numpy as np
import pytest

from analysis.collision.parameters import Infeasible
from analysis.inference.fit.coordinates import Coordinates

BLOCK_KG = 0.0179
PARAMETERS = np.array([221.0, 2e-4, 1e4, 0.4, 180.0, 3e-4, -0.26, 0.0123, 2e-3, -0.31, 0.0201, -1e-3, 7.0])


def made() -> Coordinates:
    """Return the coordinates of two plates and two shots, with one further number."""
    return Coordinates(BLOCK_KG, True, own_at=(6, 9), reference_s=(0.012, 0.02), further_at=(4,))


def test_coordinates_are_the_slowest_swing_the_mass_and_the_contact_over_it() -> None:
    z = made().to_search(PARAMETERS)
    for at in (0, 4):
        k_p, m_p, k_n = PARAMETERS[at], PARAMETERS[at + 1], PARAMETERS[2]
        stiffness = np.array([[k_n, -k_n], [-k_n, k_p + k_n]])
        slowest = np.linalg.eigvals(stiffness / np.array([[BLOCK_KG], [m_p]])).min()
        assert z[at] == pytest.approx(math.log(slowest), abs=1e-10)
        assert z[at + 1] == pytest.approx(math.log(m_p))
    assert z[2:4] == pytest.approx([math.log(1e4 / 2e-4), 0.4 / 2e-4])
    # the height of each line of flight at the expected touch
    assert z[8] == pytest.approx(2e-3 - 0.26 * (0.012 - 0.0123)) and z[11] == pytest.approx(-1e-3 + 0.31 * 1e-4)
    np.testing.assert_array_equal(z[[6, 7, 9, 10, 12]], PARAMETERS[[6, 7, 9, 10, 12]])


def test_they_lead_back_with_true_slopes() -> None:
    coordinates = made()
    z = coordinates.to_search(PARAMETERS)
    found, slope = coordinates.to_parameters(z)
    np.testing.assert_allclose(found, PARAMETERS, rtol=1e-9)
    for k in range(z.size):
        step = np.zeros(z.size)
        step[k] = 1e-5 * max(1.0, abs(z[k]))
        sides = [coordinates.to_parameters(z + sign * step)[0] for sign in (1.0, -1.0)]
        numeric = (sides[0] - sides[1]) / (2.0 * step[k])
        np.testing.assert_allclose(slope[:, k] / PARAMETERS, numeric / PARAMETERS, rtol=1e-5, atol=1e-6)


def test_one_body_is_searched_as_it_is() -> None:
    coordinates = Coordinates(BLOCK_KG, False, (2,), (0.5,))
    parameters = np.array([1e4, 0.4, -0.2, 0.6, 1e-3])
    z = coordinates.to_search(parameters)
    np.testing.assert_allclose(z, [1e4, 0.4, -0.2, 0.6, 1e-3 - 0.2 * (0.5 - 0.6)])
    np.testing.assert_allclose(coordinates.to_parameters(z)[0], parameters)


@pytest.mark.parametrize("place", [0, 1, 2, 4, 5])
def test_coordinates_beyond_any_plate_are_refused(place: int) -> None:
    z = made().to_search(PARAMETERS)
    for far in (61.0, -61.0):
        z[place] = far
        with pytest.raises(Infeasible, match="beyond any plate"):
            made().to_parameters(z)
    soft = made().to_search(PARAMETERS)
    soft[0] = math.log(1e4 / BLOCK_KG) + 0.01
    with pytest.raises(Infeasible, match="softer than"):
        made().to_parameters(soft)
    soft[0] -= 0.02
    assert made().to_parameters(soft)[0][0] > 0.0

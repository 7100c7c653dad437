"""The restricted likelihood of a site's strengths, against the covariance written down."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.inference.noise import estimate
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.sway import shape_of
from analysis.reading import RestrictedLikelihood
from tests.analysis.inference.test_whitened_columns import a_shot

AT = np.array([math.log(0.3**2), -1.0, 0.7])  # ln white^2, strengths of both bands
PRECISION = np.array([[0.4, -0.1], [-0.1, 0.3]])  # of the strengths' prior
PARAMETERS = 3


def a_shape(wander: float) -> Floor:
    """Return white noise of one with a part that wanders ``wander`` times as far."""
    return Floor(1.0, (wander, 0.0), (1e-3, 1e-2), 5e-5)


def two_shots() -> list[tuple[SimpleNamespace, np.ndarray]]:
    """Return two shots, each with what is left and three derivatives; the last parameter is the second shot's own."""
    random = np.random.default_rng(5)
    columns = [random.standard_normal((62, 1 + PARAMETERS)) for _ in range(2)]
    columns[0][:, -1] = 0.0
    return [(a_shot(), one) for one in columns]


def moved_by(at: np.ndarray, shot: SimpleNamespace) -> np.ndarray:
    """Return what unit normal numbers of the site do to a shot's valid samples."""
    return shot.sway.basis @ shot.sway.factors * np.exp(0.5 * at[1:])[shot.sway.band]


def covariance_of(at: np.ndarray, shot: SimpleNamespace, wander: float) -> np.ndarray:
    """Return the covariance of a shot's valid samples, written down."""
    index = np.flatnonzero(shot.valid)
    apart_s = np.abs(np.subtract.outer(index, index)) * 5e-5
    noise = math.exp(at[0]) * (shot.weight**2 * np.eye(index.size) + wander**2 * np.exp(-apart_s / 1e-3))
    moved = moved_by(at, shot)
    return noise + moved @ moved.T


def written_down(at: np.ndarray, wander: float) -> float:
    """Return the restricted log-likelihood with the prior's by dense algebra."""
    value = -0.5 * at[1:] @ PRECISION @ at[1:]
    normal, pull, square = np.zeros((PARAMETERS,) * 2), np.zeros(PARAMETERS), 0.0
    for shot, columns in two_shots():
        covariance = covariance_of(at, shot, wander)
        left, tangents = columns[shot.valid, 0], columns[shot.valid, 1:]
        solved = np.linalg.solve(covariance, np.column_stack([left, tangents]))
        value -= 0.5 * (np.linalg.slogdet(covariance)[1] + left.size * math.log(2 * math.pi))
        square += float(left @ solved[:, 0])
        pull += tangents.T @ solved[:, 0]
        normal += tangents.T @ solved[:, 1:]
    taken = pull @ np.linalg.solve(normal, pull)
    return float(value - 0.5 * (np.linalg.slogdet(normal)[1] + square - taken))


def likelihood_under(wander: float) -> RestrictedLikelihood:
    places = np.arange(PARAMETERS)
    shots = [estimate._shot_under(a_shape(wander), columns, places, shot) for shot, columns in two_shots()]
    return RestrictedLikelihood(shots, np.pad(PRECISION, (1, 0)))


@pytest.mark.parametrize("wander", [0.0, 3.0])
def test_the_likelihood_and_its_gradient_are_those_of_the_dense_covariance(wander: float) -> None:
    found = likelihood_under(wander).at(AT)
    assert found.value == pytest.approx(written_down(AT, wander), abs=1e-7)
    step = 1e-4
    for k, unit in enumerate(np.eye(AT.size)):
        slope = (written_down(AT + step * unit, wander) - written_down(AT - step * unit, wander)) / (2 * step)
        assert found.slope[k] == pytest.approx(slope, rel=1e-6)


def test_the_curvature_is_that_of_the_mean_over_what_the_noise_may_be() -> None:
    likelihood = likelihood_under(3.0)
    curvature = likelihood.curvature(likelihood.at(AT))
    assert np.allclose(curvature, curvature.T) and np.linalg.eigvalsh(curvature)[0] > 0.0
    normal = np.zeros((PARAMETERS,) * 2)
    for shot, columns in two_shots():
        tangents = columns[shot.valid, 1:]
        normal += tangents.T @ np.linalg.solve(covariance_of(AT, shot, 3.0), tangents)
    everything = np.linalg.inv(normal)
    for k in range(1, AT.size):  # half the trace of (P dC)^2 for each strength, its prior beside
        expected = PRECISION[k - 1, k - 1]
        for shot, columns in two_shots():
            inverse = np.linalg.inv(covariance_of(AT, shot, 3.0))
            tangents = columns[shot.valid, 1:]
            projected = inverse - inverse @ tangents @ everything @ tangents.T @ inverse
            part = moved_by(AT, shot)[:, shot.sway.band == k - 1]
            expected += 0.5 * float(np.sum((part.T @ projected @ part) ** 2))
        assert curvature[k, k] == pytest.approx(expected, rel=1e-7)


def test_motion_beyond_all_rounding_is_refused_in_words() -> None:
    likelihood = likelihood_under(0.0)
    point = likelihood.at(AT + np.array([0.0, 150.0, 0.0]))
    assert point.value == -math.inf
    with pytest.raises(np.linalg.LinAlgError, match="not determined"):
        likelihood.curvature(point)
    assert np.all(np.isfinite(likelihood.curvature(likelihood.at(AT))))


def test_a_second_part_that_wanders_joins_the_first_as_it_is() -> None:
    one = Floor(1.0, (3.0, 0.0), (4e-3, 1e-2), 5e-5)
    two = estimate._with_a_part(one, 2, 5e-2)
    assert (two.rms_m[0], two.tau_s) == (3.0, (4e-3, 5e-2))
    assert two.rms_m[1] * math.sqrt(2 * 5e-5 / 5e-2) == pytest.approx(0.2)  # what a sample adds over the white noise
    first = estimate._with_a_part(one, 1, 5e-4)
    assert first.rms_m[1] == 0.0 and first.tau_s[0] == 5e-4
    z = estimate._coordinates(two, 2)
    again = estimate._shape_at(z, two.spacing_s)
    assert again.rms_m == pytest.approx(two.rms_m) and again.tau_s == pytest.approx(two.tau_s)


@pytest.mark.parametrize("place", [-2.9, -0.4, 0.0, 1.7])
def test_the_vertex_of_a_parabola_and_what_it_gains(place: float) -> None:
    def value(x: float) -> float:
        return 7.0 - 1.5 * (x - place) ** 2

    found, gain = estimate._vertex(value(-1.0), value(0.0), value(1.0))
    assert found == pytest.approx(place) and gain == pytest.approx(1.5 * place**2)
    # three sides away at most, and there where the parabola opens upwards
    assert estimate._vertex(0.0, 0.9, 2.0) == (3.0, pytest.approx(3.0 * (1.0 + 0.5 * 3.0 * 0.2)))
    far, gain = estimate._vertex(8.0, 4.0, 0.1)
    assert far == -3.0 and gain > 0.0


def test_a_shape_is_a_floor_in_units_of_its_white_noise() -> None:
    floor = Floor(2.0, (6.0, 8.0), (1e-3, 2e-2), 5e-5, (0.1, 0.2))
    assert shape_of(floor) == Floor(1.0, (3.0, 4.0), (1e-3, 2e-2), 5e-5)
    assert shape_of(floor, 1) == Floor(1.0, (3.0, 0.0), (1e-3, 2e-2), 5e-5)
    far = estimate._shape_at(np.array([0.0, math.log(1e-9), 0.0, math.log(1e3)]), 5e-5)
    assert far.tau_s == pytest.approx((3e-4, 1.0))
    found = shape_of(floor).with_logarithms(np.array([math.log(9.0), 0.5, -0.5]))
    assert found.white_m == pytest.approx(3.0) and found.rms_m == pytest.approx((9.0, 12.0))
    assert found.site == (0.5, -0.5) and found.logarithms == pytest.approx([math.log(9.0), 0.5, -0.5])


def test_neighbouring_bands_differ_little_beforehand_and_lines_stand_alone() -> None:
    site = SimpleNamespace(bands=4, random_bands=2)
    prior = estimate._prior(site)
    # (6, 6, 2, 2) for each, and one for the difference of the two random ones
    expected = np.diag([0.0, 1 / 36 + 1, 1 / 36 + 1, 1 / 4, 1 / 4])
    expected[1, 2] = expected[2, 1] = -1.0
    np.testing.assert_allclose(prior, expected)

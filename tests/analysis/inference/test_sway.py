"""What a frame may have added to one shot, of made-up directions, against the dense covariance of all its parts."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.inference.noise.floor import Floor
from analysis.inference.noise.sway import Sway, _orthonormal, shape_of

Floats = NDArray[np.float64]
SPACING_S, WEIGHT, PLATE_STD = 1e-3, 2.0, (3e-9, 2e-6)
SITE = (np.log(2.0), np.log(0.3))
STILL = Floor(1e-10, (0.0, 0.0), (1e-2, 1e-2), SPACING_S, SITE)
WANDERS = Floor(1e-10, (4e-10, 3e-10), (5e-3, 5e-2), SPACING_S, SITE)
NOISES = pytest.mark.parametrize("noise", [STILL, WANDERS])


def swaying(seed: int = 1) -> Sway:
    """Return three directions of five waves and a plate's start in two bands, at 45 of 48 samples."""
    random = np.random.default_rng(seed)
    valid = np.ones(48, dtype=bool)
    valid[[0, 7, 30]] = False
    basis = np.linalg.qr(random.standard_normal((45, 3)))[0]
    factors = 1e-9 * random.standard_normal((3, 7))
    speeds = np.array([[1.0, 4.0], [9.0, 16.0]])
    return Sway(basis, factors, np.array([0, 0, 1, 1, 1, 0, 0]), valid, WEIGHT, speeds, PLATE_STD)


def covariances(sway: Sway, noise: Floor) -> tuple[Floats, Floats]:
    """Return the covariance of the valid samples, and of them with the seven numbers."""
    times = SPACING_S * np.flatnonzero(sway.valid)
    apart = np.abs(times[:, None] - times)
    whole = (WEIGHT * noise.white_m) ** 2 * np.eye(times.size)
    for rms, tau in noise.wander:
        whole += rms**2 * np.exp(-apart / tau)
    by_numbers = sway.basis @ sway.factors * np.exp(0.5 * np.array(noise.site))[sway.band]
    return whole + by_numbers @ by_numbers.T, by_numbers


@NOISES
def test_rows_are_whitened_of_all_parts(noise: Floor) -> None:
    sway = swaying()
    some = np.eye(sway.valid.size)[:, sway.valid]
    white = sway.whiten(noise.whiten(some, sway.valid, WEIGHT), noise)
    whole, _ = covariances(sway, noise)
    np.testing.assert_allclose(white @ whole @ white.T, np.eye(45), atol=1e-9)


@NOISES
def test_what_is_likely_is_the_conditional_mean(noise: Floor) -> None:
    sway = swaying()
    left = 1e-9 * np.random.default_rng(3).standard_normal(sway.valid.size)
    whole, by_numbers = covariances(sway, noise)
    numbers = by_numbers.T @ np.linalg.solve(whole, left[sway.valid])
    np.testing.assert_allclose(sway.likely(left, noise), by_numbers @ numbers, rtol=1e-8, atol=1e-16)
    plate = numbers[-2:] * np.sqrt(2.0) * PLATE_STD  # in the first band, of twice the power
    assert sway.likeliest_plate(left, noise) == pytest.approx(tuple(plate), rel=1e-8)


def test_a_plates_start_moves_the_shot_as_its_numbers_do() -> None:
    sway = swaying()
    moved = sway.plate_displacement_m((2.0 * PLATE_STD[0], -3.0 * PLATE_STD[1]))
    assert not moved[~sway.valid].any()
    columns = sway.basis @ sway.factors
    np.testing.assert_allclose(moved[sway.valid], 2.0 * columns[:, 5] - 3.0 * columns[:, 6])


def test_speeds_and_covariances_are_those_of_the_bands() -> None:
    sway = swaying()
    assert sway.speeds_m_per_s(STILL) == pytest.approx((np.sqrt(2.0 + 2.7), np.sqrt(8.0 + 4.8)))
    bands = sway.whitened_directions(WANDERS).bands
    assert bands.shares.tolist() == [[1, 1, 0, 0, 0, 1, 1], [0, 0, 1, 1, 1, 0, 0]]
    for covariance, some in zip(bands.covariances, ([0, 1, 5, 6], [2, 3, 4]), strict=True):
        assert covariance == pytest.approx((bands.factors[:, some] @ bands.factors[:, some].T).ravel(), rel=1e-12)
    one, other = swaying(), swaying(2)
    by = [covariances(each, STILL)[1] for each in (one, other)]
    assert one.largest_difference_m(other, STILL) == pytest.approx(
        np.sqrt(np.max(np.sum((by[0] - by[1]) ** 2, axis=1)))
    )


def test_results_are_kept_for_the_last_few_noises() -> None:
    sway, made = swaying(), []

    def make(noise: Floor) -> float:
        made.append(noise)
        return noise.white_m

    noises = [replace(STILL, white_m=k * 1e-10) for k in range(1, 6)]
    assert [sway._cached("what", noise, make) for noise in noises[:4] * 2] == [n.white_m for n in noises[:4] * 2]
    assert made == noises[:4]
    for noise in (noises[4], noises[3], noises[1], noises[0], noises[1]):  # the fifth in the place of the first
        assert sway._cached("what", noise, make) == noise.white_m
    assert made[4:] == [noises[4], noises[0], noises[1]]
    assert sway._cached("other", noises[0], lambda _: 7.0) == 7.0


def test_noises_of_one_shape_share_their_directions() -> None:
    louder = replace(WANDERS, white_m=3e-10, rms_m=(12e-10, 9e-10), site=(0.0, 0.0))
    assert shape_of(WANDERS) == shape_of(louder) == Floor(1.0, (4.0, 3.0), (5e-3, 5e-2), SPACING_S)
    sway = swaying()
    assert sway.whitened_directions(WANDERS) is sway.whitened_directions(louder)
    assert sway.whitened_directions(WANDERS) is not sway.whitened_directions(STILL)
    unmoved = replace(shape_of(WANDERS), site=SITE)
    whole, _ = covariances(replace(sway, factors=0.0 * sway.factors), unmoved)
    assert sway.whitened_directions(WANDERS).logs == pytest.approx(np.linalg.slogdet(whole)[1])


@pytest.mark.parametrize("mixed", [0.0, 0.01, 0.3, 1.0])
def test_columns_are_made_orthonormal(mixed: float) -> None:
    random = np.random.default_rng(5)
    columns = np.linalg.qr(random.standard_normal((30, 4)))[0] + mixed * random.standard_normal((30, 4)) / np.sqrt(30)
    if mixed == 1.0:
        columns[:, 3] = columns[:, 2]  # says nothing more
    basis, factors = _orthonormal(columns, 1e-20)
    np.testing.assert_allclose(basis.T @ basis, np.eye(3 if mixed == 1.0 else 4), atol=1e-13)
    np.testing.assert_allclose(basis @ factors, columns, atol=1e-13)


def test_columns_that_differ_by_less_than_rounding_hides_are_one() -> None:
    """Products of columns know their difference to eight digits of the columns alone."""
    random = np.random.default_rng(6)
    one, two, three = random.standard_normal((3, 500))
    columns = np.stack([one, one + 1e-7 * two, three], axis=1)
    basis, factors = _orthonormal(columns, 1e-30)
    assert basis.shape[1] == 3
    np.testing.assert_allclose(basis @ factors, columns, atol=1e-13)
    columns[:, 1] = one + 1e-9 * two
    basis, factors = _orthonormal(columns, 1e-30)
    assert basis.shape[1] == 2
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-13)
    np.testing.assert_allclose(basis @ factors, columns, atol=1e-8)


def test_columns_with_less_than_the_least_are_left_out() -> None:
    columns = np.diag([3.0, 1.0, 0.1])
    basis, factors = _orthonormal(columns, 0.1)
    np.testing.assert_allclose(basis @ factors, np.diag([3.0, 1.0, 0.0]), atol=1e-14)
    basis, factors = _orthonormal(0.01 * columns, 0.1)  # the strongest column stays: something is solved with it
    np.testing.assert_allclose(basis @ factors, np.diag([0.03, 0.0, 0.0]), atol=1e-14)

"""The floor: likelihood against the dense covariance, whitening to white, and finding what it was made with."""

import numpy as np
import pytest

from analysis.inference.noise.floor import (
    Floor,
    LikeliestFloor,
    likeliest_floor,
    white_by_differences,
    white_floor,
    with_parts,
)

FLOOR = Floor(1e-10, (4e-10, 0.0), (2.5e-3, 1e-2), 5e-5)


def _covariance(floor: Floor, n: int) -> np.ndarray:
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * floor.spacing_s
    total = floor.white_m**2 * np.eye(n)
    for rms, tau in zip(floor.rms_m, floor.tau_s, strict=True):
        total += rms**2 * np.exp(-lag / tau)
    return total


def drawn(samples: int, random: np.random.Generator) -> np.ndarray:
    """Return one random realisation of the floor."""
    return np.asarray(np.linalg.cholesky(_covariance(FLOOR, samples)) @ random.standard_normal(samples))


def test_whitening_is_that_of_the_dense_covariance() -> None:
    random = np.random.default_rng(1)
    floor = Floor(2e-11, (4e-10, 1e-10), (2.5e-3, 2e-2), 5e-5)
    valid = np.ones(200, dtype=bool)
    valid[60:75] = False
    values = random.standard_normal((200, 2)) * 1e-10
    white = floor.whiten(values, valid)
    dense = values[valid].T @ np.linalg.solve(_covariance(floor, 200)[np.ix_(valid, valid)], values[valid])
    np.testing.assert_allclose(white.T @ white, dense, rtol=1e-8)


def test_the_learned_likelihood_is_that_of_the_dense_covariance() -> None:
    random = np.random.default_rng(2)
    series = [drawn(300, random) for _ in range(2)]
    valid = [np.ones(300, dtype=bool)] * 2
    floor, value = likeliest_floor(series, valid, FLOOR.spacing_s, weights=len(series) * [1.0], start=None)
    dense = 0.0
    for one in series:
        covariance = _covariance(floor, 300)
        sign, log = np.linalg.slogdet(covariance * 1e20)
        assert sign > 0
        dense -= 0.5 * (one @ np.linalg.solve(covariance, one) + log - 300 * np.log(1e20) + 300 * np.log(2 * np.pi))
    assert value == pytest.approx(dense, abs=1e-3)


def test_a_floor_is_learned_as_it_was_made_and_white_noise_stays_white() -> None:
    random = np.random.default_rng(3)
    valid = [np.ones(1200, dtype=bool)] * 3
    equal = [1.0, 1.0, 1.0]
    drawn_ones = [drawn(1200, random) for _ in range(3)]
    floor, _ = likeliest_floor(drawn_ones, valid, FLOOR.spacing_s, weights=equal, start=None)
    assert floor.white_m == pytest.approx(1e-10, rel=0.1)
    assert floor.rms_m[0] == pytest.approx(4e-10, rel=0.3)
    quiet = [1e-10 * random.standard_normal(1200) for _ in range(3)]
    white, _ = likeliest_floor(quiet, valid, FLOOR.spacing_s, weights=equal, start=None)
    assert white.rms_m == (0.0, 0.0)
    assert white.white_m == pytest.approx(1e-10, rel=0.05)


def test_what_whitening_divides_by_is_the_determinant_of_the_covariance() -> None:
    floor = Floor(2e-11, (4e-10, 1e-10), (2.5e-3, 2e-2), 5e-5)
    valid = np.random.default_rng(4).uniform(size=120) > 0.2
    for weight in (1.0, 3.0):
        covariance = _covariance(floor, 120) + (weight**2 - 1.0) * floor.white_m**2 * np.eye(120)
        dense = covariance[np.ix_(valid, valid)]
        _, log = np.linalg.slogdet(dense * 1e20)
        assert floor.log_variances(valid, weight) == pytest.approx(log - valid.sum() * np.log(1e20), rel=1e-9)
        values = np.random.default_rng(5).standard_normal((120, 1)) * 1e-10
        white = floor.whiten(values, valid, weight)
        exact = values[valid, 0] @ np.linalg.solve(dense, values[valid, 0])
        assert float(white[:, 0] @ white[:, 0]) == pytest.approx(exact, rel=1e-8)


def test_shots_weighed_by_their_noise_show_one_floor() -> None:
    random = np.random.default_rng(6)
    weights = (0.5, 2.0)
    series = [weight * 1e-10 * random.standard_normal(3000) for weight in weights]
    series[0][:10] = 1.0
    valid = [np.arange(3000) >= 10, np.arange(3000) < 2900]
    floor, value = likeliest_floor(series, valid, 5e-5, weights=weights, start=None)
    assert floor.rms_m == (0.0, 0.0) and floor.white_m == pytest.approx(1e-10, rel=0.03)
    std = [weight * floor.white_m for weight in weights]
    dense = sum(
        -0.5 * float(np.sum(np.log(2 * np.pi * s**2) + (x[v] / s) ** 2))
        for s, x, v in zip(std, series, valid, strict=True)
    )
    assert value == pytest.approx(dense, rel=1e-9)
    assert white_by_differences(series[:1], valid[:1]) == pytest.approx(0.5e-10, rel=0.05)
    assert white_by_differences([np.ones(3)], [np.ones(3, dtype=bool)]) == 0.0


def test_a_part_is_added_where_it_pays_and_only_if_it_is_asked_for() -> None:
    """It must raise ln L by the logarithm of the number of samples."""
    price = np.log(300)

    def parts(gains: list[float | None], most: int = 2) -> int:
        def with_next(best: LikeliestFloor, number: int) -> LikeliestFloor | None:
            assert best.floor.white_m == number  # the white noise of these counts the parts, from one
            gain = gains[number - 1]
            return None if gain is None else LikeliestFloor(white_floor(number + 1.0, 5e-5), best.value + gain)

        found = with_parts(LikeliestFloor(white_floor(1.0, 5e-5), 7.0), most, 300, with_next)
        return round(found.floor.white_m) - 1

    assert [parts([price + 0.1, price + 0.1], most) for most in (0, 1, 2)] == [0, 1, 2]
    assert parts([price - 0.1, 99.0]) == parts([None, 99.0]) == 0 and parts([99.0, price - 0.1]) == 1


def test_two_parts_are_found_as_they_were_made() -> None:
    random = np.random.default_rng(7)
    floor = Floor(1e-10, (1e-9, 4e-9), (5e-4, 0.1), 5e-5)
    root = np.linalg.cholesky(_covariance(floor, 1500))
    series = [root @ random.standard_normal(1500) for _ in range(3)]
    valid = [np.ones(1500, dtype=bool)] * 3
    two, most = likeliest_floor(series, valid, 5e-5, weights=len(series) * [1.0], start=None)
    assert sorted(two.tau_s)[0] == pytest.approx(5e-4, rel=0.5) and sorted(two.rms_m) == pytest.approx(
        [1e-9, 4e-9], rel=0.2
    )
    again, value = likeliest_floor(series, valid, 5e-5, weights=len(series) * [1.0], start=two)
    assert value == pytest.approx(most, abs=0.2) and sorted(again.rms_m) == pytest.approx(sorted(two.rms_m), rel=0.3)

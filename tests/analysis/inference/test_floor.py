"""The floor: likelihood against the dense covariance, whitening to white, and finding what it was made with."""

import numpy as np
import pytest

from analysis.inference.noise.floor import Floor, learn

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


def test_the_learnt_likelihood_is_that_of_the_dense_covariance() -> None:
    random = np.random.default_rng(2)
    series = [drawn(300, random) for _ in range(2)]
    valid = [np.ones(300, dtype=bool)] * 2
    floor, value = learn(series, valid, FLOOR.spacing_s, parts=1)
    dense = 0.0
    for one in series:
        covariance = _covariance(floor, 300)
        sign, log = np.linalg.slogdet(covariance * 1e20)
        assert sign > 0
        dense -= 0.5 * (one @ np.linalg.solve(covariance, one) + log - 300 * np.log(1e20) + 300 * np.log(2 * np.pi))
    assert value == pytest.approx(dense, abs=1e-3)


def test_a_floor_is_learnt_as_it_was_made_and_white_noise_stays_white() -> None:
    random = np.random.default_rng(3)
    valid = [np.ones(1200, dtype=bool)] * 3
    floor, _ = learn([drawn(1200, random) for _ in range(3)], valid, FLOOR.spacing_s)
    assert floor.white_m == pytest.approx(1e-10, rel=0.1)
    assert floor.rms_m[0] == pytest.approx(4e-10, rel=0.3)
    white, _ = learn([1e-10 * random.standard_normal(1200) for _ in range(3)], valid, FLOOR.spacing_s)
    assert white.rms_m == (0.0, 0.0)
    assert white.white_m == pytest.approx(1e-10, rel=0.05)

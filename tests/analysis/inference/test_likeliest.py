"""The likelihood of a floor against the one its whole covariance matrix gives."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.inference.noise.likeliest import Series, likelihood

Floats = NDArray[np.float64]
SPACING_S = 5e-5


def _dense(series: Series, shape: Floats) -> tuple[float, float]:
    """Return the log-likelihood and the likeliest white rms, by the covariance of each shot's valid samples."""
    square, logs = 0.0, 0.0
    for shot, white in enumerate(series.white):
        here = np.arange(series.first[shot], series.first[shot + 1])
        here = here[series.valid[here]]
        lag = SPACING_S * np.abs(here[:, None] - here)
        parts = (shape[2 * k] ** 2 * np.exp(-lag / shape[2 * k + 1]) for k in range(2))
        covariance = sum(parts, white * np.eye(here.size))
        square += float(series.values[here] @ np.linalg.solve(covariance, series.values[here]))
        logs += float(np.linalg.slogdet(covariance)[1])
    n = series.samples
    return -0.5 * (n * math.log(2 * math.pi * square / n) + logs + n), math.sqrt(square / n)


@pytest.mark.parametrize("shape", [(0.0, 1e-2, 0.0, 1e-2), (3.0, 1e-3, 0.0, 1e-2), (2.0, 5e-4, 20.0, 0.05)])
def test_a_likelihood_is_that_of_the_whole_covariance_matrix(shape: tuple[float, ...]) -> None:
    """Two shots, one with twice the white variance, with short and long gaps once the filter is steady."""
    random = np.random.default_rng(8)
    first, white = np.array([0, 350, 600]), np.array([1.0, 2.0])
    values = np.concatenate([np.cumsum(random.normal(0.0, 0.3, n)) + random.normal(0.0, 1.0, n) for n in (350, 250)])
    valid = np.ones(600, dtype=np.bool_)
    valid[[0, 200, 420]] = False
    valid[260:290] = False
    series = Series(values, valid, first, white, SPACING_S, int(valid.sum()))
    value, rms = likelihood(series, np.array(shape))
    true, true_rms = _dense(series, np.array(shape))
    assert value == pytest.approx(true, abs=1e-3)
    assert rms == pytest.approx(true_rms, rel=1e-6)

"""The likelihood of a floor against the one its whole covariance matrix gives."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from analysis.inference.noise.kalman import Series
from analysis.inference.noise.likeliest import likeliest, likelihood, shape_at

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


@pytest.mark.parametrize("parts", [1, 2])
def test_the_search_ends_where_scipys_does(parts: int) -> None:
    random, memory = np.random.default_rng(5), math.exp(-SPACING_S / 4e-3)
    values = random.standard_normal(3000)
    state = 0.0
    for i in range(values.size):
        state = memory * state + 3.0 * math.sqrt(1 - memory**2) * random.standard_normal()
        values[i] += state
    series = Series(values, np.ones(3000, bool), np.array([0, 3000]), np.ones(1), SPACING_S, 3000)
    start = np.array([0.5, -2.0, 0.0, 1.0])[: 2 * parts]
    found = likelihood(series, shape_at(likeliest(series, start, 0.6, 200 * parts, 1e-3, 1e-5)))[0]
    other = minimize(lambda z: -likelihood(series, shape_at(z))[0], start, method="Nelder-Mead", tol=1e-6)
    assert found == pytest.approx(-other.fun, abs=0.02)
    few = likelihood(series, shape_at(likeliest(series, start, 0.6, 2 * parts + 1, 1e-3, 1e-5)))[0]
    corners = [start, *(start + 0.6 * unit for unit in np.eye(2 * parts))]
    assert few == pytest.approx(max(likelihood(series, shape_at(z))[0] for z in corners))


def test_coordinates_of_a_search_stand_for_ratios_and_times_within_bounds() -> None:
    shape = shape_at(np.array([math.log(3.0), 0.0, -99.0, 99.0]))
    assert shape[0] == pytest.approx(3.0) and shape[1] == pytest.approx(math.sqrt(3e-4 * 1.0))
    assert shape[2] == pytest.approx(math.exp(-12.0)) and shape[3] == pytest.approx(1.0)
    one = shape_at(np.array([99.0, -99.0]))
    assert one == pytest.approx([math.exp(14.0), 3e-4, 0.0, 1e-2])


@pytest.mark.parametrize("begin", [(0.5, -2.0), (-3.0, 4.0), (4.0, 0.0), (0.5, -2.0, 0.0, 1.0), (2.0, 3.0, -1.0, -4.0)])
def test_every_corner_of_the_simplex_goes_where_scipys_does(begin: tuple[float, ...]) -> None:
    """From one simplex to the same numbers: every reflection, expansion, contraction and shrinking is the same."""
    random = np.random.default_rng(7)
    values = np.cumsum(random.normal(0.0, 0.2, 400)) + random.standard_normal(400)
    series = Series(values, np.ones(400, bool), np.array([0, 400]), np.ones(1), SPACING_S, 400)
    start = np.array(begin)
    simplex = np.array([start, *(start + 0.6 * unit for unit in np.eye(start.size))])
    asked: list[Floats] = []

    def minus(z: Floats) -> float:
        asked.append(z.copy())
        return -float(likelihood(series, shape_at(z))[0])

    options = {"initial_simplex": simplex, "xatol": 1e-2, "fatol": 1e-3, "maxfev": 10_000, "maxiter": 10_000}
    other = minimize(minus, start, method="Nelder-Mead", options=options)
    found = likeliest(series, start, 0.6, 10_000, 1e-2, 1e-3)
    np.testing.assert_allclose(found, other.x, rtol=1e-9, atol=1e-12)
    assert len(asked) > 40
    # cut off after so many evaluations it is at the best of those
    for most in (start.size + 1, 12, 25, 40):
        cut = likelihood(series, shape_at(likeliest(series, start, 0.6, most, 1e-2, 1e-3)))[0]
        best = max(likelihood(series, shape_at(z))[0] for z in asked[:most])
        assert cut == pytest.approx(best, abs=1e-9)

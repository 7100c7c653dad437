"""Means, trends and the scatter beyond the shots' own uncertainties, against closed forms and another solver."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty.series_statistics import Trend, _mean, _trend, _weighted, excess_spread


def _excess(values: np.ndarray, stds: np.ndarray, at: np.ndarray | None) -> float:
    """Return the same by numpy's own polynomial fit and scipy's root."""
    degree = 0 if at is None else 1
    x = np.arange(values.size, dtype=float) if at is None else at

    def beyond(excess: float) -> float:
        weights = 1 / np.hypot(stds, excess)
        left = values - np.polyval(np.polyfit(x, values, degree, w=weights), x)
        return float(np.sum((left * weights) ** 2)) - (values.size - degree - 1)

    return 0.0 if beyond(0.0) <= 0 else float(brentq(beyond, 0.0, 10 * np.ptp(values)))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12), st.booleans())
def test_it_is_the_spread_with_which_the_squares_are_their_degrees_of_freedom(seed, count, trended) -> None:
    random = np.random.default_rng(seed)
    stds, at = random.uniform(0.5, 2.0, count), np.sort(random.uniform(-1, 1, count))
    values = random.normal(0.0, np.hypot(stds, 1.5)) + 3 * at
    found = excess_spread(values, stds, int(trended), at if trended else None)
    assert found == pytest.approx(_excess(values, stds, at if trended else None), rel=1e-6, abs=1e-9)


def test_without_uncertainties_it_is_the_standard_deviation_and_of_too_few_it_is_not_known() -> None:
    values = np.array([1.0, 2.0, 4.0])
    assert excess_spread(values, np.zeros(3)) == pytest.approx(np.std(values, ddof=1))
    assert excess_spread(values, np.full(3, 1e3)) == 0.0 == excess_spread(np.full(3, 7.0), np.zeros(3))
    assert math.isnan(excess_spread(values[:1], np.ones(1))) and math.isnan(excess_spread(values[:2], np.ones(2), 1))
    assert excess_spread(values[:2], np.zeros(2)) == pytest.approx(np.sqrt(0.5))


def test_a_mean_is_weighted_by_uncertainty_and_spread() -> None:
    values, stds = np.array([1.0, 3.0]), np.array([1.0, 2.0])
    mean = _mean(values, stds, 0.0)
    assert isinstance(mean, Quantity)
    assert (mean.value, mean.std) == pytest.approx(((1 + 3 / 4) / 1.25, 1 / np.sqrt(1.25)))
    wide = _mean(values, stds, 1e3)
    assert isinstance(wide, Quantity) and wide.value == pytest.approx(2.0, abs=1e-5)
    assert wide.std == pytest.approx(1e3 / np.sqrt(2), rel=1e-5)
    plain = _mean(values, np.zeros(2), 0.0)
    assert isinstance(plain, Quantity) and (plain.value, plain.std) == (2.0, 0.0)


def test_a_trend_is_the_weighted_line_about_the_mean_speed() -> None:
    at, values, stds = np.array([0.2, 0.3, 0.4, 0.45]), np.array([1.0, 1.3, 1.2, 1.6]), np.array([0.3, 0.1, 0.2, 0.4])
    found = _trend(at, values, stds)
    assert isinstance(found, Trend) and found.repeatability == 0.0
    line, covariance = np.polyfit(at - at.mean(), values, 1, w=1 / stds, cov="unscaled")
    assert (found.slope.value, found.at_mean_speed.value) == pytest.approx(tuple(line))
    assert (found.slope.std, found.at_mean_speed.std) == pytest.approx(tuple(np.sqrt(np.diag(covariance))))
    assert found.mean_speed_m_per_s == pytest.approx(at.mean())
    assert found.at(0.5) == pytest.approx(np.polyval(line, 0.5 - at.mean()))
    assert found.significance == pytest.approx(abs(line[0]) / np.sqrt(covariance[0, 0]))
    both = _trend(at[:2], values[:2], stds[:2])  # the line through two shots
    assert isinstance(both, Trend) and both.slope.value == pytest.approx(3.0) and math.isnan(both.repeatability)
    for of, why in (
        ((at[:1], values[:1], stds[:1]), "one shot"),
        ((np.full(3, 0.3), values[:3], stds[:3]), "all shots at one speed"),
        ((at[:2], values[:2], np.zeros(2)), "no uncertainty is known"),
    ):
        none = _trend(*of)
        assert isinstance(none, NotSeen) and none.reason == why


def test_a_weighted_fit_without_a_weight_has_no_solution() -> None:
    solution, covariance, squares = _weighted(np.ones((2, 1)), np.array([1.0, 2.0]), np.array([0.0, 1.0]))
    assert not solution.any() and not covariance.any() and squares == math.inf

"""Means, repeatability and trends over simulated shots."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty import series_statistics as table
from analysis.uncertainty.numbers import read_number
from analysis.uncertainty.series_statistics import Trend, excess_spread, series
from tests.analysis.shots import at_speed, shot_of


def test_excess_spread_finds_what_was_put_in() -> None:
    rng = np.random.default_rng(5)
    found = []
    for _ in range(200):
        stds = rng.uniform(0.5, 2.0, 12)
        values = 7.0 + rng.normal(0.0, stds) + rng.normal(0.0, 3.0, 12)
        found.append(excess_spread(values, stds))
    assert float(np.sqrt(np.mean(np.square(found)))) == pytest.approx(3.0, rel=0.06)


def test_excess_spread_is_zero_where_the_noise_explains_the_scatter() -> None:
    rng = np.random.default_rng(6)
    assert excess_spread(7.0 + rng.normal(0.0, 1.0, 40), np.full(40, 2.0)) == 0.0
    assert excess_spread(np.array([1.0, 1.0]), np.zeros(2)) == 0.0
    assert math.isnan(excess_spread(np.array([1.0]), np.array([0.1])))


def test_excess_spread_without_own_uncertainty_is_the_standard_deviation() -> None:
    values = np.array([1.0, 2.0, 4.0, 8.0])
    assert excess_spread(values, np.zeros(4)) == pytest.approx(float(np.std(values, ddof=1)), rel=1e-9)


def test_trend_with_its_uncertainty_covers_the_truth() -> None:
    rng = np.random.default_rng(7)
    inside, pulls = 0, []
    for _ in range(150):
        speeds = rng.uniform(0.05, 0.6, 10)
        shots = [
            at_speed(f"s{i}", v, 0.99 - 0.02 * v + rng.normal(0, 2e-4) + rng.normal(0, 1e-4), 1e-4)
            for i, v in enumerate(speeds)
        ]
        summary = series(shots).of("cor_quasi_static")
        assert summary is not None and isinstance(summary.trend, Trend)
        pulls.append((summary.trend.slope.value + 0.02) / summary.trend.slope.std)
        inside += abs(pulls[-1]) < 2.306  # Student, 8 degrees of freedom, 95 %
    assert 0.90 <= inside / 150 <= 0.99
    assert float(np.std(pulls)) == pytest.approx(1.1, abs=0.15)


def test_peak_force_grows_with_speed_and_cor_does_not() -> None:
    result = series(
        [at_speed("b", 0.3, 0.9876, 1e-6), at_speed("a", 0.1, 0.9876, 1e-6), at_speed("c", 0.5, 0.9876, 1e-6)]
    )
    assert result.shots == ("a", "b", "c")
    force, cor = result.of("force_peak_n"), result.of("cor_quasi_static")
    assert force is not None and isinstance(force.trend, Trend)
    assert force.trend.slope.value == pytest.approx(0.511915 / 0.265, rel=1e-9)
    assert force.trend.at(0.2) == pytest.approx(0.2 * 0.511915 / 0.265, rel=1e-9)
    assert cor is not None and isinstance(cor.trend, Trend)
    assert cor.trend.significance < 1e-3
    assert force.trend.significance == pytest.approx(force.trend.slope.value / force.trend.slope.std, rel=1e-12)
    assert cor.repeatability == 0.0


def test_mean_is_weighted_by_the_uncertainties() -> None:
    shots = [at_speed("a", 0.3, 0.98, 1e-4), at_speed("b", 0.3, 0.981, 1e-2)]
    summary = series(shots).of("cor_quasi_static")
    assert summary is not None and isinstance(summary.mean, Quantity)
    assert summary.mean.value == pytest.approx(0.9800001, abs=1e-6)
    assert summary.mean.std == pytest.approx(1e-4, rel=1e-3)
    assert isinstance(summary.trend, NotSeen) and "one speed" in summary.trend.reason


def test_numbers_not_seen_are_left_out() -> None:
    lost = replace(shot_of("lost"), impact=None, fit=None, problem="no impact")
    unfitted = replace(at_speed("unfitted", 0.2, 0.98, 1e-4), fit=None)
    result = series([lost, unfitted, shot_of("whole")])
    assert result.shots == ("unfitted", "whole")
    stiffness = result.of("plate_stiffness_n_per_m")
    assert stiffness is not None and stiffness.shots == ("whole",)
    assert math.isnan(stiffness.scatter) and isinstance(stiffness.trend, NotSeen)
    assert isinstance(read_number(lost, "cor_impulse"), NotSeen)
    with pytest.raises(KeyError):
        read_number(lost, "flags")


def test_rows_and_result_hold_no_nan() -> None:
    result = series([shot_of("one")])
    json.dumps(table.series_result(result), allow_nan=False)
    rows = table.series_rows(result)
    assert rows[0] == list(table.COLUMNS)
    assert all(len(row) == len(rows[0]) for row in rows)
    assert "nan" not in {cell for row in rows for cell in row}
    assert series([]).summaries == ()


@pytest.mark.parametrize("spread", [0.0, 1e-4, 1e-3])
def test_a_mean_scatters_as_its_uncertainty_says_whatever_the_shots_scatter_beyond_their_own(spread: float) -> None:
    """Own uncertainties that differ tenfold; 300 sets of 16 shots at one speed."""
    rng = np.random.default_rng(8)
    values, stds = [], []
    for _ in range(300):
        own = rng.uniform(0.3e-4, 3e-4, 16)
        cors = 0.98 + rng.normal(0.0, own) + rng.normal(0.0, 1.0, 16) * spread
        summary = series([at_speed(f"s{i}", 0.3, c, s) for i, (c, s) in enumerate(zip(cors, own, strict=True))]).of(
            "cor_quasi_static"
        )
        assert summary is not None and isinstance(summary.mean, Quantity)
        values.append(summary.mean.value)
        stds.append(summary.mean.std)
    assert 0.9 < float(np.std(values, ddof=1) / np.sqrt(np.mean(np.square(stds)))) < 1.1


def test_the_scatter_of_a_few_shots_is_that_of_a_sample_and_of_one_is_not_known() -> None:
    shots = [at_speed(f"s{k}", 0.26, cor, 1e-9) for k, cor in enumerate((0.986, 0.988, 0.993))]
    found = series(shots).of("cor_quasi_static")
    assert found is not None and found.scatter == pytest.approx(np.sqrt((3e-3**2 + 1e-3**2 + 4e-3**2) / 2.0))
    alone = series(shots[:1]).of("cor_quasi_static")
    assert alone is not None and np.isnan(alone.scatter) and np.isnan(alone.repeatability)

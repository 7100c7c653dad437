"""The random walk of the optical path, read from flight: its strength, and nothing of noise or of a push."""

import numpy as np
import pytest

from analysis.shot.shot import AnalysisError
from analysis.signal.noise import local_variance, noise_of_column, random_walk_growth, white_noise

RATE_HZ, STD_M = 1e5, 1e-10
SAMPLES = 6000


def _walk(w: float, seed: int) -> float:
    """Return what is read of a flight with so strong a walk (m/s^0.5), pushed in its middle."""
    random = np.random.default_rng(seed)
    path = np.cumsum(random.normal(0.0, w / np.sqrt(RATE_HZ), SAMPLES)) + random.normal(0.0, STD_M, SAMPLES)
    acceleration = np.zeros(SAMPLES)
    acceleration[2500:3300] = 1e6 * (-1.0) ** seed  # a push, or a pull
    path[2500:3300] += 1e-6 * np.sin(np.linspace(0.0, np.pi, 800))
    path -= 0.2 * np.arange(SAMPLES) / RATE_HZ
    return random_walk_growth(path, np.full(SAMPLES, STD_M), acceleration, np.full(SAMPLES, 1.0), RATE_HZ)


def test_white_noise_is_hardly_ever_taken_for_a_walk() -> None:
    assert sum(_walk(0.0, seed) > 0.0 for seed in range(100)) <= 6


@pytest.mark.parametrize("w", [3.4e-9, 1e-8, 1e-7])  # from twice the variance of the white noise on
def test_a_walk_has_its_strength(w: float) -> None:
    found = np.array([_walk(w, seed) for seed in range(40)])
    assert float(np.median(found)) == pytest.approx(w, rel=0.1)
    assert np.all((found > 0.6 * w) & (found < 1.5 * w))


def test_a_flight_too_short_to_tell_has_none() -> None:
    calm = np.zeros(1000)
    assert random_walk_growth(calm, np.full(1000, STD_M), calm, np.ones(1000), RATE_HZ) == 0.0
    assert random_walk_growth(calm[:50], np.full(50, STD_M), np.full(50, 1e9), np.ones(50), RATE_HZ) == 0.0


@pytest.mark.parametrize("std", [1e-3, 5.0])
def test_white_noise_is_read_from_third_and_from_fourth_differences_under_a_smooth_motion(std: float) -> None:
    t = np.linspace(0.0, 1.0, 20_000)
    values = 40 * std * np.sin(9 * t) + np.random.default_rng(4).normal(0.0, std, t.size)
    assert white_noise(np.diff(values, 3)) == pytest.approx(std, rel=0.04)
    assert noise_of_column(values, "x") == pytest.approx(std, rel=0.04)
    values[::500] += 1e3 * std  # a few loud samples do not move it
    assert white_noise(np.diff(values, 3)) == pytest.approx(std, rel=0.06)
    assert white_noise(np.empty(0)) == 0.0


def test_a_rounded_column_is_as_noisy_as_its_rounding_at_least() -> None:
    column = np.round(np.linspace(0.0, 3.0, 4000), 1)
    assert noise_of_column(column, "x") == pytest.approx(0.1 / np.sqrt(12.0))
    for spoilt, words in ((np.full(50, 2.0), "x: constant at 2"), (np.arange(11.0), "x: too few rows")):
        with pytest.raises(AnalysisError, match=words):
            noise_of_column(spoilt, "x")
    assert noise_of_column(np.arange(12.0) ** 2, "x") == 1e-30  # a parabola has none


def test_local_variance_is_that_of_each_512_samples_between_their_centres() -> None:
    random = np.random.default_rng(5)
    size = np.repeat([1.0, 4.0, 2.0], 512)
    found = local_variance((size * random.normal(size=size.size)) ** 2)
    centres = np.array([256, 768, 1280])
    assert found[centres] == pytest.approx([1.0, 16.0, 4.0], rel=0.3)
    assert found[512] == pytest.approx(0.5 * (found[256] + found[768]), rel=1e-3) and found[0] == found[256]
    few = (size * random.normal(size=size.size)) ** 2
    few[512:1016] = np.nan  # eight are left of the second: too few
    assert local_variance(few)[768] == pytest.approx(0.5 * (local_variance(few)[256] + local_variance(few)[1280]))
    assert np.isnan(local_variance(np.full(600, np.nan))).all()

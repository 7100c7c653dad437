"""The random walk of the optical path, read from flight: its strength, and nothing of noise or of a push."""

import numpy as np
import pytest

from analysis.signal.noise import wander

RATE_HZ, STD_M = 1e5, 1e-10
SAMPLES = 6000


def _walk(w: float, seed: int) -> float:
    """Return what is read of a flight with so strong a walk (m/s^0.5), pushed in its middle."""
    random = np.random.default_rng(seed)
    path = np.cumsum(random.normal(0.0, w / np.sqrt(RATE_HZ), SAMPLES)) + random.normal(0.0, STD_M, SAMPLES)
    acceleration = np.zeros(SAMPLES)
    acceleration[2500:3300] = 1e6
    path[2500:3300] += 1e-6 * np.sin(np.linspace(0.0, np.pi, 800))
    path -= 0.2 * np.arange(SAMPLES) / RATE_HZ
    return wander(path, np.full(SAMPLES, STD_M), acceleration, np.full(SAMPLES, 1.0), RATE_HZ)


def test_white_noise_is_hardly_ever_taken_for_a_walk() -> None:
    assert sum(_walk(0.0, seed) > 0.0 for seed in range(100)) <= 6


@pytest.mark.parametrize("w", [1e-8, 1e-7])
def test_a_walk_has_its_strength(w: float) -> None:
    found = np.array([_walk(w, seed) for seed in range(40)])
    assert float(np.median(found)) == pytest.approx(w, rel=0.1)
    assert np.all((found > 0.6 * w) & (found < 1.5 * w))


def test_a_flight_too_short_to_tell_has_none() -> None:
    calm = np.zeros(1000)
    assert wander(calm, np.full(1000, STD_M), calm, np.ones(1000), RATE_HZ) == 0.0
    assert wander(calm[:50], np.full(50, STD_M), np.full(50, 1e9), np.ones(50), RATE_HZ) == 0.0

"""The octaves of a floor: what one of unit velocity means, and that together they leave no gap."""

import numpy as np
import pytest

from analysis.reading.floor_spectrum import STILL_BELOW_HZ, Octaves, waves_of

OCTAVES = Octaves.of(np.arange(0.0, 0.5, 1 / 800), 1 / 800)


def test_octaves_of_one_velocity_have_it_in_every_octave_above_the_slow_ones() -> None:
    for low in (STILL_BELOW_HZ, 20.0, 133.0):
        f = np.geomspace(low, 2 * low, 2001)
        velocity = OCTAVES.density(np.ones(OCTAVES.centre_hz.size), f) * (2 * np.pi * f) ** 2
        assert np.trapezoid(velocity, f) == pytest.approx(1.0, rel=1e-5)
    slow = np.array([0.5, 1.0]) * STILL_BELOW_HZ  # there the velocity falls with the frequency
    density = OCTAVES.density(np.ones(OCTAVES.centre_hz.size), slow)
    assert density[0] == pytest.approx(2.0 * density[1], rel=1e-12)


def test_an_octave_acts_about_its_centre_and_not_beyond_its_neighbours() -> None:
    centre = OCTAVES.centre_hz
    for k in (0, 2, centre.size - 1):
        alone = np.eye(centre.size)[k]
        shares = OCTAVES.density(alone, centre) / OCTAVES.density(np.ones(centre.size), centre)
        assert shares == pytest.approx(alone, abs=1e-12)
    lowest = np.eye(centre.size)[0]
    below = np.array([1e-2, 0.5]) * centre[0]  # beyond the outermost centre its octave goes on alone
    assert OCTAVES.density(lowest, below) == pytest.approx(OCTAVES.density(np.ones(centre.size), below), rel=1e-12)


def test_frequencies_reach_the_highest_asked_for_and_lie_closer_than_flights_resolve() -> None:
    f = OCTAVES.frequency_hz
    assert f[0] < 0.25 / 0.5 and f[-2] < 400.0 <= f[-1]
    assert np.diff(f).max() < 1.0 / 0.5
    power = OCTAVES.power_m2.sum(axis=0) * (2 * np.pi * f) ** 2
    assert power[(f > 20.0) & (f < 320.0)].sum() == pytest.approx(4.0, rel=0.02)  # four octaves


def test_a_wave_seen_through_means_is_the_mean_of_its_samples() -> None:
    step, each = 1e-4, 7
    sample = (np.arange(each) - (each - 1) / 2) * step
    time, frequency = np.array([0.0, 0.0123]), np.array([3.0, 90.0, 1100.0])
    cosine, sine = waves_of(time, each, step, frequency)
    angle = 2 * np.pi * (time[:, None] + sample)[:, None, :] * frequency[:, None]
    assert cosine == pytest.approx(np.cos(angle).mean(axis=2), abs=1e-12)
    assert sine == pytest.approx(np.sin(angle).mean(axis=2), abs=1e-12)

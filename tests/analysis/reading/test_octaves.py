"""The octaves of a floor: what one of unit velocity means, and that together they leave no gap."""

import numpy as np
import pytest

from analysis.reading.floor_spectrum import STILL_BELOW_HZ, FloorSpectrum, Octaves, waves_of

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


def test_octaves_reach_from_a_third_of_a_period_in_the_span_to_what_bins_resolve() -> None:
    time_s, bin_s = np.concatenate([np.arange(0.0, 0.01, 5e-4), np.arange(0.04, 0.06, 5e-4)]), 5e-4
    octaves = Octaves.of(time_s, bin_s)
    span_s, flown_s = 0.06, time_s.size * bin_s
    assert octaves.centre_hz[0] == pytest.approx(0.35 / span_s)
    assert octaves.centre_hz[1:] == pytest.approx(2.0 * octaves.centre_hz[:-1])
    assert 0.7 < octaves.centre_hz[-1] * 2.0 / 1000.0 < 1.42  # the next would lie beyond
    f = octaves.frequency_hz
    assert f[0] == pytest.approx(0.1 / span_s)
    assert np.diff(f) == pytest.approx(np.clip(0.03 * f[:-1], 0.45 / span_s, 0.6 / flown_s))
    assert Octaves.of(np.array([0.0, 5e-4]), 5e-4).centre_hz.size == 3
    assert STILL_BELOW_HZ == 8.0  # of the criteria's curves


LEVELS = np.linspace(1.0, 3.0, OCTAVES.centre_hz.size) * 1e-12
FLOOR = FloorSpectrum(OCTAVES, 1.25 * LEVELS, 3e-10, 1e5)
POWER = 1.25 * LEVELS @ OCTAVES.power_m2  # of each sine
OMEGA = 2 * np.pi * OCTAVES.frequency_hz


def moved(weights: np.ndarray, at_s: np.ndarray) -> float:
    """Return the std of a weighted sum of the floor's places at instants."""
    return float(np.sqrt(POWER @ np.abs(np.exp(1j * OMEGA[:, None] * at_s) @ weights) ** 2))


def test_how_far_a_floor_moves_is_the_sum_over_its_sines() -> None:
    for order, weights in ((1, [-1, 1]), (2, [1, -2, 1]), (3, [-1, 3, -3, 1])):
        at = 7e-3 * np.arange(order + 1)
        assert FLOOR.difference_std_m(7e-3, order) == pytest.approx(moved(np.array(weights), at), rel=1e-9)
    assert FLOOR.difference_std_m(7e-3) == FLOOR.difference_std_m(7e-3, 1)
    assert FLOOR.rms_m == pytest.approx(np.sqrt(POWER[OCTAVES.frequency_hz > 2 * OCTAVES.centre_hz[0]].sum()))
    vibration = FLOOR.vibration
    assert vibration.power_m2 == pytest.approx(POWER) and np.array_equal(vibration.frequency_hz, OCTAVES.frequency_hz)
    assert vibration.random.all()


@pytest.mark.parametrize("degree", [1, 2])
def test_the_end_of_a_stretch_lies_off_its_polynomial_as_its_sines_do(degree: int) -> None:
    at = np.linspace(0.0, 9e-3, 33)
    off = []
    for omega in OMEGA:
        waves = np.stack([np.cos(omega * at), np.sin(omega * at)], axis=1)
        off.append(waves[-1] - np.polynomial.polynomial.polyvander(at[-1:] / 9e-3, degree) @ np.linalg.lstsq(
            np.polynomial.polynomial.polyvander(at / 9e-3, degree), waves, rcond=None)[0])  # fmt: skip
    expected = np.sqrt(POWER @ np.sum(np.square(off), axis=(1, 2)))
    assert FLOOR.end_std_m(9e-3, degree) == pytest.approx(expected, rel=1e-6)


def test_a_density_has_the_white_noise_of_samples_and_the_mixtures_floor_even_below_its_slowest_sine() -> None:
    f = np.array([1e-3, 20.0, 300.0])
    floor = 1.25 * OCTAVES.density(LEVELS, np.maximum(f, OCTAVES.frequency_hz[0]))
    assert FLOOR.psd(f) == pytest.approx(2 * (3e-10) ** 2 / 1e5 + floor, rel=1e-12)


@pytest.mark.parametrize(
    ("at_s", "weights"), [((0.0,), (1.0,)), ((0.01, 0.05), (-1.0, 1.0)), ((0.0, 1e-4), (-1.0, 1.0))]
)
def test_the_floors_velocities_at_instants_share_what_is_slow(
    at_s: tuple[float, ...], weights: tuple[float, ...]
) -> None:
    f = np.linspace(0.5, 400.0, 40_000)
    seen = np.abs(np.exp(2j * np.pi * f[:, None] * np.array(at_s)) @ np.array(weights)) ** 2
    density = (FLOOR.psd(f) - 2 * (3e-10) ** 2 / 1e5) * (2 * np.pi * f) ** 2
    expected = np.sqrt(np.trapezoid(density * seen, f))
    assert FLOOR.velocity_std_m_per_s(at_s, weights, 400.0) == pytest.approx(expected, rel=0.02)

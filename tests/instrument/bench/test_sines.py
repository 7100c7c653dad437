"""Sums of sines against their plain sum, and the interpolants against polynomials of their degree."""

import numpy as np
import pytest

from instrument.bench.sines import (
    PATH_HIGHEST_HZ,
    PATH_LOWEST_HZ,
    Sines,
    interpolate,
    interpolate_with_slope,
    path_vibration,
)

OMEGA, SIZE, PHASE = np.array([2.0, 31.0, 1570.0]), np.array([3e-6, 2e-7, 5e-9]), np.array([0.3, -2.0, 1.1])
SINES = Sines(OMEGA, SIZE, PHASE)


def _summed(time_s, order):
    turned = OMEGA * time_s[:, None] + PHASE + order * np.pi / 2
    return np.sum(SIZE * OMEGA**order * np.sin(turned), axis=1)


@pytest.mark.parametrize("begin_s", [0.0, 0.14, 37.7, 3600.0])
def test_motion_is_the_sum_of_the_sines_and_its_slope_wherever_it_is_asked_for(begin_s):
    time_s = begin_s + np.arange(4000) * 1.3e-4  # over several stretches of nodes
    x, v = SINES.motion(time_s)
    assert x == pytest.approx(_summed(time_s, 0), rel=0, abs=2e-7 * 5e-9 + 1e-15)
    assert v == pytest.approx(_summed(time_s, 1), rel=0, abs=2e-6 * 5e-9 * 1570)


def test_two_sums_and_no_sines_at_all():
    none = Sines(*(np.empty(0) for _ in range(3)))
    time_s = np.array([0.0, 0.01])
    assert [part.tolist() for part in none.motion(time_s)] == [[0.0, 0.0], [0.0, 0.0]]
    assert SINES.plus(none).motion(time_s)[0] == pytest.approx(SINES.motion(time_s)[0])
    assert SINES.plus(SINES).motion(time_s)[0] == pytest.approx(2 * SINES.motion(time_s)[0])


def test_a_stream_sums_each_stretch_once_and_keeps_the_newest_two():
    sums, stretch_s = Sines(SINES.omega, SINES.amplitude_m, SINES.phase), 512 * SINES._nodes[0]
    for at in np.arange(0.1, 5.0, 0.3):
        sums.motion(np.array([at * stretch_s, (at + 0.05) * stretch_s]))
        kept = {k: id(sums._stretches[k]) for k in sums._stretches}
        assert int(at) in kept and max(kept) - min(kept) < 2 and len(kept) <= 2
        sums.motion(np.array([at * stretch_s]))
        assert kept == {k: id(sums._stretches[k]) for k in sums._stretches}


def test_acceleration_and_its_rate_are_the_second_and_third_derivative():
    a, jerk = SINES.acceleration(1e-3, 300)
    time_s = np.arange(300) * 1e-3
    assert a == pytest.approx(_summed(time_s, 2), rel=0, abs=1e-12 * np.abs(a).max())
    assert jerk == pytest.approx(_summed(time_s, 3), rel=0, abs=1e-12 * np.abs(jerk).max())


def test_a_cubic_is_interpolated_without_error_between_uneven_nodes():
    cubic = np.polynomial.Polynomial([1.0, -2.0, 3.0, 0.5])
    nodes = np.array([0.0, 0.1, 0.1, 0.5, 2.0])  # one event at the time of another: two nodes at once
    time_s = np.array([0.0, 0.05, 0.1, 0.3, 0.5, 1.9, 2.0])
    x, v = interpolate_with_slope(nodes, cubic(nodes), cubic.deriv()(nodes), time_s)
    assert x == pytest.approx(cubic(time_s), rel=1e-13) and v == pytest.approx(cubic.deriv()(time_s), rel=1e-12)
    assert np.array_equal(interpolate(nodes, cubic(nodes), cubic.deriv()(nodes), time_s), x)


def test_the_vibration_of_the_path_has_the_stated_size_band_and_slope():
    drawn = [path_vibration(3e-10, seed) for seed in range(300)]
    frequency = np.array([sines.omega for sines in drawn]) / (2 * np.pi)
    power = np.array([sines.amplitude_m for sines in drawn]) ** 2 / 2
    assert power.sum(axis=1) / 9e-20 == pytest.approx(1.0, rel=1e-12)
    assert PATH_LOWEST_HZ <= frequency.min() < 4.3 and 750 < frequency.max() <= PATH_HIGHEST_HZ
    # of the amplitude density: power in bands of equal ratio falls as their frequency
    level = [power[:, part].sum(axis=1).mean() * frequency[:, part].mean() for part in np.split(np.arange(64), 4)]
    assert level / np.mean(level) == pytest.approx(1.0, rel=0.15)
    phase = np.array([sines.phase for sines in drawn])
    assert abs(np.exp(1j * phase).mean()) < 0.03 and np.ptp(phase) > 6.2
    assert np.array_equal(path_vibration(1e-9, 3).omega, drawn[3].omega)

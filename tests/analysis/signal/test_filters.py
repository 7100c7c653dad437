import numpy as np
import pytest

from analysis.signal.filters import (
    decimator_taps,
    derivative_filters,
    derivative_gains,
    derivatives,
    first_run,
    stretches,
)

RATE = 100e3
BANDWIDTH = 10e3


def test_polynomials_come_out_exact_also_at_the_edges() -> None:
    t = np.arange(400) / RATE
    u = (t - 2e-3) / 1e-3
    velocity, acceleration = derivatives(1e-3 * (1 + 2 * u - 3 * u**2 + 0.5 * u**3), RATE, BANDWIDTH)
    assert np.allclose(velocity, 2 - 6 * u + 1.5 * u**2, atol=1e-9)
    assert np.allclose(acceleration, 1e3 * (-6 + 3 * u), atol=1e-3)


def _response(taps: np.ndarray, frequency_hz: float) -> complex:
    n = np.arange(taps.size) - taps.size // 2
    return complex(np.sum(taps * np.exp(2j * np.pi * frequency_hz / RATE * n)))


def test_flat_in_the_pass_band_and_quiet_beyond() -> None:
    filters = derivative_filters(RATE, BANDWIDTH)
    for frequency, tolerance in ((25, 2e-8), (1e3, 2e-3), (5e3, 4e-3)):
        omega = 2 * np.pi * frequency
        assert _response(filters.velocity, frequency) / (1j * omega) == pytest.approx(1, abs=tolerance)
        assert _response(filters.acceleration, frequency) / -(omega**2) == pytest.approx(1, abs=tolerance)
    at = abs(_response(filters.velocity, BANDWIDTH)) / (2 * np.pi * BANDWIDTH)
    assert at == pytest.approx(0.5, abs=0.08)
    for frequency in (16e3, 25e3, 45e3):
        assert abs(_response(filters.velocity, frequency)) < 2e-3 * 2 * np.pi * frequency
        assert abs(_response(filters.acceleration, frequency)) < 2e-3 * (2 * np.pi * frequency) ** 2


def test_gains_are_those_of_white_noise_and_of_a_walk() -> None:
    random = np.random.default_rng(2)
    finite = np.ones(300, bool)
    white = random.normal(0, 1, (4000, 300))
    walk = np.cumsum(white, axis=1) / np.sqrt(RATE)
    for noise, is_walk in ((white, False), (walk, True)):
        results = [derivatives(row, RATE, BANDWIDTH) for row in noise]
        for which in (0, 1):
            scatter = np.std([r[which] for r in results], axis=0)
            assert scatter == pytest.approx(derivative_gains(finite, RATE, BANDWIDTH, is_walk)[which], rel=0.06)


def test_a_gap_separates_stretches_and_short_ones_give_nan() -> None:
    x = np.linspace(0, 1, 500)
    x[200:210] = np.nan
    x[230:240] = np.nan
    velocity, _ = derivatives(x, RATE, BANDWIDTH)
    assert np.isnan(velocity[200:240]).all() and np.isfinite(velocity[:200]).all() and np.isfinite(velocity[240:]).all()
    assert np.array_equal(np.isnan(derivative_gains(np.isfinite(x), RATE, BANDWIDTH)[0]), np.isnan(velocity))


@pytest.mark.parametrize("factor", [2, 3, 10, 30, 120])
def test_decimated_white_noise_is_white_and_parabolas_pass(factor: int) -> None:
    taps = decimator_taps(factor, 0.0)
    n = np.arange(taps.size) - taps.size // 2
    assert np.sum(taps) == pytest.approx(1) and (factor == 2 or abs(np.sum(taps * n**2)) < 1e-6 * factor**2)
    for lag in (1, 2, 3):
        overlap = np.sum(taps[lag * factor :] * taps[: -lag * factor]) / np.sum(taps**2)
        assert abs(overlap) < 0.03
    for share, limit in ((0.1, 5e-4), (0.2, 1e-3), (0.3, 1.5e-3)):
        assert np.sum(taps * np.cos(2 * np.pi * share / factor * n)) == pytest.approx(1, abs=limit)
    assert abs(np.sum(taps * np.cos(2 * np.pi * 0.7 / factor * n))) < 2e-2


def test_a_bandwidth_too_wide_for_the_rate_is_refused() -> None:
    with pytest.raises(ValueError, match="bandwidth"):
        derivative_filters(10e3, 5e3)


def test_runs_of_true_and_the_first_that_is_long_enough() -> None:
    mask = np.array([1, 1, 0, 0, 1, 1, 1, 0, 1], bool)
    assert stretches(mask) == [(0, 2), (4, 7), (8, 9)] and stretches(~mask) == [(2, 4), (7, 8)]
    assert [first_run(mask, length) for length in (1, 2, 3, 4)] == [0, 0, 4, None]
    assert stretches(np.zeros(3, bool)) == [] and first_run(np.ones(3, bool), 3) == 0


@pytest.mark.parametrize("share", [0.35, 0.1, 0.02])
def test_derivatives_of_high_polynomials_are_exact_and_their_gain_is_that_of_the_taps(share: float) -> None:
    filters = derivative_filters(RATE, share * RATE)
    assert filters.half == max(4, int(np.ceil(3 / share)))
    n = np.arange(-filters.half, filters.half + 1) / RATE
    for power in range(6):
        scale = (filters.half / RATE) ** power
        moment = np.array([filters.velocity @ n**power, filters.acceleration @ n**power]) / scale
        exact = np.array([power == 1, 2 * (power == 2)], float) / [1, 1] / scale * [1, 1]
        if power < 5:
            assert moment[0] == pytest.approx(exact[0], abs=1e-6 * RATE)
        assert moment[1] == pytest.approx(exact[1], abs=1e-6 * RATE**2)
    assert filters.velocity_gain == pytest.approx(np.linalg.norm(filters.velocity))
    assert filters.acceleration_gain == pytest.approx(np.linalg.norm(filters.acceleration))
    assert not filters.velocity.flags.writeable and not filters.edge_acceleration.flags.writeable
    with pytest.raises(ValueError, match="carries at most 35000 Hz"):
        derivative_filters(RATE, 0.3501 * RATE)


@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_a_decimator_passes_cubics_that_were_smoothed_before_and_is_3_db_down_at_half_its_rate(spread: float) -> None:
    taps = decimator_taps(8, spread)
    n = np.arange(-48, 49)
    assert taps.size == 97 and taps == pytest.approx(taps[::-1])
    assert [taps @ n**power for power in (0, 2)] == pytest.approx([1.0, -spread], abs=1e-9)
    assert np.sum(taps * np.cos(2 * np.pi * 0.5 / 8 * n)) == pytest.approx(np.sqrt(0.5), abs=1e-3)

"""What a leak adds to a phase, against the argument of the two phasors' sum."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.signal.phase_errors import Leak, _response, folded_harmonic, leak_phase


@pytest.mark.parametrize("ratio", [0.01, 0.05, 0.1])
def test_to_the_second_order_in_the_ratio(ratio: float) -> None:
    """At a slow Doppler shift, where no filter takes anything off."""
    tuning = SimpleNamespace(window=np.ones(1), decimation=1, spread=0.0, phase_rate_hz=1e6)
    track = SimpleNamespace(spec=SimpleNamespace(tuning=tuning))
    grid = SimpleNamespace(rate_hz=1e6, input_rate_hz=1e6, step=1)
    rest = 0.25 * np.arange(20_000)
    true = rest + np.linspace(0.0, 7.0, rest.size)
    angle = 2 * np.pi * (0.3 + rest - true)
    exact = np.angle(1.0 + ratio * np.exp(1j * angle)) / (2 * np.pi)
    added = leak_phase(Leak(ratio, 0.0, 0.3), true + exact, rest, cast(Any, track), cast(Any, grid))
    third = ratio**3 / (2 * np.pi)
    inside = slice(100, -100)
    assert np.max(np.abs(added - exact)[inside]) < 2.0 * third < 0.5 * ratio**2 / (4 * np.pi)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize(("size", "seen"), [(0.0, False), (0.01, True), (0.03, True)])
def test_a_folded_harmonic_is_the_ripple_of_the_amplitude_relative_to_the_beat(
    order: int, size: float, seen: bool
) -> None:
    rate, motion_rate = 10e6, 1e5
    time_s = np.arange(4000) / motion_rate
    # a beat whose harmonic folds back 12 kHz beside it
    phase = (rate + 12e3) / (order + 1) * time_s + 5e3 * time_s**2
    ripple = 2 * np.pi * ((order + 1) * phase - rate * time_s) + 0.7
    noise = np.random.default_rng(2).normal(0.0, 2.0, time_s.size)
    amplitude = 800.0 * (1 + 0.2 * time_s / 0.04) + 880.0 * size * np.cos(ripple) + noise
    found = folded_harmonic(phase, amplitude, time_s, rate, motion_rate)
    assert found == pytest.approx(size, rel=0.1) if seen else found == 0.0
    phase[60:] = np.nan
    assert folded_harmonic(phase, amplitude, time_s, rate, motion_rate) == 0.0  # of too few samples nothing is said


@pytest.mark.parametrize("frequency", [0.0, 0.1, -0.3, 0.5, 0.9, 1.25])
def test_the_response_of_symmetric_taps_is_their_sum_of_cosines(frequency: float) -> None:
    for taps in (np.hanning(9) / np.hanning(9).sum(), np.array([0.25, 0.5, 0.25]), np.array([0.5, 0.5])):
        n = np.arange(taps.size) - 0.5 * (taps.size - 1)
        wrapped = abs(frequency - round(frequency))
        expected = np.sum(taps * np.cos(2 * np.pi * wrapped * n))
        assert _response(taps, np.array([frequency]))[0] == pytest.approx(expected, abs=2e-3)

"""The rest beat's phase: a frequency that scatters as its ± says, a drift with its sign, and no curve through noise."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signal.rest import RestPhase, fit_rest_phase

Floats = NDArray[np.float64]
TIME_S = np.arange(20_000) * 1e-5 + 0.3
STD = 2e-3  # cycles
OSCILLATOR_HZ = 2.7e6


def _read(phase: Floats, seed: int) -> RestPhase:
    noisy = phase + np.random.default_rng(seed).normal(0.0, STD, TIME_S.size)
    noisy[3000:3200] = np.nan  # a hole
    return fit_rest_phase(TIME_S, noisy, STD, OSCILLATOR_HZ)


def test_a_constant_frequency_scatters_as_its_uncertainty_says_and_is_seen_as_constant() -> None:
    found = [_read(120.0 * TIME_S + 0.2, seed) for seed in range(100)]
    assert sum(rest.degree == 1 for rest in found) >= 99  # a term more is worth five sigma
    off = np.array([(rest.frequency_hz.value - OSCILLATOR_HZ - 120.0) / rest.frequency_hz.std for rest in found])
    assert 0.8 < float(np.sqrt(np.mean(off**2))) < 1.25
    assert abs(float(off.mean())) < 0.4
    assert max(rest.unsteady_cycles for rest in found) < 0.5 * STD


@pytest.mark.parametrize("hz_per_s", [-40.0, 40.0])
def test_a_drift_has_its_sign_and_size_over_the_record_and_the_frequency_is_its_mean(hz_per_s: float) -> None:
    since = TIME_S - TIME_S[0]
    rest = _read(0.5 * hz_per_s * since**2 + 15.0 * since, 1)
    assert rest.degree == 2
    lasts = float(since[-1])
    assert rest.frequency_hz.value == pytest.approx(OSCILLATOR_HZ + 15.0 + 0.5 * hz_per_s * lasts, abs=0.02)
    at = np.array([0.31, 0.45])
    assert rest.phase_at(at) == pytest.approx(0.5 * hz_per_s * (at - 0.3) ** 2 + 15.0 * (at - 0.3), abs=1e-3)


def test_what_no_smooth_curve_follows_is_told_and_makes_the_frequency_less_sure() -> None:
    hum = 0.02 * np.sin(2 * np.pi * 300.0 * TIME_S)
    steady, hummed = _read(np.zeros(TIME_S.size), 2), _read(hum, 2)
    assert hummed.unsteady_cycles > 0.97 * 0.02 / np.sqrt(2.0)
    assert hummed.frequency_hz.std > 5.0 * steady.frequency_hz.std

"""Phases decimated: dot products with every stretch, wherever they were cut, with the power and noise beside them."""

import numpy as np
import pytest

from analysis.signal.decimate import PhaseDecimator, filtered, group_means, noise_ratio
from analysis.signal.filters import decimator_taps
from analysis.signal.tuning import tune

RANDOM = np.random.default_rng(1)
PHASE = np.cumsum(RANDOM.standard_normal(700))
POWER = RANDOM.uniform(1.0, 2.0, 700).astype(np.float32)


@pytest.mark.parametrize("factor", [2, 3, 5, 9])
@pytest.mark.parametrize("first", [0, 1, 7])
def test_outputs_are_dot_products_about_every_factor_th_phase_with_power_and_roughness(factor: int, first: int) -> None:
    decimator = PhaseDecimator(factor, first, 0.3)
    index = -(-first // factor)
    begin = index * factor - first
    taps = decimator_taps(factor, 0.3)
    parts = [decimator.feed(PHASE[a:b], POWER[a:b]) for a, b in ((0, 3), (3, 4), (4, 300), (300, 700))]
    assert parts[0][0] == index
    places = [part[0] for part in parts if part[1].size]
    assert places == list(index + np.cumsum([0, *(part[1].size for part in parts if part[1].size)])[:-1])
    phase = np.concatenate([part[1] for part in parts])
    power, rough = np.concatenate([part[2] for part in parts], axis=1)
    assert phase.size == (700 - begin - taps.size) // factor + 1
    each = max(1, factor // 4)
    for k in range(0, phase.size, 7):
        stretch = slice(begin + k * factor, begin + k * factor + taps.size)
        assert phase[k] == pytest.approx(taps @ PHASE[stretch], rel=1e-9, abs=1e-9)
        near = POWER[stretch][(taps.size - factor) // 2 :][:factor]
        assert power[k] == pytest.approx(near.mean(), rel=1e-5)
        means = PHASE[stretch][(taps.size - 4 * each) // 2 :][: 4 * each].reshape(4, each).mean(axis=1)
        assert rough[k] == pytest.approx(np.diff(means, 3)[0] ** 2 / 20.0, rel=1e-9)


def test_a_phase_is_not_decimated_by_less_than_two() -> None:
    PhaseDecimator(2)
    with pytest.raises(ValueError, match="at least 2, not 1"):
        PhaseDecimator(1)


def test_groups_are_means_and_a_filter_is_a_correlation() -> None:
    phase, power = group_means(PHASE, POWER, 9)
    assert phase == pytest.approx(PHASE[: 77 * 9].reshape(77, 9).mean(axis=1)) and phase.size == 77
    assert power == pytest.approx(POWER[: 77 * 9].reshape(77, 9).mean(axis=1), rel=1e-5)
    taps = RANDOM.standard_normal(12)
    assert filtered(PHASE, taps) == pytest.approx(np.correlate(PHASE, taps, "valid"), rel=1e-9, abs=1e-9)
    assert filtered(PHASE[:12], taps).size == 1 and filtered(PHASE[:11], taps).size == 0


@pytest.mark.parametrize("factor", [3, 8])
def test_the_noise_of_decimated_phases_is_its_ratio_times_the_roughness_beside_them(factor: int) -> None:
    tuning = tune(10e6, 3.2e6, 3.7e6, 150e3, 450e3)
    noise = np.random.default_rng(2).standard_normal(1_000_000)
    fine = np.convolve(noise, tuning.window, "valid")[:: tuning.decimation]
    decimator = PhaseDecimator(factor, 0, tuning.spread)
    _, phase, about = decimator.feed(fine, np.ones(fine.size, np.float32))
    ratio = phase.std() / np.sqrt(about[1].mean())
    assert noise_ratio(tuning, factor) == pytest.approx(ratio, rel=0.05)

"""Whole-number taps: no sum overflows, no phase is turned, and image and noise are those of the exact taps."""

import numpy as np
import pytest

from analysis.signal.integer_taps import IntegerTaps, integer_taps
from analysis.signal.tuning import PHASE_STEPS, Tuning, tune

TUNINGS = [
    tune(30e6, 1.9e6, 3.6e6, 180e3, 450e3),
    tune(30e6, 2.74e6, 2.76e6, 120e3, 200e3),
    tune(10e6, 3.2e6, 3.7e6, 150e3, 450e3),
    tune(10e6, 3.4e6, 3.4e6, 1e6, 2e6),
    tune(10e6, 0.6e6, 0.6e6, 120e3, 200e3),
    tune(30e6, 3.4e6, 3.5e6, 40e3, 100e3),
]


def _whole(tuning: Tuning, offset_counts: float = 0.0) -> tuple[IntegerTaps, np.ndarray]:
    steps = np.array([tuning.steps(f) for f in np.linspace(tuning.low_hz, tuning.high_hz, 20)])
    turns = steps / (PHASE_STEPS * tuning.decimation)
    return integer_taps(tuning.window, turns, offset_counts), turns


def _restored(whole: IntegerTaps, length: int) -> np.ndarray:
    gains = whole.restore.astype(np.float64)
    return gains[:, :1] * whole.taps[:, 0, :length] + 1j * gains[:, 1:2] * whole.taps[:, 1, :length]


@pytest.mark.parametrize("tuning", TUNINGS)
def test_full_scale_cannot_overflow_and_the_scale_is_used(tuning: Tuning) -> None:
    whole, _ = _whole(tuning)
    most = np.abs(whole.taps.astype(np.int64)).sum(axis=2).max(axis=1)
    assert np.all(32768 * most < 2**31)
    assert np.all(most > 0.95 * 65535)
    assert not whole.taps[:, :, tuning.length :].any()


@pytest.mark.parametrize("tuning", TUNINGS)
def test_rounding_shifts_no_phase_passes_no_image_and_adds_no_noise(tuning: Tuning) -> None:
    whole, turns = _whole(tuning)
    taps = _restored(whole, tuning.length)
    position = np.arange(tuning.length) - tuning.delay_samples
    exact = tuning.window * np.exp(-2j * np.pi * turns[:, None] * position)
    image = []
    for away in np.linspace(-1, 1, 21) * tuning.half_width_hz / tuning.sample_rate_hz:
        beat = np.exp(2j * np.pi * (turns[:, None] + away) * position)
        seen, wanted = np.sum(taps * beat, axis=1), np.sum(exact * beat, axis=1)
        assert np.max(np.abs(np.angle(seen / wanted))) < 1e-12
        assert np.max(np.abs(seen / wanted - 1)) < 1e-4
        image.append(np.abs(np.sum(taps * beat.conj(), axis=1) / seen))
    assert np.max(image) < 10 ** (-85 / 20)  # 3 pm
    assert np.max(image[10]) < 2e-7  # none on the oscillator itself
    assert np.max(np.sum(np.abs(taps) ** 2, axis=1) / np.sum(np.abs(exact) ** 2, axis=1)) < 1.0001


def test_a_constant_offset_is_removed() -> None:
    tuning = TUNINGS[0]
    whole, _ = _whole(tuning, 1234.5)
    assert np.allclose(whole.restore[:, 2], 1234.5 * _restored(whole, tuning.length).sum(axis=1).real, atol=1e-4)
    assert not whole.taps[:, 1].sum(axis=1).any()

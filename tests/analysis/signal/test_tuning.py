"""What a band-pass promises: image and folded noise, its rate, its oscillators, and the schedule of a moving beat."""

import numpy as np
import pytest

from analysis.shot.shot import AnalysisError, AnalysisSettings
from analysis.signal.demodulation_plan import _divided, _rounded, _tune, demodulation_plans
from analysis.signal.survey import survey
from analysis.signal.tuning import (
    ALIAS_LIMIT,
    BATCH,
    IMAGE_REJECTION_DB,
    PHASE_STEPS,
    _window,
    fixed_schedule,
    following_schedule,
    tune,
)
from tests.analysis.signal.beats import collision, make_recording

ASKED = [
    (10e6, 3.2e6, 3.7e6, 150e3, 450e3, 0),
    (10e6, 3.4e6, 3.4e6, 1e6, 2e6, 0),
    (30e6, 3.2e6, 3.7e6, 150e3, 450e3, 0),
    (30e6, 2.7e6, 2.7e6, 60e3, 200e3, 300),
    (2e6, 0.55e6, 0.65e6, 50e3, 150e3, 0),
]


def _response(window: np.ndarray, frequency_hz: np.ndarray, rate_hz: float) -> np.ndarray:
    n = np.arange(window.size) - 0.5 * (window.size - 1)
    return np.abs(np.exp(-2j * np.pi * np.outer(frequency_hz / rate_hz, n)) @ window)


@pytest.mark.parametrize("asked", ASKED)
def test_image_and_folded_noise_stay_below_their_limits_in_the_whole_band(asked) -> None:
    rate, low, high, half, least, divides = asked
    tuning = tune(*asked)
    window = tuning.window
    assert window.sum() == pytest.approx(1.0) and window == pytest.approx(window[::-1], abs=1e-12)
    assert tuning.phase_rate_hz >= max(least, 2.4 * half) and (not divides or divides % tuning.decimation == 0)
    assert not window.flags.writeable and tuning.length == window.size <= 4096
    off = np.linspace(-half, half, 41)
    kept = _response(window, off, rate)
    assert kept.min() >= 0.45  # half of the amplitude, but for what lies between two frequencies of the search
    for oscillator in np.linspace(low, high, 7):
        image = -(oscillator + off) - oscillator  # where the image of a real beat lies in the mixed signal
        assert 20 * np.log10(_response(window, image, rate) / kept).max() < -IMAGE_REJECTION_DB + 0.5
    folds = off[:, None] + np.arange(1, tuning.decimation) * tuning.phase_rate_hz
    folded = (_response(window, folds.ravel(), rate) ** 2).reshape(folds.shape).sum(axis=1)
    assert (folded / kept**2).max() <= 1.02 * ALIAS_LIMIT


@pytest.mark.parametrize("asked", ASKED[:3])
def test_a_window_averages_noise_and_smooths_a_parabola_as_it_says(asked) -> None:
    tuning = tune(*asked)
    noise = np.random.default_rng(1).normal(size=200_000 + tuning.length)
    averaged = np.convolve(noise, tuning.window, "valid")
    assert 1 / averaged.var() == pytest.approx(tuning.effective_samples, rel=0.1)
    n = np.arange(4.0 * tuning.length)
    smoothed = np.convolve(n**2, tuning.window, "valid")
    centre = n[: smoothed.size] + tuning.delay_samples
    assert smoothed - centre**2 == pytest.approx(tuning.spread * tuning.decimation**2, abs=1e-6)


def test_an_oscillator_is_the_nearest_of_exact_steps() -> None:
    tuning = tune(*ASKED[0])
    step_hz = tuning.oscillator_hz(1)
    assert step_hz == pytest.approx(tuning.phase_rate_hz / PHASE_STEPS)
    for frequency in np.random.default_rng(3).uniform(3e6, 4e6, 50):
        assert abs(tuning.oscillator_hz(tuning.steps(float(frequency))) - frequency) <= 0.5 * step_hz * (1 + 1e-9)
    fixed = fixed_schedule(tuning, 3.5e6)
    assert fixed.steps.tolist() == [tuning.steps(3.5e6)] and fixed.batch.tolist() == [0]


def test_a_schedule_follows_the_beat_batch_by_batch_to_half_the_spacing() -> None:
    tuning = tune(*ASKED[0])
    samples, known = 400_000, np.array([50_000, 150_000, 300_000])
    frequency = np.array([3.2e6, 3.65e6, 3.3e6])
    schedule = following_schedule(tuning, known, frequency, samples, 20e3)
    batch = BATCH * tuning.decimation
    assert schedule.batch.size == samples // batch + 1 and np.unique(schedule.steps).size == schedule.steps.size
    for number, which in enumerate(schedule.batch):
        wanted = np.interp((number + 0.5) * batch, known, frequency)
        assert abs(tuning.oscillator_hz(int(schedule.steps[which])) - wanted) <= 10e3 + 0.5 * tuning.oscillator_hz(1)


@pytest.mark.parametrize(
    ("low", "high", "words"), [(0.15e6, 0.15e6, "near zero"), (4.85e6, 4.85e6, "near the Nyquist frequency of 5 MHz")]
)
def test_a_beat_too_near_its_image_says_which_edge_is_near(low: float, high: float, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        tune(10e6, low, high, 140e3, 450e3)


def test_a_band_is_rounded_outwards_to_20_khz() -> None:
    assert _rounded(2.7301e6, 2.7599e6) == (2.72e6, 2.76e6) and _rounded(2.74e6, 2.74e6) == (2.74e6, 2.74e6)


def test_little_light_is_read_through_longer_windows_but_never_below_the_motion_s_rate() -> None:
    settings = AnalysisSettings()
    bright, dim, dark = (_tune(10e6, 3.2e6, 3.7e6, 180e3, settings, snr) for snr in (3.0, 0.0, -20.0))
    assert bright.phase_rate_hz >= 0.45e6 and 1 / (10**0.3 * bright.effective_samples) <= 0.025  # rad^2 of one phase
    assert 1 / bright.effective_samples > 0.025 >= 1 / dim.effective_samples  # at 0 dB the same would not do
    assert dark.phase_rate_hz >= 3 * settings.motion_rate_hz and dark.effective_samples >= dim.effective_samples
    assert 100 % bright.decimation == 0  # of an exact motion rate of 100 kHz


def test_a_decimation_divides_the_motion_s_step_unless_that_costs_too_much() -> None:
    free = tune(10e6, 3.2e6, 3.7e6, 150e3, 450e3)
    assert _divided(10e6, 3.2e6, 3.7e6, 150e3, 450e3, 1) is free
    exact = _divided(10e6, 3.2e6, 3.7e6, 150e3, 450e3, 100)
    assert 100 % exact.decimation == 0 and 3 * exact.decimation >= free.decimation
    assert _divided(10e6, 3.2e6, 3.7e6, 150e3, 450e3, 101) is free  # a prime: every sample would be a phase


@pytest.mark.parametrize("rest", ["smooth", "instantaneous"])
def test_plans_begin_with_a_band_that_follows_the_beat_and_end_with_one_that_holds_it_all(rest: str) -> None:
    recording = make_recording(collision(0.3, 10e-3, 10e-3), 200_000)
    seen, still = (survey(recording.counts[:, k], 10e6, 16, "x") for k in (1, 0))
    settings = AnalysisSettings(rest=rest)
    plans = list(demodulation_plans(seen, still, recording, settings))
    assert len(plans) == 3
    widths = [moving.tuning.half_width_hz for _, (moving, _) in plans]
    both = 0.5 * settings.motion_rate_hz
    assert widths[:2] == pytest.approx([130e3 + both, 400e3 + both])
    low, high = _rounded(min(seen.low_hz, still.low_hz), max(seen.high_hz, still.high_hz))
    if rest == "smooth":
        low, high = _rounded(seen.low_hz, seen.high_hz)
    assert widths[2] == pytest.approx(0.5 * (high - low) + 60e3 + both)
    assert plans[2][1][0].schedule.steps.size == 1 < plans[0][1][0].schedule.steps.size
    for step, (moving, other) in plans:
        assert step % moving.tuning.decimation == 0 == step % other.tuning.decimation
        assert step / 10e6 == pytest.approx(1 / settings.motion_rate_hz, rel=0.1)
        assert (other.tuning is moving.tuning) == (rest == "instantaneous")
        rest_hz = other.tuning.oscillator_hz(int(other.schedule.steps[0]))
        assert rest_hz == pytest.approx(2.73e6, abs=300.0)
        assert (moving.column, other.column) == (1, 0) and (moving.survey, other.survey) == (seen, still)
    _, alone = next(demodulation_plans(seen, None, recording, settings))
    assert len(alone) == 1


@pytest.mark.parametrize("asked", ASKED)
def test_no_other_decimation_and_length_would_be_cheaper(asked) -> None:
    """A phase costs its taps over the decimation, and some four samples' worth and twenty for each phase besides."""
    rate, low, high, half, least, divides = asked
    tuning = tune(*asked)
    edge = min(2 * low, rate - 2 * high) - half
    costs = {}
    for decimation in range(1, int(rate / max(least, 2.4 * half)) + 1):
        for share in (4, 8, 12, 16, 24, 32, 48, 64, 96, 128):
            possible = share * decimation <= 4096 and not (divides and divides % decimation)
            if possible and _window(rate, decimation, share, half, edge) is not None:
                costs[decimation, share] = 20.0 / decimation + 4.0 + share
                break
    assert costs[tuning.decimation, tuning.length // tuning.decimation] == min(costs.values())

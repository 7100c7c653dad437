"""The phase of a beat: the same bits for any cutting, and as good as its noise allows down to very little light."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.shot.shot import AnalysisError, AnalysisSettings
from analysis.signal.beat import BeatReader
from analysis.signal.decimate import PhaseDecimator
from analysis.signal.demodulation import demodulate
from analysis.signal.tuning import BATCH, fixed_schedule, following_schedule, tune
from tests.analysis.signal.beats import Floats, collision, free_flight, make_recording

RATE = 10e6
COUNTS = make_recording(free_flight(-0.25), 60_000).counts
TUNINGS = [
    tune(RATE, 3.2e6, 3.7e6, 150e3, 450e3),
    tune(RATE, 3.4e6, 3.4e6, 1e6, 2e6),
    tune(30e6, 3.2e6, 3.7e6, 150e3, 450e3),
]


def _read(tuning, counts: np.ndarray, cuts: list[int], start: int = 0) -> Floats:
    schedule = following_schedule(tuning, np.array([0, 60_000]), np.array([3.45e6, 3.55e6]), 60_000, 20e3)
    reader = BeatReader(tuning, schedule, 1, 100.0, start)
    decimator = PhaseDecimator(5, reader.index)
    edges = [0, *sorted(cuts), counts.shape[0]]
    parts = [decimator.feed(*reader.feed(counts[a:b])[1:])[1] for a, b in pairwise(edges)]
    return np.concatenate((*parts, decimator.feed(*reader.finish()[1:])[1]))


@pytest.mark.parametrize("tuning", TUNINGS)
@settings(max_examples=25, deadline=None)
@given(cuts=st.lists(st.integers(0, 60_000), max_size=12))
def test_identical_results_for_any_division_into_blocks(tuning, cuts: list[int]) -> None:
    assert np.array_equal(_read(tuning, COUNTS, cuts), _read(tuning, COUNTS, []))


def test_one_sample_at_a_time_too() -> None:
    counts = COUNTS[:6_000]
    assert np.array_equal(_read(TUNINGS[0], counts, list(range(1, 6_000))), _read(TUNINGS[0], counts, []))


@pytest.mark.parametrize("start", [1, 777, 20_011])
def test_a_reader_started_later_stays_on_the_grid(start: int) -> None:
    tuning = TUNINGS[0]
    schedule = fixed_schedule(tuning, 3.5e6)
    first, phase, _ = BeatReader(tuning, schedule, 1).feed(COUNTS)
    whole = phase.copy()
    late, phase, _ = BeatReader(tuning, schedule, 1, 0.0, start).feed(COUNTS[start:])
    count = min(phase.size, whole.size - late)
    apart = phase[:count] - whole[late : late + count]
    assert first == 0 and late == -(-start // tuning.decimation)
    assert np.allclose(apart, np.rint(apart[0]), atol=1e-6)


@settings(max_examples=40, deadline=None)
@given(
    frequency=st.floats(3.3e6, 3.6e6),
    phase=st.floats(0, 1),
    amplitude=st.floats(300, 32_000),
    noise=st.floats(0, 0.3),
    tuning=st.sampled_from(TUNINGS),
)
def test_the_angle_is_that_of_the_beat_at_the_window_centre(frequency, phase, amplitude, noise, tuning) -> None:
    n = np.arange((BATCH + 8) * tuning.decimation + tuning.length)
    signal = amplitude * np.cos(2 * np.pi * (frequency / tuning.sample_rate_hz * n + phase))
    signal += np.random.default_rng(1).normal(0, noise * amplitude, n.size)
    counts = np.clip(np.rint(signal), -32768, 32767).astype(np.int16)
    reader = BeatReader(tuning, fixed_schedule(tuning, 3.45e6), 0)
    _, read, power = reader.feed(counts[:, None])
    first = np.arange(read.size) * tuning.decimation
    turn = reader.oscillator_hz / tuning.sample_rate_hz
    exact_taps = tuning.window * np.exp(-2j * np.pi * turn * (np.arange(tuning.length) - tuning.delay_samples))
    exact = np.lib.stride_tricks.sliding_window_view(counts, tuning.length)[first] @ exact_taps
    error = read + turn * first - np.angle(exact) / (2 * np.pi)
    own_noise = noise * np.sqrt(2 / tuning.effective_samples)
    rounding = 10 ** (-85 / 20) + 0.01 * own_noise  # of the taps: test_integer_filter.py
    assert np.max(np.abs(error - np.rint(error))) < rounding / (2 * np.pi) + 1e-7
    assert np.allclose(np.sqrt(power), np.abs(exact), rtol=rounding)


def test_the_angle_at_the_centre_of_the_window_moves_with_the_beat() -> None:
    tuning = TUNINGS[0]
    n = np.arange((BATCH + 8) * tuning.decimation + tuning.length)
    counts = np.rint(30_000 * np.cos(2 * np.pi * (3.41e6 / RATE * n + 0.3))).astype(np.int16)
    reader = BeatReader(tuning, fixed_schedule(tuning, 3.45e6), 0)
    _, read, _ = reader.feed(counts[:, None])
    first = np.arange(read.size) * tuning.decimation
    exact = 3.41e6 / RATE * (first + tuning.delay_samples) + 0.3 - reader.oscillator_hz / RATE * first
    error = read - exact
    assert np.max(np.abs(error - np.rint(error[0]))) < 1.5e-5


@pytest.mark.parametrize(("rate_hz", "snr_db"), [(10e6, 5.0), (10e6, -3.0), (30e6, -3.0)])
def test_little_light_loses_no_fringe(rate_hz: float, snr_db: float) -> None:
    truth = collision(0.265, 10e-3, 10e-3)
    recording = make_recording(truth, int(0.02 * rate_hz), rate_hz=rate_hz, snr_db=snr_db, amplitude=3000, seed=4)
    motion = demodulate(recording, AnalysisSettings())
    error = motion.displacement_m - truth(motion.time_s)
    assert np.max(np.abs(error - np.mean(error)) / motion.displacement_std_m) < 5.5
    assert motion.valid.all()


@pytest.mark.parametrize(
    ("rate_hz", "rest_hz", "speed"),
    [(2e6, 0.6e6, 0.05), (1e6, 0.25e6, 0.02), (50e6, 2.73e6, 0.4), (12.345e6, 2.73e6, 0.3), (30e6, 8e6, 1.5)],
)
def test_any_rate_and_rest_frequency(rate_hz: float, rest_hz: float, speed: float) -> None:
    truth = collision(speed, 15e-3)
    recording = make_recording(truth, int(0.03 * rate_hz), rate_hz=rate_hz, rest_hz=rest_hz)
    motion = demodulate(recording, AnalysisSettings())
    error = motion.displacement_m - truth(motion.time_s)
    assert np.max(np.abs(error - np.mean(error)) / motion.displacement_std_m) < 6
    assert motion.sample_rate_hz == pytest.approx(100e3, rel=0.1)


@pytest.mark.parametrize(("low", "high"), [(0.0, 1e5), (4.9e6, 5.1e6), (2.0e4, 8.0e4)])
def test_a_band_that_cannot_be_read_is_refused(low: float, high: float) -> None:
    with pytest.raises(AnalysisError, match=r"band|image"):
        tune(RATE, low, high, 150e3, 450e3)

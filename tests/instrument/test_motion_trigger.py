"""Trigger by the motion of the block: soon after it moves, never at rest, the same for any lengths of blocks."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from instrument.bench.digitizer import BenchDigitizer
from instrument.bench.optics import Optics
from instrument.bench.rig import Bench
from instrument.capture.capture import acquire
from instrument.devices.digitizer import CaptureSettings
from instrument.files.recording_file import read_recording
from instrument.trigger.motion_trigger import WINDOW_S, MotionTrigger

RATE = 10e6
LAMBDA = 632.8e-9
SPEED = 0.05
PUSH_S = 0.02


def beats(noise: float = 100.0) -> np.ndarray:
    """Return PD1 and PD0 of a block that rests, and from PUSH_S on is pushed with 10 m/s^2."""
    t = np.arange(int(0.03 * RATE)) / RATE
    rng = np.random.default_rng(2)
    x = -0.5 * 10.0 * np.clip(t - PUSH_S, 0, None) ** 2
    rest = 2 * np.pi * 2.7e6 * t
    phases = np.stack((rest - 4 * np.pi / LAMBDA * x, rest), axis=1)
    return np.rint(1200 * np.sin(phases) + 40 + rng.normal(0, noise, phases.shape)).astype(np.int16)


COUNTS = beats()


@pytest.mark.parametrize(("reference", "rest_hz"), [(1, None), (None, 2.7e6), (None, None)])
def test_it_fires_soon_after_the_speed_is_reached(reference: int | None, rest_hz: float | None) -> None:
    trigger = MotionTrigger(0, reference, RATE, LAMBDA, SPEED, rest_hz)
    found = trigger.first_step(COUNTS)
    assert found is not None
    reached_s = PUSH_S + SPEED / 10.0
    assert reached_s < found / RATE < reached_s + 4 * WINDOW_S
    again = MotionTrigger(0, reference, RATE, LAMBDA, SPEED, rest_hz)
    assert again.first_step(COUNTS[: int(PUSH_S * RATE)]) is None


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(0, len(COUNTS)), max_size=10))
def test_any_cutting_gives_the_same_answer(cuts: list[int]) -> None:
    once = MotionTrigger(0, 1, RATE, LAMBDA, SPEED).first_step(COUNTS)
    trigger = MotionTrigger(0, 1, RATE, LAMBDA, SPEED)
    found = []
    edges = [0, *sorted(cuts), len(COUNTS)]
    for a, b in itertools.pairwise(edges):
        step = trigger.first_step(COUNTS[a:b])
        if step is not None:
            found.append(a + step)
    assert found == [once]


def test_a_block_that_moves_from_the_start_must_rest_first() -> None:
    moving = COUNTS[int((PUSH_S + 0.006) * RATE) :]
    assert MotionTrigger(0, 1, RATE, LAMBDA, SPEED).first_step(moving) is None


def test_a_bench_without_a_light_switch_is_triggered_by_its_block(tmp_path: Path) -> None:
    digitizer = BenchDigitizer(Bench(optics=Optics(with_switch=False)), real_time=False, first_push_s=0.1)
    (path,) = acquire(digitizer, tmp_path, 1, CaptureSettings(10e6, 400_000, 100_000))
    recording = read_recording(path)
    assert (recording.samples, recording.trigger_sample) == (400_000, 100_000)
    beats = [_frequency(recording.counts[part, 1], 10e6) for part in (slice(0, 20_000), slice(-20_000, None))]
    doppler = 2 * 0.05 / 632.8e-9
    assert abs(beats[0] - 2.73e6) < doppler < abs(beats[1] - beats[0])  # at rest before, moving after


def _frequency(values: np.ndarray, rate_hz: float) -> float:
    power = np.abs(np.fft.rfft(values - values.mean()))
    return float(np.argmax(power) * rate_hz / values.size)


def _stretches(shifts_hz: list[float], windows: int = 6, rest_hz: float = 2.7e6) -> np.ndarray:
    """Return a steady PD1 beat for so many windows at each shift from PD0's, which stays."""
    window = round(WINDOW_S * RATE)
    shift = np.repeat(shifts_hz, windows * window)
    turned = np.cumsum(np.stack((rest_hz + shift, np.full(shift.size, rest_hz)), axis=1) / RATE, axis=0)
    return np.rint(900 * np.sin(2 * np.pi * turned) - 30).astype(np.int16)


DOPPLER_HZ = 2 * SPEED / LAMBDA


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "fires"), [(0.97, False), (1.03, True)])
def test_it_fires_beyond_the_speed_in_the_second_window_in_a_row(share: float, fires: bool, sign: float) -> None:
    counts, window = _stretches([0.0, sign * share * DOPPLER_HZ]), round(WINDOW_S * RATE)
    found = MotionTrigger(0, 1, RATE, LAMBDA, SPEED).first_step(counts)
    assert found == (8 * window - 1 if fires else None)
    # one window beyond it is no motion
    spike = counts[: 7 * window].copy()
    assert MotionTrigger(0, 1, RATE, LAMBDA, SPEED).first_step(np.concatenate((spike, counts[: 5 * window]))) is None


@pytest.mark.parametrize(("slow", "again"), [(0.45, True), (0.55, False)])
def test_after_a_motion_it_waits_until_the_block_is_slower_than_half_the_speed(slow: float, again: bool) -> None:
    shifts = [0.0, 1.5 * DOPPLER_HZ, slow * DOPPLER_HZ, 1.5 * DOPPLER_HZ]
    counts, window = _stretches(shifts), round(WINDOW_S * RATE)
    trigger = MotionTrigger(0, 1, RATE, LAMBDA, SPEED)
    assert trigger.first_step(counts[: 18 * window]) == 8 * window - 1
    assert (trigger.first_step(counts[18 * window :]) is not None) == again


def test_without_pd0_the_rest_frequency_is_the_mean_of_the_first_twenty_windows_or_the_given_one() -> None:
    window = round(WINDOW_S * RATE)
    learned = _stretches([0.0, 1.5 * DOPPLER_HZ], windows=24)
    trigger = MotionTrigger(0, None, RATE, LAMBDA, SPEED)
    assert trigger.first_step(learned) == 26 * window - 1
    early = _stretches([0.0, 1.5 * DOPPLER_HZ], windows=12)
    assert MotionTrigger(0, None, RATE, LAMBDA, SPEED).first_step(early) is None  # part of what was learned
    assert MotionTrigger(0, None, RATE, LAMBDA, SPEED, 2.7e6).first_step(early) == 14 * window - 1
    assert MotionTrigger(0, None, RATE, LAMBDA, SPEED, 2.7e6 + 1.5 * DOPPLER_HZ).first_step(early) is None


def test_the_rest_frequency_that_is_learned_is_the_mean_of_beats_that_differ() -> None:
    window = round(WINDOW_S * RATE)
    swinging = _stretches([20e3, -20e3], windows=11)  # the first window is not counted: ten above, ten of those below
    for shift, fires in ((0.9, False), (1.1, True)):
        after = _stretches([0.0, shift * DOPPLER_HZ], windows=5)
        found = MotionTrigger(0, None, RATE, LAMBDA, SPEED).first_step(np.concatenate((swinging, after)))
        assert found == ((22 + 5 + 2) * window - 1 if fires else None)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("cycles", "fires"), [(79, False), (80, True)])
def test_each_cycle_of_a_window_counts_once(cycles: int, fires: bool, sign: float) -> None:
    """The speed shifts the beat by 79.01 cycles in a window."""
    assert 79.0 < DOPPLER_HZ * WINDOW_S < 79.02
    counts = _stretches([0.0, sign * cycles / WINDOW_S])
    window = round(WINDOW_S * RATE)
    for reference, rest_hz in ((1, None), (None, 2.7e6)):
        found = MotionTrigger(0, reference, RATE, LAMBDA, SPEED, rest_hz).first_step(counts)
        assert found == (8 * window - 1 if fires else None)


@pytest.mark.parametrize(("reference", "rest_hz"), [(1, None), (None, 100e3)])
def test_noise_about_the_mean_of_a_slow_beat_is_no_cycle(reference: int | None, rest_hz: float | None) -> None:
    """Near its mean the beat changes by less than the noise from one sample to the next."""
    slow = 0.004  # m/s: six cycles in a window
    counts = _stretches([0.0, 8 / WINDOW_S], windows=40, rest_hz=100e3).astype(float)
    noisy = np.rint(counts + np.random.default_rng(4).normal(0.0, 60.0, counts.shape)).astype(np.int16)
    found = MotionTrigger(0, reference, RATE, LAMBDA, slow, rest_hz).first_step(noisy)
    assert found == 42 * round(WINDOW_S * RATE) - 1


def test_a_crest_or_a_trough_with_a_dip_down_to_the_mean_is_one_side_of_one_cycle() -> None:
    """The levels lie 0.3 of the rms above and below the mean; a beat changes its side at the far one alone."""
    cycle = np.array([1.0, 0.1, 1.0, -1.0, -0.1, -1.0] * 2 + [1.0] * 4 + [-1.0] * 4)  # three, in 20 samples
    window = round(WINDOW_S * RATE)
    counts = np.rint(1000 * np.tile(cycle, 6 * window // 20))[:, None].astype(np.int16)
    moving = np.rint(1000 * np.tile(np.repeat([1.0, -1.0], 10), 6 * window // 20))[:, None].astype(np.int16)
    trigger = MotionTrigger(0, None, RATE, LAMBDA, SPEED, 3 * RATE / 20)
    assert trigger.first_step(counts) is None and trigger.first_step(moving) == 2 * window - 1


@pytest.mark.parametrize("rate", [1e5, 1e6, 30e6])
def test_a_window_is_half_a_millisecond_and_at_least_64_samples(rate: float) -> None:
    window = MotionTrigger(0, 1, rate, LAMBDA, SPEED)._window
    assert window == max(64, round(0.5e-3 * rate))

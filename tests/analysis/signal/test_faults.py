"""Faults of a recording: each is bridged, removed, or flagged."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from analysis.shot.motion import Motion
from analysis.shot.recording import Gap, Recording, Role
from analysis.shot.shot import AnalysisError, AnalysisSettings
from analysis.signal.demodulation import demodulate
from tests.analysis.signal.beats import WAVELENGTH_M, Floats, collision, free_flight, make_recording

TRUTH = collision(0.265, 20e-3)
SAMPLES = 400_000
FRINGE_M = WAVELENGTH_M / 2


def _error(motion: Motion, truth=TRUTH) -> Floats:
    error = motion.displacement_m - truth(motion.time_s)
    return np.asarray(error - np.nanmedian(error[:200]))


@pytest.mark.parametrize("seconds", [10e-6, 100e-6])
@pytest.mark.parametrize("at", [5e-3, 16.3e-3, 20e-3, 30e-3])
def test_a_drop_out_is_bridged_without_losing_a_fringe(seconds: float, at: float) -> None:
    def dark(role: Role, t: Floats, signal: Floats) -> Floats:
        out = signal.copy()
        lost = (t >= at) & (t < at + seconds)
        if role is Role.MEASUREMENT:
            out[lost] = 100 + np.random.default_rng(1).normal(0, 60, np.count_nonzero(lost))
        return out

    motion = demodulate(make_recording(TRUTH, SAMPLES, snr_db=30, alter=dark), AnalysisSettings())
    assert "drop_out" in motion.flags and "fringe_doubtful" not in motion.flags
    error = _error(motion)
    inside = np.abs(motion.time_s - at - seconds / 2) < seconds / 2
    assert not motion.valid[inside].any() and np.isnan(motion.displacement_m[inside]).all()
    assert np.nanmax(np.abs(error)) < 0.02 * FRINGE_M
    assert np.mean(motion.valid) > 0.99
    assert np.isfinite(motion.velocity_m_per_s[motion.valid]).all()


def _with_gap(recording: Recording, start: int, lost: int, known: bool = True) -> Recording:
    counts = np.concatenate((recording.counts[:start], recording.counts[start + lost :]))
    return dataclasses.replace(recording, counts=counts, gaps=(Gap(start, lost if known else None),))


@pytest.mark.parametrize("lost", [64, 1000, 5000])
def test_lost_samples_are_bridged_and_counted_in_time(lost: int) -> None:
    recording = _with_gap(make_recording(TRUTH, SAMPLES), 123_457, lost)
    motion = demodulate(recording, AnalysisSettings())
    assert "gap" in motion.flags and "fringe_doubtful" not in motion.flags
    assert np.nanmax(np.abs(_error(motion))) < 0.02 * FRINGE_M
    assert np.allclose(np.diff(motion.time_s), 1 / motion.sample_rate_hz)


def test_a_long_gap_in_the_impact_keeps_the_velocity_and_flags_the_position() -> None:
    recording = _with_gap(make_recording(TRUTH, SAMPLES), 155_000, 90_000)
    motion = demodulate(recording, AnalysisSettings())
    assert "fringe_doubtful" in motion.flags
    late = motion.time_s > 30e-3
    assert np.max(np.abs(motion.velocity_m_per_s[late] - 0.265) / motion.velocity_std_m_per_s[late]) < 5
    assert np.isnan(motion.displacement_m).any()


@pytest.mark.parametrize("samples", [8_000, 16_666, 20_100])
def test_a_record_cut_off_early_still_gives_its_motion(samples: int) -> None:
    motion = demodulate(make_recording(TRUTH, samples), AnalysisSettings())
    assert motion.time_s.size == pytest.approx(samples / 100, abs=20)
    assert np.nanmax(np.abs(_error(motion))) < 0.02 * FRINGE_M


def test_a_gap_of_unknown_length_ends_the_record_there() -> None:
    recording = _with_gap(make_recording(TRUTH, SAMPLES), 300_000, 777, known=False)
    motion = demodulate(recording, AnalysisSettings())
    assert "gap_unknown" in motion.flags
    assert motion.time_s[-1] < 30e-3
    assert np.nanmax(np.abs(_error(motion))) < 0.02 * FRINGE_M


def test_hum_offset_and_slow_amplitude_modulation_do_not_matter() -> None:
    def spoil(role: Role, t: Floats, signal: Floats) -> Floats:
        light = 1 + 0.4 * np.sin(2 * np.pi * 120 * t)
        return (signal - 100) * light + 1500 + 2000 * np.sin(2 * np.pi * 50 * t + 1)

    clean = demodulate(make_recording(TRUTH, SAMPLES), AnalysisSettings())
    motion = demodulate(make_recording(TRUTH, SAMPLES, alter=spoil), AnalysisSettings())
    assert np.std(_error(motion)) < 1.05 * np.std(_error(clean))
    assert motion.valid.all()


def test_harmonics_are_flagged_and_have_little_effect() -> None:
    def bend(role: Role, t: Floats, signal: Floats) -> Floats:
        x = (signal - 100) / 8000
        return 8000 * (x + 0.05 * x**2 + 0.03 * x**3) + 100

    motion = demodulate(make_recording(TRUTH, SAMPLES, alter=bend), AnalysisSettings())
    assert "harmonics" in motion.flags
    # the second, 2.5 % of the beat, folds onto it where the beat passes a third of the sample rate
    assert np.max(np.abs(_error(motion))) < 1.1 * 0.025 * WAVELENGTH_M / (4 * np.pi) + 5 * motion.displacement_std_m[0]
    assert "harmonics" not in demodulate(make_recording(TRUTH, SAMPLES), AnalysisSettings()).flags


def _bent(order: int, share: float) -> Callable[[Role, Floats, Floats], Floats]:
    """Return what gives a beat of 8000 counts a harmonic of this order and share."""

    def bend(role: Role, t: Floats, signal: Floats) -> Floats:
        x = (signal - 100) / 8000
        return 8000 * (x + 2 ** (order - 1) * share * x**order) + 100

    return bend


@pytest.mark.parametrize(
    ("rate_hz", "rest_hz", "speed", "order"),
    [
        (10e6, 2.5e6, 0.265, 3),  # folds onto the turning beat; in flight onto zero and the Nyquist frequency
        (10e6, 10e6 / 3, 0.265, 2),
        (10e6, 3.3e6, 0.1, 2),
        (5e6, 1.25e6, 0.02, 3),
        (30e6, 7.5e6, 0.01, 3),  # never apart from the beat: only the ripple of its amplitude tells
        (30e6, 10e6, 0.01, 2),
        (10e6, 2.5e6, 0.003, 3),
    ],
)
def test_a_harmonic_that_folds_onto_the_beat_is_flagged_at_any_frequency(
    rate_hz: float, rest_hz: float, speed: float, order: int
) -> None:
    truth = collision(speed, 15e-3)

    def flags(alter: Callable[[Role, Floats, Floats], Floats] | None) -> tuple[tuple[str, ...], float]:
        samples = int(30e-3 * rate_hz)
        recording = make_recording(truth, samples, rate_hz=rate_hz, rest_hz=rest_hz, alter=alter)
        motion = demodulate(recording, AnalysisSettings())
        return motion.flags, float(np.ptp(_error(motion, truth)))

    bent, error = flags(_bent(order, 0.02))
    straight, floor = flags(None)
    assert "harmonics" in bent and "harmonics" not in straight
    assert error > 2 * floor  # or nothing had folded
    assert error < 2.5 * 0.02 * WAVELENGTH_M / (4 * np.pi) + floor


@pytest.mark.parametrize(
    ("rate_hz", "rest_hz", "speed"), [(10e6, 2.73e6, 0.265), (10e6, 2.5e6, 0.01), (30e6, 7.5e6, 0.01)]
)
@pytest.mark.parametrize("height", [0.9, 0.7, 0.3])
def test_clipping_is_flagged_however_hard_and_loses_no_fringe(
    rate_hz: float, rest_hz: float, speed: float, height: float
) -> None:
    truth = collision(speed, 15e-3)

    def clip(role: Role, t: Floats, signal: Floats) -> Floats:
        return np.clip(signal, -8000 * height, 8000 * height) if role is Role.MEASUREMENT else signal

    samples = int(30e-3 * rate_hz)
    motion = demodulate(
        make_recording(truth, samples, rate_hz=rate_hz, rest_hz=rest_hz, alter=clip), AnalysisSettings()
    )
    assert "clipped" in motion.flags
    assert np.nanmax(np.abs(_error(motion, truth))) < 0.2 * (1 - height) * FRINGE_M


@pytest.mark.parametrize(("amplitude", "bits"), [(8000.0, 16), (100.0, 8), (20.0, 8)])
def test_a_whole_beat_is_not_called_clipped(amplitude: float, bits: int) -> None:
    recording = make_recording(TRUTH, SAMPLES, amplitude=amplitude, offset=2.0, bits=bits, snr_db=None)
    assert "clipped" not in demodulate(recording, AnalysisSettings()).flags


@pytest.mark.parametrize(
    ("share", "gap_s"), [(0.01, None), (0.03, None), (0.03, 0.3e-3), (0.03, 5e-3), (0.03, 20.6e-3)]
)
def test_a_polarisation_leak_is_removed(share: float, gap_s: float | None) -> None:
    """It is read in a stretch of flight without a gap, which need not be the first."""
    recording = make_recording(TRUTH, SAMPLES, snr_db=35)
    random = np.random.default_rng(1)
    leak = share * 8000 * np.cos(2 * np.pi * 2.73e6 * np.arange(SAMPLES) / 10e6 + random.uniform(0, 2 * np.pi) + 2.0)
    counts = recording.counts.copy()
    counts[:, 1] = np.rint(counts[:, 1] + leak)
    both = recording, dataclasses.replace(recording, counts=counts)
    if gap_s is not None:
        both = tuple(_with_gap(one, round(gap_s * recording.sample_rate_hz), 500) for one in both)
    clean, motion = (demodulate(one, AnalysisSettings()) for one in both)
    assert "leak_removed" in motion.flags
    near = np.abs(motion.time_s - 20e-3) < 0.8e-3  # |v| below 0.07 m/s: the leak's ripple is within the band
    slow = np.abs(clean.velocity_m_per_s) < 0.01
    assert np.std(_error(motion)[slow & near]) < 1.25 * np.std(_error(clean)[slow & near])


@pytest.mark.parametrize(
    ("rest_hz", "speed", "rate_hz"), [(0.25e6, 0.06, 10e6), (4.9e6, 0.02, 10e6), (2.73e6, 0.9, 10e6)]
)
def test_a_beat_that_meets_its_image_is_refused_or_flagged(rest_hz: float, speed: float, rate_hz: float) -> None:
    truth = collision(speed, 20e-3)
    recording = make_recording(truth, SAMPLES, rate_hz=rate_hz, rest_hz=rest_hz)
    try:
        motion = demodulate(recording, AnalysisSettings())
    except AnalysisError as problem:
        assert "image" in str(problem) or "band" in str(problem)
    else:
        wrong = np.nanmax(np.abs(_error(motion, truth))) > 0.05 * FRINGE_M
        assert not wrong or "image" in motion.flags


@pytest.mark.parametrize(("rest_hz", "speed"), [(0.6e6, 0.1), (1.2e6, 0.25), (3.9e6, 0.2), (2.73e6, 0.5)])
def test_other_rest_frequencies_are_tuned_for(rest_hz: float, speed: float) -> None:
    truth = collision(speed, 20e-3)
    motion = demodulate(make_recording(truth, SAMPLES, rest_hz=rest_hz), AnalysisSettings())
    assert np.nanmax(np.abs(_error(motion, truth) / motion.displacement_std_m)) < 6


def test_eight_bits_are_enough() -> None:
    motion = demodulate(make_recording(TRUTH, SAMPLES, amplitude=100, offset=2, bits=8, snr_db=45), AnalysisSettings())
    error = _error(motion)
    assert np.std(error) < 1.2 * np.median(motion.displacement_std_m)
    quantised = WAVELENGTH_M / (4 * np.pi) * np.sqrt(2 / 12 / 100**2 * motion.sample_rate_hz / 10e6)
    noise = WAVELENGTH_M / (4 * np.pi) * np.sqrt(10**-4.5 * motion.sample_rate_hz / 10e6)
    assert np.std(error) == pytest.approx(np.hypot(quantised, noise), rel=0.15)


def test_a_rest_frequency_that_drifts_is_followed_and_flagged() -> None:
    recording = make_recording(free_flight(-0.2), SAMPLES, rest_phase=lambda t: 2 * np.pi * 2000.0 * t**2)
    motion = demodulate(recording, AnalysisSettings())
    assert "rest_drift" in motion.flags
    assert np.allclose(motion.velocity_m_per_s[100:-100], -0.2, atol=2e-5)


def test_a_wandering_rest_frequency_is_flagged_and_subtracted_sample_by_sample() -> None:
    wander = lambda t: 0.5 * np.sin(2 * np.pi * 900 * t)  # noqa: E731
    recording = make_recording(free_flight(-0.2), SAMPLES, rest_phase=wander)
    smoothed = demodulate(recording, AnalysisSettings())
    instantaneous = demodulate(recording, AnalysisSettings(rest="instantaneous"))
    assert "rest_unsteady" in smoothed.flags
    assert np.std(smoothed.velocity_m_per_s) > 5 * np.std(instantaneous.velocity_m_per_s)
    assert np.std(instantaneous.velocity_m_per_s) < 1.2 * np.median(instantaneous.velocity_std_m_per_s)


def test_instantaneous_subtraction_raises_noise_by_the_square_root_of_two() -> None:
    recording = make_recording(free_flight(-0.2), SAMPLES)
    stds = [
        np.std(demodulate(recording, AnalysisSettings(rest=rest)).velocity_m_per_s[40:-40])
        for rest in ("smoothed", "instantaneous")
    ]
    assert stds[1] / stds[0] == pytest.approx(np.sqrt(2), rel=0.12)

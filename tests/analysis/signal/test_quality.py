"""Light and noise of a motion are those of its recording."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.motion import Motion
from analysis.shot.recording import Role
from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulation import demodulate
from analysis.signal.filters import derivative_filters
from analysis.signal.survey import survey
from analysis.signal.track import local_variance
from app.words.flags import flag_words
from tests.analysis.signal.beats import WAVELENGTH_M, free_flight, make_recording


def bounds(motion: Motion, input_rate_hz: float) -> tuple[float, float, float]:
    """Return the least std of displacement, velocity and force that the measured SNR allows (Cramer-Rao).

    Phase noise of a beat in white noise has the one-sided density 2 / (SNR input_rate) rad^2/Hz.
    """
    assert motion.measurement is not None and motion.wavelength_m is not None
    density = 2.0 / (10 ** (motion.measurement.snr_db / 10) * input_rate_hz)
    displacement_m = motion.wavelength_m / (4 * np.pi) * float(np.sqrt(0.5 * density * motion.sample_rate_hz))
    filters = derivative_filters(motion.sample_rate_hz, motion.bandwidth_hz)
    force_n = motion.moving_mass_kg * displacement_m * filters.acceleration_gain
    return displacement_m, displacement_m * filters.velocity_gain, force_n


@pytest.mark.parametrize("snr_db", [10.0, 25.0, 40.0])
def test_light_and_noise_are_what_was_put_in(snr_db: float) -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=snr_db)
    motion = demodulate(recording, AnalysisSettings())
    assert motion.measurement is not None and motion.reference is not None
    assert motion.measurement.snr_db == pytest.approx(snr_db, abs=0.7)
    assert motion.reference.snr_db == pytest.approx(snr_db, abs=0.7)
    assert motion.measurement.amplitude_v == pytest.approx(0.8, rel=0.03)
    straight = np.polyval(np.polyfit(motion.time_s, motion.displacement_m, 1), motion.time_s)
    values = (motion.displacement_m - straight, motion.velocity_m_per_s[40:-40], motion.force_n[40:-40])
    stds = (motion.displacement_std_m, motion.velocity_std_m_per_s, motion.force_std_n)
    for value, std, bound in zip(values, stds, bounds(motion, recording.sample_rate_hz), strict=True):
        assert float(np.nanmedian(std)) == pytest.approx(np.std(value), rel=0.15)
        assert float(np.nanmedian(std)) / bound == pytest.approx(1.0, abs=0.1)
    assert motion.flags == ()


def test_a_reference_subtracted_sample_by_sample_adds_its_noise() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=25.0)
    motion = demodulate(recording, AnalysisSettings(rest="instantaneous"))
    bound = np.sqrt(2.0) * bounds(motion, recording.sample_rate_hz)[1]
    assert float(np.nanmedian(motion.velocity_std_m_per_s)) / bound == pytest.approx(1.0, abs=0.1)


def test_a_clipped_beat_is_flagged_and_has_words() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, alter=lambda role, t, x: np.clip(x, -6500, 6500))
    assert "clipped" in demodulate(recording, AnalysisSettings()).flags
    assert "gain" in flag_words("clipped")


def test_the_local_noise_of_a_beat_is_that_of_its_stretch_and_unknown_where_all_is_dark() -> None:
    deviates = np.random.default_rng(1).standard_normal(20_480)
    deviates[10_240:] *= 3.0
    found = local_variance(deviates**2)
    assert found.shape == deviates.shape
    assert np.mean(found[:9_700]) == pytest.approx(1.0, rel=0.08)
    assert np.mean(found[10_800:]) == pytest.approx(9.0, rel=0.08)
    holed = np.where(np.arange(deviates.size) % 512 < 460, np.nan, deviates**2)
    assert np.mean(local_variance(holed)[:9_700]) == pytest.approx(1.0, rel=0.25)
    dark = local_variance(np.full(5_000, np.nan))
    assert dark.shape == (5_000,) and np.isnan(dark).all()
    few = np.full(5_000, np.nan)
    few[::600] = 1.0  # a sample here and there is no measure
    assert np.isnan(local_variance(few)).all()


def beat(height: np.ndarray | float, offset: float = 0.0, second: float = 0.0) -> np.ndarray:
    """Return counts of a 12-bit channel at 10 MHz: a beat in the middle of a bin, a second harmonic of it beside."""
    phase = 2 * np.pi * 67 / 512 * np.arange(200_000)
    signal = height * (np.cos(phase) + second * np.cos(2 * phase + 1.0)) + offset
    noise = np.random.default_rng(5).normal(0.0, 3.0, phase.size)
    return np.clip(np.rint(signal + noise), -2048, 2047).astype(np.int16)


@pytest.mark.parametrize("offset", [-1052.0, 1052.0])
def test_a_small_share_at_the_rail_is_counted_at_either_rail(offset: float) -> None:
    """A beat of 1,000 counts about 1,052 passes the rail for acos(996 / 1000) of its half period: 3 %."""
    found = survey(beat(1000.0, offset), 10e6, 12, "PD1")
    assert found.clipped_fraction == pytest.approx(np.arccos(0.996) / np.pi, abs=0.005)
    assert survey(beat(1000.0, offset / 2), 10e6, 12, "PD1").clipped_fraction == 0.0


@pytest.mark.parametrize("turns", [15 / 32, 7 / 32, 5 / 16])
def test_a_beat_in_step_with_the_sample_clock_is_not_called_clipped(turns: float) -> None:
    """It repeats so few phases that it stands often at its extremes and never a count below them.

    What is cut off at a tenth less stands there far more often still.
    """
    whole = 100.0 * np.cos(2 * np.pi * turns * np.arange(200_000))
    noise = np.random.default_rng(1).normal(0.0, 0.1, whole.size)
    for signal, clipped in ((whole, False), (np.clip(whole, -90.0, 90.0), True)):
        found = survey(np.rint(signal + noise).astype(np.int16), 10e6, 8, "PD0")
        assert (found.clipped_fraction > 0.0) is clipped


def test_harmonics_are_a_share_of_the_usual_beat_however_bright_a_moment_is() -> None:
    flash = np.where(np.arange(200_000) < 30_000, 3.0, 1.0)
    assert survey(beat(300.0 * flash, second=0.05), 10e6, 12, "PD1").harmonics == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("velocity_m_per_s", [-0.3, 0.05, 0.25])
def test_each_beat_is_told_with_its_own_frequency_height_and_noise(velocity_m_per_s: float) -> None:
    """The moving beat is shifted by 2 v / lambda, by thousands of times what its frequency is known to."""
    recording = make_recording(
        free_flight(velocity_m_per_s),
        300_000,
        amplitude=4000.0,
        snr_db=30.0,
        alter=lambda role, _, signal: signal if role is Role.REFERENCE else 0.5 * signal,
    )
    inverted = replace(recording.channels[1], volts_per_count=-2e-4)
    motion = demodulate(replace(recording, channels=(recording.channels[0], inverted)), AnalysisSettings())
    assert motion.reference is not None and motion.measurement is not None
    assert motion.reference.frequency_hz == pytest.approx(2.73e6, abs=10.0)
    assert motion.measurement.frequency_hz == pytest.approx(2.73e6 - 2 * velocity_m_per_s / WAVELENGTH_M, abs=10.0)
    for told in (motion.reference, motion.measurement):
        assert told.amplitude_v == pytest.approx(0.4, rel=0.01)  # 4,000 times 0.1 mV, 2,000 times 0.2 mV
        assert told.snr_db == pytest.approx(30.0, abs=0.6)
        assert told.clipped_fraction == 0.0

"""Light and noise of a motion are those of its recording."""

import numpy as np
import pytest

from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulate import demodulate
from analysis.signal.filters import derivative_filters
from analysis.signal.flag_meanings import MEANINGS
from tests.analysis.signal.beats import free_flight, make_recording


def velocity_bound_m_per_s(motion: Motion, input_rate_hz: float) -> float:
    """Return the least std of velocity that the measured SNR allows (Cramer-Rao) through the motion's filters.

    Phase noise of a beat in white noise has the one-sided density 2 / (SNR input_rate) rad^2/Hz.
    """
    assert motion.measurement is not None and motion.wavelength_m is not None
    density = 2.0 / (10 ** (motion.measurement.snr_db / 10) * input_rate_hz)
    displacement_m = motion.wavelength_m / (4 * np.pi) * np.sqrt(0.5 * density * motion.sample_rate_hz)
    return float(displacement_m * derivative_filters(motion.sample_rate_hz, motion.bandwidth_hz).velocity_gain)


@pytest.mark.parametrize("snr_db", [10.0, 25.0, 40.0])
def test_light_and_noise_are_what_was_put_in(snr_db: float) -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=snr_db)
    motion = demodulate(recording, AnalysisSettings())
    assert motion.measurement is not None and motion.reference is not None
    assert motion.measurement.snr_db == pytest.approx(snr_db, abs=0.7)
    assert motion.reference.snr_db == pytest.approx(snr_db, abs=0.7)
    assert motion.measurement.amplitude_v == pytest.approx(0.8, rel=0.03)
    stated = float(np.nanmedian(motion.velocity_std_m_per_s))
    assert stated / velocity_bound_m_per_s(motion, recording.sample_rate_hz) == pytest.approx(1.0, abs=0.1)
    assert stated == pytest.approx(np.std(motion.velocity_m_per_s[40:-40]), rel=0.15)
    straight = np.polyval(np.polyfit(motion.time_s, motion.displacement_m, 1), motion.time_s)
    displacement_m = float(np.nanmedian(motion.displacement_std_m))
    assert displacement_m == pytest.approx(np.std(motion.displacement_m - straight), rel=0.15)
    force_n = float(np.nanmedian(motion.force_std_n))
    assert force_n == pytest.approx(np.std(motion.force_n[40:-40]), rel=0.15)
    assert motion.flags == ()


def test_a_reference_taken_off_sample_by_sample_brings_its_noise_along() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=25.0)
    motion = demodulate(recording, AnalysisSettings(rest="instantaneous"))
    stated = float(np.nanmedian(motion.velocity_std_m_per_s))
    of_one = velocity_bound_m_per_s(motion, recording.sample_rate_hz)
    assert stated / of_one == pytest.approx(np.sqrt(2.0), rel=0.1)
    assert stated == pytest.approx(np.std(motion.velocity_m_per_s[40:-40]), rel=0.15)


def test_a_clipped_beat_is_flagged_and_has_words() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, alter=lambda role, t, x: np.clip(x, -6500, 6500))
    assert "clipped" in demodulate(recording, AnalysisSettings()).flags
    assert "gain" in MEANINGS["clipped"]

import numpy as np
import pytest

from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulate import demodulate
from analysis.signal.quality import assess
from analysis.signal.spectrum import spectrogram, welch
from tests.analysis.signal.beats import free_flight, make_recording


@pytest.mark.parametrize("snr_db", [10.0, 25.0, 40.0])
def test_light_and_floors_are_what_was_put_in(snr_db: float) -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=snr_db)
    motion = demodulate(recording, AnalysisSettings())
    quality = assess(motion, recording.sample_rate_hz)
    assert quality.measurement is not None and quality.reference is not None
    assert quality.measurement.snr_db == pytest.approx(snr_db, abs=0.7)
    assert quality.reference.snr_db == pytest.approx(snr_db, abs=0.7)
    assert quality.measurement.amplitude_v == pytest.approx(0.8, rel=0.03)
    assert quality.times_bound == pytest.approx(1.0, abs=0.1)
    scatter = np.std(motion.velocity_m_per_s[40:-40])
    assert quality.velocity_floor_m_per_s == pytest.approx(scatter, rel=0.15)
    straight = np.polyval(np.polyfit(motion.time_s, motion.displacement_m, 1), motion.time_s)
    assert quality.displacement_floor_m == pytest.approx(np.std(motion.displacement_m - straight), rel=0.15)
    assert quality.force_floor_n == pytest.approx(np.std(motion.force_n[40:-40]), rel=0.15)
    assert quality.displacement_floor_m / quality.displacement_bound_m == pytest.approx(1.0, abs=0.1)
    assert quality.force_floor_n / quality.force_bound_n == pytest.approx(1.0, abs=0.1)
    assert quality.flags == ()


def test_a_reference_taken_off_sample_by_sample_brings_its_noise_along() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=25.0)
    motion = demodulate(recording, AnalysisSettings(rest="instantaneous"))
    both, alone = (assess(motion, recording.sample_rate_hz, instantaneous=at_once) for at_once in (True, False))
    assert both.velocity_bound_m_per_s == pytest.approx(np.sqrt(2.0) * alone.velocity_bound_m_per_s, rel=0.05)
    assert both.times_bound == pytest.approx(1.0, abs=0.1)


def test_flags_are_put_in_words() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, alter=lambda role, t, x: np.clip(x, -6500, 6500))
    quality = assess(demodulate(recording, AnalysisSettings()), recording.sample_rate_hz)
    assert any(flag == "clipped" and "gain" in meaning for flag, meaning in quality.flags)


def test_the_spectrum_holds_the_power_of_the_beat_and_of_the_noise() -> None:
    recording = make_recording(free_flight(-0.2), 300_000, snr_db=20)
    spectrum = welch(recording, 1)
    step = spectrum.frequency_hz[1]
    beat = 2.73e6 + 2 * 0.2 / 632.8e-9
    near = np.abs(spectrum.frequency_hz - beat) < 5 * step
    assert spectrum.density_v2_per_hz[near].sum() * step == pytest.approx(0.5 * 0.8**2, rel=0.03)
    assert np.median(spectrum.density_v2_per_hz) * 5e6 == pytest.approx(0.5 * 0.8**2 / 100, rel=0.1)


def test_the_spectrogram_follows_the_beat() -> None:
    recording = make_recording(lambda t: -0.1 * t - 4.0 * t**2, 300_000)
    picture = spectrogram(recording, 1, columns=50)
    assert picture.density_db.shape == (picture.time_s.size, picture.frequency_hz.size) == (50, 513)
    ridge = picture.frequency_hz[np.argmax(picture.density_db, axis=1)]
    exact = 2.73e6 + 2 * (0.1 + 8.0 * picture.time_s) / 632.8e-9
    assert np.max(np.abs(ridge - exact)) < 2 * picture.frequency_hz[1]


def test_too_few_samples_for_a_spectrum_are_refused() -> None:
    with pytest.raises(ValueError, match="too few"):
        welch(make_recording(free_flight(0.1), 10), 0)

"""A collision seen by a camera is read from the fitted model, and flagged so."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.fitted.pulse_from_fit import _READ, _pulse, with_model_readings
from analysis.pipeline import analyse_motion
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisSettings, Shot
from tests.analysis.camera import Camera


def camera(noise_m: float, seed: int = 1) -> tuple[Motion, float, float]:
    """Return what 500 frames a second show, the true peak force and its true width at half of it."""
    time, _, force = Camera().course()
    above = np.flatnonzero(force > 0.5 * force.max())
    return Camera().motion(noise_m, seed), float(force.max()), float(time[above[-1]] - time[above[0]])


def analysed(motion: Motion) -> Shot:
    return analyse_motion(motion, AnalysisSettings(model="contact"), name="camera")


@pytest.mark.parametrize("seed", [1, 2])
def test_a_camera_is_read_from_the_model(seed: int) -> None:
    motion, peak_n, width_s = camera(30e-6, seed)
    shot = analysed(motion)
    assert shot.impact is not None
    assert "read_from_model" in shot.flags
    for reading, true in ((shot.impact.force_peak_n, peak_n), (shot.impact.force_fwhm_s, width_s)):
        assert isinstance(reading, Quantity)
        assert abs(reading.value - true) < 4.0 * reading.std < 0.3 * true
        assert "model" in reading.how


@pytest.fixture(scope="module")
def low_noise() -> tuple[Shot, Motion, float]:
    """Return a shot whose derivatives show the force, its motion and the true peak force in N."""
    motion, peak_n, _ = camera(1e-8)
    return analysed(motion), motion, peak_n


def test_readings_that_derivatives_show_are_unchanged(low_noise: tuple[Shot, Motion, float]) -> None:
    shot, _, peak_n = low_noise
    assert shot.impact is not None
    assert "read_from_model" not in shot.flags
    assert "pulse_disagrees" not in shot.flags
    assert isinstance(shot.impact.force_peak_n, Quantity)
    assert shot.impact.force_peak_n.value == pytest.approx(peak_n, rel=0.1)


@pytest.mark.parametrize(("times_wider", "flagged"), [(1.0, False), (2.0, True)])
def test_peak_and_width_are_checked_by_the_impulse_where_the_model_gives_no_pulse(
    low_noise: tuple[Shot, Motion, float], times_wider: float, flagged: bool
) -> None:
    shot, motion, _ = low_noise
    assert shot.impact is not None and shot.fit is not None and isinstance(shot.impact.force_fwhm_s, Quantity)
    width = replace(shot.impact.force_fwhm_s, value=times_wider * shot.impact.force_fwhm_s.value)
    read = replace(shot.impact, force_fwhm_s=width)
    checked = with_model_readings(read, replace(shot.fit, parameters={}), motion)
    assert checked.force_fwhm_s == width and checked.force_peak_n == read.force_peak_n
    assert ("pulse_disagrees" in checked.flags) is flagged


def test_a_speed_that_is_unsure_makes_what_scales_with_it_unsure(low_noise: tuple[Shot, Motion, float]) -> None:
    """Peak, impulse and deflection of a linear contact are in proportion to the speed, width and duration are not."""
    shot, motion, _ = low_noise
    assert shot.fit is not None
    (own,) = shot.fit.shots
    unsure = replace(own.velocity_in_m_per_s, std=0.01 * abs(own.velocity_in_m_per_s.value))
    sure = np.zeros_like(shot.fit.covariance)
    fit = replace(shot.fit, covariance=sure, shots=(replace(own, velocity_in_m_per_s=unsure),), reduced_chi2=1.0)
    pulse = _pulse(fit, motion)
    share = np.sqrt(np.diag(pulse.covariance)) / np.abs(pulse.values)
    of = dict(zip(_READ, share, strict=True))
    for name in ("force_peak_n", "impulse_ns", "deflection_max_m"):
        assert of[name] == pytest.approx(0.01, rel=1e-3), name
    for name in ("force_fwhm_s", "contact_time_s"):
        assert of[name] < 1e-4, name

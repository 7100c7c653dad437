"""A collision seen by a camera: what derivatives cannot show is read from the fitted model, and said to be."""

import numpy as np
import pytest

from analysis.motion import Motion
from analysis.pipeline import analyse_motion
from analysis.quantity import Quantity
from analysis.shot import AnalysisSettings, Shot
from analysis.signal.record import motion_from_displacement

MASS_KG, STIFFNESS, DASHPOT, SPEED, REST_M = 0.0912, 190.0, 0.7, 0.17, 0.054


def course() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, place and force of the block on spring and dashpot, by steps of 20 us of the mid-point rule."""
    step, count = 2e-5, 75_000
    time = step * np.arange(count)
    place, force = np.empty(count), np.empty(count)
    x, v = REST_M + 0.6 * SPEED, -SPEED

    def push(x: float, v: float) -> float:
        return -STIFFNESS * (x - REST_M) - DASHPOT * v if x < REST_M else 0.0

    for i in range(count):
        place[i], force[i] = x, push(x, v)
        half_x, half_v = x + 0.5 * step * v, v + 0.5 * step * force[i] / MASS_KG
        x, v = x + step * half_v, v + step * push(half_x, half_v) / MASS_KG
    return time, place, force


def camera(noise_m: float, seed: int = 1) -> tuple[Motion, float, float]:
    """Return what 500 frames a second show, the true peak force and its true width at half of it."""
    time, place, force = course()
    above = np.flatnonzero(force > 0.5 * force.max())
    frames = slice(None, None, 100)
    seen = place[frames] + np.random.default_rng(seed).normal(0.0, noise_m, time[frames].size)
    motion = motion_from_displacement(time[frames], seen, None, None, MASS_KG, 1e-4)
    return motion, float(force.max()), float(time[above[-1]] - time[above[0]])


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


def test_what_derivatives_show_is_left_as_read() -> None:
    motion, peak_n, _ = camera(1e-8)
    shot = analysed(motion)
    assert shot.impact is not None
    assert "read_from_model" not in shot.flags
    assert "pulse_disagrees" not in shot.flags
    assert isinstance(shot.impact.force_peak_n, Quantity)
    assert shot.impact.force_peak_n.value == pytest.approx(peak_n, rel=0.1)

from pathlib import Path

import numpy as np
import pytest

from analysis.shot.shot import AnalysisError
from analysis.signal.record import motion_from_displacement

TIME = np.arange(2000) / 500.0
NOISE = np.random.default_rng(5)


def _wave() -> np.ndarray:
    return 0.05 * np.sin(2 * np.pi * 2 * TIME) + NOISE.normal(0, 2e-5, TIME.size)


def test_displacement_gives_its_derivatives_and_its_noise() -> None:
    motion = motion_from_displacement(TIME, _wave(), None, None, 0.1)
    assert motion.displacement_std_m[0] == pytest.approx(2e-5, rel=0.1)
    left = motion.velocity_m_per_s - 0.05 * 4 * np.pi * np.cos(4 * np.pi * TIME)
    assert np.std(left / motion.velocity_std_m_per_s) == pytest.approx(1, abs=0.1)
    assert motion.wavelength_m is None and motion.flags == ()


def test_velocity_alone_is_integrated() -> None:
    speed = 0.3 * np.cos(2 * np.pi * 2 * TIME) + NOISE.normal(0, 1e-3, TIME.size)
    motion = motion_from_displacement(TIME, None, speed, None, None)
    exact = 0.3 / (4 * np.pi) * np.sin(4 * np.pi * TIME)
    assert np.max(np.abs(motion.displacement_m - exact) / motion.displacement_std_m) < 4.5
    left = motion.velocity_m_per_s - 0.3 * np.cos(4 * np.pi * TIME)
    assert np.std(left[50:-50] / motion.velocity_std_m_per_s[50:-50]) == pytest.approx(1, abs=0.12)
    assert np.isnan(motion.force_n).all()


def test_a_measured_force_is_kept() -> None:
    force = np.sin(TIME) + NOISE.normal(0, 0.01, TIME.size)
    motion = motion_from_displacement(TIME, _wave(), None, force, None)
    assert np.array_equal(motion.force_n, force)
    assert motion.force_std_n[0] == pytest.approx(0.01, rel=0.1)


def test_missing_rows_become_nan_and_jitter_is_resampled() -> None:
    kept = np.ones(TIME.size, bool)
    kept[700:720] = False
    motion = motion_from_displacement(TIME[kept], _wave()[kept], None, None, 0.1)
    assert motion.time_s.size == TIME.size and "gap" in motion.flags
    assert np.isnan(motion.displacement_m[700:720]).all() and not motion.valid[700:720].any()
    jittered = TIME + NOISE.uniform(-1e-4, 1e-4, TIME.size)
    motion = motion_from_displacement(jittered, 0.05 * np.sin(4 * np.pi * jittered), None, None, 0.1)
    assert "uneven_time" in motion.flags
    assert np.allclose(motion.displacement_m, 0.05 * np.sin(4 * np.pi * motion.time_s), atol=1e-8)


@pytest.mark.parametrize(
    ("time", "displacement", "words"),
    [
        (TIME[:5], TIME[:5], "too short"),
        (TIME[::-1], TIME, "rise"),
        (np.cumsum(np.random.default_rng(1).exponential(1, 2000)), TIME, "time_s"),
        (TIME, TIME[:10], "values"),
        (TIME, np.ones(2000), "constant"),
        (TIME, None, "neither"),
    ],
)
def test_a_faulty_record_is_refused(time: np.ndarray, displacement: np.ndarray | None, words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        motion_from_displacement(time, displacement, None, None, 0.1)


@pytest.mark.parametrize(("pause_s", "one_record"), [(4.0, True), (100.0, False)])
def test_a_pause_far_longer_than_the_record_is_not_filled_with_empty_rows(pause_s: float, one_record: bool) -> None:
    """Two records in one file are no record with a gap: it would be as long as the time between them."""
    time = np.where(TIME < 2.0, TIME, TIME + pause_s)
    if one_record:
        motion = motion_from_displacement(time, _wave(), None, None, 0.1)
        assert motion.flags == ("gap",) and motion.time_s[-1] == pytest.approx(time[-1])
    else:
        with pytest.raises(AnalysisError, match="no even sampling"):
            motion_from_displacement(time, _wave(), None, None, 0.1)


def test_the_air_track(measured: Path) -> None:
    table = np.genfromtxt(measured / "airtrack-1.csv", delimiter=",", names=True)
    motion = motion_from_displacement(table["time_s"], table["displacement_m"], None, None, 0.0912)
    assert motion.sample_rate_hz == pytest.approx(500)
    assert 5e-6 < motion.displacement_std_m[0] < 6e-5

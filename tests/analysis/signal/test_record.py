from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from analysis.shot.shot import AnalysisError
from analysis.signal.record import _displacement, _interpolated, motion_from_displacement

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


def test_a_record_s_rate_band_mass_and_flags_are_its_own() -> None:
    motion = motion_from_displacement(TIME, _wave(), None, None, 0.1, 2e-6, bandwidth_hz=40.0)
    assert (motion.sample_rate_hz, motion.bandwidth_hz, motion.displacement_band_hz) == pytest.approx((500, 40, 150))
    assert (motion.moving_mass_kg, motion.moving_mass_u_kg, motion.force_measured) == (0.1, 2e-6, False)
    assert motion.force_n == pytest.approx(0.1 * motion.acceleration_m_per_s2, nan_ok=True)
    assert motion.force_std_n == pytest.approx(0.1 * motion.acceleration_std_m_per_s2, nan_ok=True)
    for asked in (None, 1e4):
        assert motion_from_displacement(
            TIME, _wave(), None, None, 0.1, bandwidth_hz=asked
        ).bandwidth_hz == pytest.approx(100)
    assert motion_from_displacement(TIME, _wave(), None, None, 0.1).moving_mass_u_kg == 0.0
    for mass in (0.0, -0.1):
        with pytest.raises(AnalysisError, match="moving_mass_kg"):
            motion_from_displacement(TIME, _wave(), None, None, mass)


@pytest.mark.parametrize(
    ("off", "how"), [(0.0005, ()), (0.0015, ("uneven_time",)), (0.19, ("uneven_time",)), (0.21, None)]
)
def test_times_may_be_off_an_even_grid_by_a_fifth_of_a_step(off: float, how: tuple[str, ...] | None) -> None:
    time = TIME.copy()
    time[700] += off / 500.0
    if how is None:
        with pytest.raises(AnalysisError, match="row 701 is 21% of a step off"):
            motion_from_displacement(time, _wave(), None, None, 0.1)
    else:
        assert motion_from_displacement(time, _wave(), None, None, 0.1).flags == how


def test_a_cubic_is_moved_to_an_even_grid_without_error_also_at_its_ends() -> None:
    at = np.arange(40.0) + np.random.default_rng(1).uniform(-0.2, 0.2, 40)
    cubic = np.polynomial.Polynomial([1.0, -0.3, 0.02, 1e-3])
    assert _interpolated(np.arange(40.0), at, cubic(at)) == pytest.approx(cubic(np.arange(40.0)), abs=1e-9)


def test_the_integral_of_a_velocity_is_that_of_its_trapezoids_and_its_noise_grows_as_a_walk() -> None:
    speed = np.cos(TIME) + NOISE.normal(0, 1e-3, TIME.size)
    x, std, walk = _displacement({"velocity_m_per_s": speed}, 500.0)
    assert x == pytest.approx(cumulative_trapezoid(speed, TIME, initial=0.0), abs=1e-12)
    assert walk == pytest.approx(1e-3 / np.sqrt(500.0), rel=0.1)
    assert std[[0, 99]] == pytest.approx([1e-3 / 500.0, 10 * 1e-3 / 500.0], rel=0.1)
    speed[7] = np.nan
    with pytest.raises(AnalysisError, match="missing values"):
        _displacement({"velocity_m_per_s": speed}, 500.0)


@pytest.mark.parametrize("rows", [31, 32])
def test_a_record_has_at_least_32_rows(rows: int) -> None:
    if rows < 32:
        with pytest.raises(AnalysisError, match="31 rows are too short"):
            motion_from_displacement(TIME[:rows], _wave()[:rows], None, None, 0.1)
    else:
        assert motion_from_displacement(TIME[:rows], _wave()[:rows], None, None, 0.1).time_s.size == 32

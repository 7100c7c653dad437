"""A collision seen by a camera is read from the fitted model, and flagged so."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.fitted.readings_from_fit import (
    HOW,
    _derivatives,
    _first_contact_span,
    _pulse,
    _read,
    with_model_readings,
)
from analysis.pipeline import analyse_motion
from analysis.shot.motion import Motion
from analysis.shot.quantity import NotSeen, Quantity
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
    """Peak and deflection of a linear contact are in proportion to the speed, width and duration are not."""
    shot, motion, _ = low_noise
    assert shot.fit is not None
    (own,) = shot.fit.shots
    unsure = replace(own.velocity_in_m_per_s, std=0.01 * abs(own.velocity_in_m_per_s.value))
    sure = np.zeros_like(shot.fit.covariance)
    fit = replace(shot.fit, covariance=sure, shots=(replace(own, velocity_in_m_per_s=unsure),), reduced_chi2=1.0)
    of = {name: reading.std / abs(reading.value) for name, reading in _pulse(fit, motion).items()}
    for name in ("force_peak_n", "deflection_max_m"):
        assert of[name] == pytest.approx(0.01, rel=1e-3), name
    for name in ("force_fwhm_s", "contact_time_s"):
        assert of[name] < 1e-4, name


def test_a_half_sine_of_force_is_read_as_its_closed_form() -> None:
    mass_kg, peak_n, lasts_s, begin_s = 0.5, 3.0, 0.04, 1.013
    time_s = np.linspace(1.0, 1.08, 8001)
    inside = np.clip(time_s - begin_s, 0.0, lasts_s)
    turn = np.pi / lasts_s
    velocity = -0.1 + peak_n / mass_kg / turn * (1.0 - np.cos(turn * inside))
    place = 7.0 + np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time_s))])
    changes = (begin_s, begin_s + lasts_s)
    found = _read(time_s, velocity, place, changes, mass_kg)
    deepest = np.interp(begin_s, time_s, place) - place[time_s <= begin_s + lasts_s].min()
    np.testing.assert_allclose(found, [peak_n, 2.0 / 3.0 * lasts_s, lasts_s, deepest], rtol=1e-4)
    cut = time_s > begin_s + lasts_s / 5.0  # the force is above its half from the first sample on
    for kept in (cut, time_s < begin_s + 0.8 * lasts_s):
        with pytest.raises(ValueError, match="not whole"):
            _read(time_s[kept], velocity[kept], place[kept], changes, mass_kg)
    with pytest.raises(ValueError, match="not whole"):
        _read(time_s, velocity, place, changes[:1], mass_kg)


def test_derivatives_are_differences_over_what_a_parameter_is_unsure_by() -> None:
    slopes = np.arange(12.0).reshape(4, 3) - 4.0
    fit: Any = SimpleNamespace(covariance=np.diag([4.0, 0.0, 9.0]))
    asked: list[np.ndarray] = []

    def function(z: np.ndarray) -> np.ndarray:
        asked.append(z)
        return slopes @ z + z[0] ** 3

    at = np.array([1.0, 2.0, 3.0])
    found = _derivatives(function, at, fit, 0.5)
    cubic = 3.0 + 0.6**2  # of a central difference over three tenths of two
    np.testing.assert_allclose(found, slopes * [1, 0, 1] + np.outer(np.ones(4), [cubic, 0.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(sorted(z[2] for z in asked), [2.85, 3.0, 3.0, 3.15])


def test_the_first_contact_is_solved_with_room_on_both_sides() -> None:
    def span(*events: tuple[str, float]) -> tuple[float, float]:
        fit: Any = SimpleNamespace(shots=[SimpleNamespace(overlay=SimpleNamespace(events_s=events))])
        motion: Any = SimpleNamespace(time_s=np.array([0.0, 5.0]))
        return _first_contact_span(1.0, fit, motion)

    assert span(("release", 0.5), ("turn", 1.5), ("release", 3.0), ("release", 4.0)) == (0.5, 4.0)
    assert span(("release", 0.5), ("turn", 1.5)) == (0.0, 7.0)


@pytest.mark.parametrize(("share", "agrees"), [(0.49, False), (0.51, True), (1.29, True), (1.31, False)])
def test_peak_times_width_must_make_the_impulse(
    low_noise: tuple[Shot, Motion, float], share: float, agrees: bool
) -> None:
    shot, motion, _ = low_noise
    assert shot.impact is not None and shot.fit is not None
    speeds = [shot.impact.velocity_in_m_per_s, shot.impact.velocity_out_m_per_s]
    assert all(isinstance(speed, Quantity) for speed in speeds)
    impulse = motion.moving_mass_kg * (speeds[1].value - speeds[0].value)  # type: ignore[union-attr]
    read = replace(shot.impact, force_peak_n=Quantity(2.0, 0.0), force_fwhm_s=Quantity(share * impulse / 2.0, 0.0))
    checked = with_model_readings(read, shot.fit, motion)
    assert checked.flags == (*read.flags, *(() if agrees else ("pulse_disagrees",)))
    assert with_model_readings(checked, shot.fit, motion) == checked
    unseen = replace(read, force_peak_n=NotSeen("gone"))
    assert with_model_readings(unseen, shot.fit, motion) == unseen


@pytest.mark.parametrize(("drowned", "chi2", "wider"), [(0.09, 1.0, 1.0), (0.11, 0.2, 1.0), (0.11, 4.0, 2.0)])
def test_a_force_drowned_to_a_tenth_of_its_peak_is_read_from_the_model(
    low_noise: tuple[Shot, Motion, float], drowned: float, chi2: float, wider: float
) -> None:
    shot, motion, _ = low_noise
    assert shot.impact is not None and shot.fit is not None
    fit = replace(shot.fit, reduced_chi2=1.0)
    pulse = _pulse(fit, motion)
    stds = np.full(motion.force_std_n.size, drowned * pulse["force_peak_n"].value)
    stds[:3] = np.nan
    noisy = replace(motion, force_std_n=stds)
    read = with_model_readings(shot.impact, replace(fit, reduced_chi2=chi2), noisy)
    if drowned < 0.1:
        assert read == shot.impact
        return
    assert read.flags == (*shot.impact.flags, "read_from_model")
    for name, reading in pulse.items():
        found = getattr(read, name)
        assert (found.value, found.how) == (reading.value, HOW), name
        assert found.std == pytest.approx(wider * reading.std, rel=1e-9), name
    assert isinstance(read.cor_impulse, NotSeen) and isinstance(read.stiffness_slope_n_per_m, NotSeen)
    for unfit, of in (
        (replace(fit, converged=False), noisy),
        (replace(fit, shots=fit.shots * 2), noisy),
        (replace(fit, model="driven", shots=()), noisy),
        (fit, replace(noisy, wavelength_m=633e-9)),
    ):
        assert with_model_readings(shot.impact, unfit, of) is shot.impact

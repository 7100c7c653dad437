"""The band of a motion's noise, sine by sine and part by part, against sums over time."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.shot.impact import VibrationSpectrum
from analysis.shot.quantity import Quantity
from analysis.signal.filters import derivative_filters, derivative_gains, derivatives
from analysis.uncertainty.noise_band import (
    _frame_motion_std_m,
    _share_after_fit,
    _wander_std,
    noise_band_of_motion,
    noise_band_of_shot,
    path_wander,
)
from tests.analysis.shots import shot_of
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_from

RIG = Synthetic(rate_hz=1e4, bandwidth_hz=1e3, noise_m=1e-9)
TIME_S = np.arange(0.0, 0.2, 1 / RIG.rate_hz)
MOTION = motion_from(TIME_S, -0.2 * TIME_S, RIG)
SPAN_S = float(TIME_S[-1])
SHAKING = VibrationSpectrum(np.array([1.5, 40.0, 310.0]), np.array([4e-15, 9e-18, 1e-18]), np.ones(3, np.bool_))


def waves(frequency_hz: float) -> Any:
    return np.stack([np.cos(2 * np.pi * frequency_hz * TIME_S), np.sin(2 * np.pi * frequency_hz * TIME_S)])


@pytest.mark.parametrize("terms", [1, 2])
def test_a_fit_absorbs_what_its_polynomial_does_of_each_sine(terms: int) -> None:
    left = _share_after_fit(SHAKING, SPAN_S, terms)
    for share, frequency in zip(left, SHAKING.frequency_hz, strict=True):
        both = waves(frequency)
        rest = [one - np.polyval(np.polyfit(TIME_S, one, terms - 1), TIME_S) for one in both]
        assert share == pytest.approx(np.mean(np.square(rest)) * 2, rel=0.02)


def test_the_band_is_white_noise_and_vibration_through_the_motions_own_filters() -> None:
    band = noise_band_of_motion(MOTION, SHAKING)
    white = derivative_gains(np.ones(TIME_S.size, np.bool_), RIG.rate_hz, RIG.bandwidth_hz)
    variance = [0.0, 0.0, 0.0]
    for frequency, power in zip(SHAKING.frequency_hz, SHAKING.power_m2, strict=True):
        both = waves(frequency)
        moved = [derivatives(one, RIG.rate_hz, RIG.bandwidth_hz) for one in both]
        rest = [one - np.polyval(np.polyfit(TIME_S, one, 1), TIME_S) for one in both]
        variance[0] += power * 2 * np.mean(np.square(rest))
        # the fit's speed takes a constant off the velocity
        speeds = [one[0] - one[0].mean() for one in moved]
        variance[1] += power * 2 * np.mean(np.square(speeds))
        variance[2] += power * 2 * np.mean(np.square([one[1][100:-100] for one in moved]))
    expected = [  # at the ends the filters let other noise pass
        np.hypot(RIG.noise_m, np.sqrt(variance[0])),
        np.hypot(RIG.noise_m * white[0], np.sqrt(variance[1])),
        MASS_KG * np.hypot(RIG.noise_m * white[1], np.sqrt(variance[2])),
    ]
    assert band.displacement_m == pytest.approx(expected[0], rel=0.02)
    assert band.velocity_m_per_s == pytest.approx(expected[1], rel=0.05)
    assert band.force_n == pytest.approx(expected[2], rel=0.02)
    left_m = np.linspace(1e-9, 2e-9, TIME_S.size)
    given = noise_band_of_motion(MOTION, SHAKING, left_m)
    assert given.displacement_m == pytest.approx(np.hypot(RIG.noise_m, left_m))
    assert np.array_equal(given.force_n, band.force_n, equal_nan=True)


def test_what_wanders_is_a_forgetful_walk_behind_each_filter() -> None:
    rms_m, memory_s = 2e-9, 5e-4
    random, size = np.random.default_rng(1), 200_000
    keep = np.exp(-1 / RIG.rate_hz / memory_s)
    steps = rms_m * np.sqrt(1 - keep**2) * random.standard_normal(size)
    walk = np.zeros(size)
    for k in range(1, size):
        walk[k] = keep * walk[k - 1] + steps[k]
    filters = derivative_filters(RIG.rate_hz, RIG.bandwidth_hz)
    for taps in (np.ones(1), filters.velocity, filters.acceleration):
        seen = np.convolve(walk, taps[::-1], "valid")
        assert _wander_std(((rms_m, memory_s),), taps, RIG.rate_hz) == pytest.approx(seen.std(), rel=0.05)
        two = _wander_std(((rms_m, memory_s), (2 * rms_m, memory_s)), taps, RIG.rate_hz)
        assert two == pytest.approx(np.sqrt(5.0) * _wander_std(((rms_m, memory_s),), taps, RIG.rate_hz))
    band, calm = (
        noise_band_of_motion(MOTION, SHAKING, wander=((rms_m, memory_s),)),
        noise_band_of_motion(MOTION, SHAKING),
    )
    for name, taps, mass in (
        ("displacement_m", np.ones(1), 1.0),
        ("velocity_m_per_s", filters.velocity, 1.0),
        ("force_n", filters.acceleration, MASS_KG),
    ):
        more = np.sqrt(getattr(band, name)[1000] ** 2 - getattr(calm, name)[1000] ** 2)
        assert more == pytest.approx(mass * _wander_std(((rms_m, memory_s),), taps, RIG.rate_hz), rel=1e-6)


@pytest.mark.parametrize(("times", "learnt"), [(1.09, False), (1.11, True)])
def test_the_noise_a_fit_estimated_is_the_band_where_it_is_a_tenth_more_than_the_samples_own(
    times: float, learnt: bool
) -> None:
    shot = shot_of(motion=MOTION)
    assert shot.fit is not None
    fitted = replace(shot, fit=replace(shot.fit, noise_std_m=times * RIG.noise_m))
    band = noise_band_of_shot(fitted).displacement_m
    assert band == pytest.approx(times * RIG.noise_m if learnt else RIG.noise_m)
    assert noise_band_of_shot(replace(shot, fit=None)).displacement_m == pytest.approx(RIG.noise_m)


def test_only_a_converged_fit_tells_what_wanders() -> None:
    shot = shot_of()
    assert shot.fit is not None
    wanders = replace(shot.fit, wander=((1e-9, 1e-3),))
    assert path_wander(replace(shot, fit=wanders)) == ((1e-9, 1e-3),)
    assert path_wander(replace(shot, fit=replace(wanders, converged=False))) == ()
    assert path_wander(replace(shot, fit=None)) == ()


def test_a_shots_part_of_a_joint_fit_is_that_with_its_speed_and_samples() -> None:
    def part(speed: float, size: int, std: float) -> Any:
        return SimpleNamespace(
            velocity_in_m_per_s=Quantity(speed, 0.0), residual_m=np.zeros(size), sway_std_m=np.full(size, std)
        )

    size = TIME_S.size
    joint = cast(Any, SimpleNamespace(shots=(part(-0.3, size, 1.0), part(-0.21, size, 2.0), part(0.2, size, 3.0))))
    shot = shot_of(motion=MOTION)
    assert shot.fit is not None
    own = replace(shot, fit=replace(shot.fit, shots=(part(-0.2, size, 9.0),)))
    found = _frame_motion_std_m(joint, own)
    assert found is not None and np.all(found == 2.0)
    shorter = cast(Any, SimpleNamespace(shots=(part(-0.2, size - 1, 1.0),)))
    assert (
        _frame_motion_std_m(shorter, own) is None
        and _frame_motion_std_m(cast(Any, SimpleNamespace(shots=())), own) is None
    )
    assert _frame_motion_std_m(joint, replace(own, motion=None)) is None and _frame_motion_std_m(joint, shot) is None

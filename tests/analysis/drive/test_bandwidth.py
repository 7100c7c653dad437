"""The band in which force and motion of a drive are compared."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.drive.bandwidth import _acceleration_gains, _clear_hz, _equal_noise_hz, bandwidth_of, force_noise
from analysis.shot.shot import AnalysisError
from analysis.signal.filters import MAX_BANDWIDTH_SHARE, derivative_filters
from tests.analysis.drive.slider import RATE_HZ, Drive, Floats


def above_noise(times: float, up_to_hz: float, rate_hz: float, seed: int) -> Floats:
    """Return white noise of 1 m, of ``times`` that power up to a frequency."""
    random = np.random.default_rng(seed)
    spectrum = np.fft.rfft(random.standard_normal(2**16))
    spectrum[np.fft.rfftfreq(2**16, 1.0 / rate_hz) > up_to_hz] *= 0.0
    return np.asarray(np.sqrt(times - 1.0) * np.fft.irfft(spectrum) + random.standard_normal(2**16))


@pytest.mark.parametrize(
    ("times", "noise_m", "clear"),
    [
        (150.0, 1.0, True),
        (70.0, 1.0, False),
        (70.0, 0.7, True),  # half the noise power
        (150.0, 3.0, True),  # noise that is stated too high: the top of the spectrum shows less
        (70.0, 3.0, False),
    ],
)
def test_a_band_reaches_as_far_as_the_motion_is_a_hundred_times_its_noise(
    times: float, noise_m: float, clear: bool
) -> None:
    place = above_noise(times, 80.0, 1000.0, 3)
    found = _clear_hz(place, 1000.0, noise_m)
    if clear:
        assert 80.0 / 2**0.25 < found < 80.0 * 2**0.25
    else:
        assert found < 10.0


def test_of_a_record_with_a_gap_the_longest_part_decides() -> None:
    motion = Drive(seconds=14.0, encoder_m=2e-6).motion()
    place, at = motion.displacement_m.copy(), 800
    place[:at] += np.random.default_rng(1).normal(0.0, 2e-4, at)
    place[at] = np.nan
    known, number = replace(motion, displacement_m=place), np.arange(place.size)
    later = replace(known, displacement_m=np.where(number > at, place, np.nan))
    sooner = replace(known, displacement_m=np.where(number < at, place, np.nan))
    assert bandwidth_of(known) == bandwidth_of(later) != bandwidth_of(sooner)
    behind = replace(motion, displacement_m=place[::-1], force_n=motion.force_n[::-1])
    assert bandwidth_of(behind) == pytest.approx(bandwidth_of(later), rel=1e-9)
    force = motion.force_n.copy()
    force[:at] += np.random.default_rng(2).normal(0.0, 9.0, at)
    force[at] = np.nan
    later_force = np.where(number > at, force, np.nan)
    for way in (1, -1):
        noises = [force_noise(replace(motion, force_n=one[::way])) for one in (force, later_force)]
        assert noises[0] == noises[1] == pytest.approx(0.3, rel=0.1)


def test_a_band_is_as_wide_as_the_filters_can_at_most_and_as_narrow_as_the_record_lets_it_at_least() -> None:
    exact = Drive(encoder_m=1e-9, noise_n=1.0).motion()
    assert bandwidth_of(exact) == pytest.approx(MAX_BANDWIDTH_SHARE * RATE_HZ)
    coarse = Drive(encoder_m=1e-3, noise_n=1e-3, seconds=20.0).motion()
    assert bandwidth_of(coarse) == pytest.approx(60.0 / 20.0)


def test_a_record_without_motion_or_too_short_is_refused_and_one_just_beyond_is_not() -> None:
    motion = Drive().motion()
    noise_m = float(np.nanmedian(motion.displacement_std_m))
    swing = np.sin(2 * np.pi * motion.time_s)
    for size, moves in ((9.9, False), (10.1, True)):
        little = replace(motion, displacement_m=size * noise_m * swing)
        if moves:
            assert bandwidth_of(little) > 0.0
        else:
            with pytest.raises(AnalysisError, match="no motion"):
                bandwidth_of(little)
    least = math.ceil(60.0 / MAX_BANDWIDTH_SHARE)
    for size, lasts in ((least - 1, False), (least, True)):
        short = replace(motion, force_n=np.where(np.arange(motion.force_n.size) < size, motion.force_n, np.nan))
        if lasts:
            assert bandwidth_of(short) == pytest.approx(MAX_BANDWIDTH_SHARE * RATE_HZ, rel=0.01)
        else:
            with pytest.raises(AnalysisError, match=rf"^{size} samples .*at least {least}"):
                bandwidth_of(short)
    with pytest.raises(AnalysisError, match=r"^0 samples"):
        bandwidth_of(replace(motion, force_n=np.full(motion.force_n.size, np.nan)))


def test_noise_gains_are_those_of_the_derivative_filters_at_any_rate() -> None:
    gains = _acceleration_gains()
    shares = np.array([share for share, _ in gains])
    assert shares[0] == pytest.approx(0.005) and shares[-1] == pytest.approx(MAX_BANDWIDTH_SHARE)
    for share, gain in gains[::13]:
        assert derivative_filters(200.0, 200.0 * share).acceleration_gain == pytest.approx(gain * 200.0**2, rel=1e-9)


@pytest.mark.parametrize("noise_n", [0.05, 0.5, 5.0])
@pytest.mark.parametrize("mass_kg", [-3.0, 90.0])
def test_a_band_is_as_wide_as_the_noise_of_mass_times_acceleration_is_below_that_of_the_force(
    mass_kg: float, noise_n: float
) -> None:
    """Whatever the sign of the force; drag, friction and an offset are none of the mass."""
    rate, time_s = 200.0, np.arange(4000) / 200.0
    place = 0.05 * np.sin(3.0 * time_s) + 0.02 * np.sin(11.0 * time_s)
    velocity = 0.15 * np.cos(3.0 * time_s) + 0.22 * np.cos(11.0 * time_s)
    acceleration = -0.45 * np.sin(3.0 * time_s) - 2.42 * np.sin(11.0 * time_s)
    force = mass_kg * acceleration + 40.0 * velocity + 7.0 * np.sign(velocity) - 3.0
    found = _equal_noise_hz(place, force, rate, 20.0, (1e-6, noise_n))
    wide = 0.0
    for share in np.geomspace(0.005, MAX_BANDWIDTH_SHARE, 40):
        moved = abs(mass_kg) * 1e-6 * derivative_filters(rate, rate * share).acceleration_gain
        if moved < noise_n * np.sqrt(2.0 * share):  # of white noise the filter leaves so much of the force's
            wide = rate * share
    assert found == pytest.approx(wide)

"""The frame: its density as the criterion curves are drawn, its plate as an oscillator that it shakes, its knocks."""

import numpy as np
import pytest

from instrument.bench.frame import PLATE_QUALITY, Frame, density_m2_per_hz, frame_of
from instrument.bench.sines import Sines
from instrument.bench.site import LEVELS_M_PER_S, QUIET, Knock, Line, Site, site_named

NO_SINES = Sines(*(np.empty(0) for _ in range(3)))


def test_a_criterion_is_level_from_8_to_80_hz_and_falls_to_both_sides_within_1_to_250_hz():
    frequency = np.array([0.99, 1.0, 4.0, 8.0, 25.0, 80.0, 160.0, 250.0, 251.0])
    density = density_m2_per_hz(Site(third_octave_m_per_s=1e-5), frequency)
    third_octave = np.log(2 ** (1 / 3)) * frequency
    rms = np.sqrt(density * third_octave) * 2 * np.pi * frequency
    assert rms / 1e-5 == pytest.approx([0, 0.125, 0.5, 1, 1, 1, 0.25, (80 / 250) ** 2, 0], rel=1e-12)


def test_a_measured_spectrum_adds_to_the_criterion_and_is_straight_between_its_points_on_log_scales():
    site = Site(spectrum=((10.0, 1e-4), (40.0, 4e-4)))
    frequency = np.array([9.9, 10.0, 20.0, 40.0, 40.1])
    density = density_m2_per_hz(site, frequency)
    acceleration = np.sqrt(density) * (2 * np.pi * frequency) ** 2
    assert acceleration == pytest.approx([0.0, 1e-4, 2e-4, 4e-4, 0.0], rel=1e-12)
    both = density_m2_per_hz(Site(third_octave_m_per_s=1e-5, spectrum=site.spectrum), frequency)
    alone = density_m2_per_hz(Site(third_octave_m_per_s=1e-5), frequency)
    assert both / (density + alone) == pytest.approx(1.0, rel=1e-12)


def test_the_sines_of_a_frame_cover_its_band_and_are_dense_enough_that_a_record_does_not_resolve_them():
    frame = frame_of(Site(third_octave_m_per_s=1e-6, lines=(Line(33.0, 2e-6),)), 7)
    frequency = frame.sines.omega / (2 * np.pi)
    assert frequency[-1] == pytest.approx(33.0) and frame.sines.amplitude_m[-1] == 2e-6
    random = frequency[:-1]
    assert np.all(np.diff(random) > 0) and 1.0 <= random[0] < 1.1 and 249.7 < random[-1] <= 250.0
    # neighbours are drawn from bands of 0.15 Hz, or of a twelfth of a third-octave where that is narrower
    widest = np.minimum(0.15, random[1:] * (2 ** (1 / 36) - 1))
    assert np.all(np.diff(random) < 2.1 * widest)
    assert np.diff(random).mean() == pytest.approx(249.0 / (random.size - 1), rel=0.01)
    assert random.size == pytest.approx((250 - 7.7) / 0.15 + np.log2(7.7) * 36, rel=0.02)
    wide = frame_of(Site(spectrum=((0.5, 1e-5), (400.0, 1e-5))), 7).sines.omega / (2 * np.pi)
    assert wide.min() < 0.55 and wide.max() > 399


def test_the_power_of_a_frame_is_the_integral_of_its_density():
    site = Site(third_octave_m_per_s=1e-6)
    fine = np.geomspace(1.0, 250.0, 20_001)
    expected = np.trapezoid(density_m2_per_hz(site, fine), fine)
    power = [np.sum(frame_of(site, seed).sines.amplitude_m ** 2) / 2 for seed in range(200)]
    assert np.mean(power) / expected == pytest.approx(1.0, rel=0.1)


def test_a_later_clock_shows_the_same_frame():
    frame = frame_of(Site(third_octave_m_per_s=1e-6, knocks=(Knock(1e-6, at_s=0.02),)), 3).with_knocks(0.5, 0)
    time_s = np.linspace(0.0, 0.1, 300)
    for one, other in zip(frame.from_time(0.48).motion(time_s), frame.motion(0.48 + time_s), strict=True):
        assert one == pytest.approx(other, rel=0, abs=2e-5 * np.abs(other).max())


def test_the_plate_swings_as_an_oscillator_on_the_shaken_frame():
    """Relative to the frame: z'' + w z' / Q + w^2 z = -a, with the frame's acceleration a."""
    omega = 900.0
    frame = Frame(QUIET, 0, Sines(np.array([300.0, 905.0]), np.array([1e-6, 2e-8]), np.array([0.4, 2.0])))
    step = 1e-5
    z, v = np.array([frame.from_time(k * step).plate_response(omega) for k in range(2000)]).T
    middle = slice(2, -2)
    assert np.gradient(z, step)[middle] == pytest.approx(v[middle], rel=0, abs=1e-4 * np.abs(v).max())
    a = frame.sines.acceleration(step, 2000)[0]
    left = np.gradient(v, step) + v * omega / PLATE_QUALITY + omega**2 * z + a
    assert np.abs(left[middle]).max() < 1e-3 * np.abs(a).max()


def test_knocks_come_in_their_share_of_the_shots_at_any_time_of_it_and_to_either_side():
    frame = frame_of(Site(knocks=(Knock(5e-8, share=0.25),)), 11)
    knocked = [frame.with_knocks(10.0, shot) for shot in range(400)]
    struck = [one.ringing[0] for one in knocked if one.ringing]
    assert len(struck) == pytest.approx(100, abs=30)
    starts = np.array([one.start_s for one in struck]) - 10.0
    assert 0.0 <= starts.min() < 0.003 and 0.05 < starts.max() <= 0.055
    to_the_right = sum(one.amplitude[0].real > 0 for one in struck)
    assert to_the_right == pytest.approx(len(struck) / 2, abs=20)
    again = frame.with_knocks(10.0, 0).with_knocks(20.0, 1)
    assert len(again.ringing) <= 1  # of this shot alone
    assert knocked[3] == frame.with_knocks(10.0, 3)


def test_a_knock_rings_at_its_frequency_and_decays_as_stated():
    frame = frame_of(Site(knocks=(Knock(50e-9, frequency_hz=80.0, decay_s=0.02, at_s=0.01),)), 1).with_knocks(0.0, 0)
    x = np.abs(frame.motion(np.arange(0.0, 0.1, 1e-5))[0])
    peaks = np.flatnonzero((x[1:-1] > x[:-2]) & (x[1:-1] > x[2:]) & (x[1:-1] > 1e-10)) + 1
    late = peaks[peaks > 2500]
    assert np.diff(late) * 1e-5 == pytest.approx(1 / 160, rel=0.01)
    assert x[late[1:]] / x[late[:-1]] == pytest.approx(np.exp(-1 / 160 / 0.02), rel=0.01)


def test_criteria_halve_from_one_to_the_next_and_bring_machines_in_proportion():
    levels = [LEVELS_M_PER_S[f"VC-{letter}"] for letter in "ABCDEFG"]
    assert levels[0] == pytest.approx(50e-6) and np.array(levels[:-1]) / levels[1:] == pytest.approx(2.0, rel=0.1)
    at_c, at_a = site_named("VC-C"), site_named("vc-a")
    assert at_c.lines == (Line(24.9, 40e-9), Line(100.0, 15e-9), Line(296.0, 8e-9))
    ratios = [a.amplitude_m / c.amplitude_m for a, c in zip(at_a.lines, at_c.lines, strict=True)]
    assert ratios == pytest.approx([levels[0] / levels[2]] * 3) and (at_c.name, at_a.name) == ("VC-C", "VC-A")
    assert at_a.third_octave_m_per_s == levels[0] and site_named("QUIET") is QUIET


@pytest.mark.parametrize(
    ("make", "low", "high"),
    [
        (lambda v: Line(v, 0.0), 0.1, 2000.0),
        (lambda v: Line(1.0, v), 0.0, 1e-3),
        (lambda v: Knock(v), 0.0, 1e-3),
        (lambda v: Knock(0.0, frequency_hz=v), 1.0, 1000.0),
        (lambda v: Knock(0.0, decay_s=v), 1e-3, 10.0),
        (lambda v: Knock(0.0, share=v), 0.0, 1.0),
        (lambda v: Knock(0.0, at_s=v), 0.0, 10.0),
        (lambda v: Site(third_octave_m_per_s=v), 0.0, 1e-2),
        (lambda v: Site(spectrum=tuple(sorted([(v, 1e-4), (100.0, 1e-4)]))), 0.1, 2000.0),
        (lambda v: Site(spectrum=((1.0, v), (2.0, 1e-4))), 1e-15, 10.0),
    ],
)
def test_a_site_is_simulated_up_to_its_limits_and_not_beyond(make, low, high):
    make(low)
    make(high)
    for beyond in (low - 1e-3 * (abs(low) or 1e-3), high * 1.001):
        with pytest.raises(ValueError, match=r"simulated|Hz"):
            make(beyond)

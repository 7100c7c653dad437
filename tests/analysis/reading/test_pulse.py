"""What is read of a force pulse, on pulses whose numbers are known in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, quad

from analysis.reading import pulse
from analysis.reading.edges import Edge
from analysis.reading.flight import Flight
from analysis.reading.floor_spectrum import FloorSpectrum, Octaves
from analysis.reading.pulse import (
    _force_std,
    _integral,
    find_turnaround,
    read_deflection,
    read_fwhm,
    read_impulse_ratio,
    read_momentum,
    read_peak,
    read_slope,
    smooth_force,
    with_short_holes_closed,
)
from analysis.shot.motion import Motion
from analysis.shot.quantity import NotSeen, Quantity
from analysis.signal.filters import derivative_filters
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_from

Floats = NDArray[np.float64]
RIG = Synthetic(rate_hz=2e4, bandwidth_hz=2e3)
TIME_S = np.arange(0.0, 0.1, 1 / RIG.rate_hz)
TOUCH, RELEASE = Edge(0.03, 0.0), Edge(0.07, 0.0)


def floor_of(speed_m_per_s: float = 0.0, white_m: float = RIG.noise_m) -> FloorSpectrum:
    """Return a floor that moves at one speed in every octave."""
    octaves = Octaves.of(TIME_S[::10], 10 / RIG.rate_hz)
    power = np.full(octaves.centre_hz.size, speed_m_per_s**2)
    return FloorSpectrum(octaves, power, white_m, RIG.rate_hz)


def motion_with(**changes: Any) -> Motion:
    whole = motion_from(TIME_S, -0.2 * TIME_S, RIG)
    return replace(whole, **{"moving_mass_u_kg": 0.0, **changes})


def seen(reading: object) -> Quantity:
    assert isinstance(reading, Quantity), reading
    return reading


@pytest.mark.parametrize("contact_s", [0.04, 1e-4])  # 2 % of it; the least: two samples
def test_a_short_hole_is_closed_with_the_impulse_that_the_velocities_at_its_sides_tell(contact_s: float) -> None:
    longest = max(int(0.02 * contact_s * RIG.rate_hz + 1e-9), 2)
    force = 0.5 * np.sin(60.0 * TIME_S) + 0.2
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]))]) / RIG.rate_hz / MASS_KG
    velocity[650:] += 1e-3  # what the hole hides
    for missing in (longest, longest + 1):
        holed = force.copy()
        holed[650 - missing // 2 : 650 - missing // 2 + missing] = np.nan
        hole = np.flatnonzero(np.isnan(holed))
        before, after = hole[0] - 1, hole[-1] + 1
        got = with_short_holes_closed(motion_with(force_n=holed, velocity_m_per_s=velocity), contact_s).force_n
        if missing > longest:
            assert np.array_equal(got, holed, equal_nan=True)
            continue
        assert np.array_equal(got[~np.isnan(holed)], holed[~np.isnan(holed)])
        impulse = np.trapezoid(got[before : after + 1]) / RIG.rate_hz
        assert impulse == pytest.approx(MASS_KG * (velocity[after] - velocity[before]), rel=1e-9)
        raised = got[hole] - np.interp(hole, [before, after], force[[before, after]])
        assert np.ptp(raised) < 1e-9 and raised[0] > 0.01


def test_holes_at_the_ends_of_a_record_stay_and_those_between_them_are_closed() -> None:
    force = np.ones(TIME_S.size)
    force[:3] = force[50:52] = force[90:91] = force[-2:] = np.nan
    closed = with_short_holes_closed(motion_with(force_n=force, velocity_m_per_s=TIME_S / MASS_KG), 0.04).force_n
    assert np.flatnonzero(np.isnan(closed)).tolist() == [0, 1, 2, TIME_S.size - 2, TIME_S.size - 1]
    assert closed[3:-2] == pytest.approx(1.0, rel=1e-9)
    nothing = motion_with(force_n=np.full(TIME_S.size, np.nan))
    assert with_short_holes_closed(nothing, 0.04) is nothing


@pytest.mark.parametrize("times", [0.25, 1.0, 2.0])  # of the cut-off
def test_a_low_pass_has_the_gain_of_a_butterworth_filter_passed_both_ways(times: float) -> None:
    cutoff_hz = 200.0
    wave = np.sin(2 * np.pi * times * cutoff_hz * TIME_S)
    force = 0.3 + 5.0 * TIME_S + wave
    force[[*range(17), *range(-5, 0)]] = np.nan
    smooth = smooth_force(motion_with(force_n=force), cutoff_hz)
    assert smooth is not None and np.array_equal(np.isnan(smooth), np.isnan(force))
    inner = slice(500, 1500)
    expected = 0.3 + 5.0 * TIME_S + wave / (1.0 + times**4)
    assert smooth[inner] == pytest.approx(expected[inner], abs=2e-3 / (1.0 + times**4))
    straight = smooth_force(motion_with(force_n=force - wave), cutoff_hz)  # up to the record's ends
    assert straight is not None and straight[17:-5] == pytest.approx((force - wave)[17:-5], abs=2e-3)


def test_a_force_is_smoothed_without_holes_below_half_the_rate_and_over_65_samples_at_least() -> None:
    force = np.ones(TIME_S.size)
    assert smooth_force(motion_with(force_n=force), 0.449 * RIG.rate_hz) is not None
    assert smooth_force(motion_with(force_n=force), 0.45 * RIG.rate_hz) is None
    assert smooth_force(motion_with(force_n=np.where(TIME_S[900] == TIME_S, np.nan, force)), 200.0) is None
    for samples, is_read in ((64, False), (65, True)):
        short = np.where(np.arange(TIME_S.size) < samples, force, np.nan)
        assert (smooth_force(motion_with(force_n=short), 200.0) is not None) is is_read


def test_the_top_of_a_pulse_is_that_of_its_parabola_past_the_first_fifth() -> None:
    top_s = 0.0482031
    force = 0.5 - 900.0 * (TIME_S - top_s) ** 2
    spiked = np.where((TIME_S < 0.03 + 0.2 * 0.04) | (TIME_S > 0.03 + 0.98 * 0.04), 2.0, force)  # of bounces
    reading = seen(read_peak(motion_with(force_n=spiked), TOUCH, RELEASE, floor_of()))
    assert reading.value == pytest.approx(0.5, rel=1e-9)
    assert reading.how == "parabola over ±1.6 ms about 48.20 ms, 2000 Hz"
    assert isinstance(read_peak(motion_with(force_n=-force), TOUCH, RELEASE, floor_of()), NotSeen)
    holed = np.where(np.abs(TIME_S - 0.05) < 1e-5, np.nan, force)
    assert isinstance(read_peak(motion_with(force_n=holed), TOUCH, RELEASE, floor_of()), NotSeen)


@pytest.mark.parametrize("speed_m_per_s", [0.0, 1e-4])
def test_a_weighted_sum_of_forces_scatters_as_the_displacements_under_the_filter_make_it(speed_m_per_s: float) -> None:
    """Sums in time of white noise, and of the floor's sines one by one, against an integral over the spectrum."""
    floor, weights = floor_of(speed_m_per_s), np.hanning(61)[1:-1] / 30.0
    felt = MASS_KG * np.convolve(weights, derivative_filters(RIG.rate_hz, RIG.bandwidth_hz).acceleration)
    at_s = np.arange(felt.size) / RIG.rate_hz
    waves = np.exp(-2j * np.pi * floor.octaves.frequency_hz[:, None] * at_s) @ felt
    variance = RIG.noise_m**2 * (felt @ felt) + floor._power @ np.abs(waves) ** 2
    assert _force_std(motion_with(), weights, floor) == pytest.approx(np.sqrt(variance), rel=0.03)


def pulse_force(loading_n: float, unloading_n: float, drag_n: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Return a half-sine from touch to release, its second half of another height, beside the drag in flight."""
    half = np.sin(np.pi * (TIME_S - 0.03) / 0.04)
    inside = (TIME_S >= 0.03) & (TIME_S <= 0.07)
    return np.where(inside, np.where(TIME_S < 0.05, loading_n, unloading_n) * half, np.where(TIME_S < 0.05, *drag_n))


def pushed(loading_n: float, unloading_n: float, drag_n: tuple[float, float] = (0.0, 0.0), **changes: Any) -> Motion:
    """Return a motion with that force, which turns round at 0.05 s."""
    still = {"velocity_m_per_s": np.zeros(TIME_S.size), **changes}
    return motion_with(force_n=pulse_force(loading_n, unloading_n, drag_n), **still)


def test_impulses_are_those_of_the_contact_alone_in_the_order_unloading_over_loading() -> None:
    drag, taps = (0.02, -0.05), derivative_filters(RIG.rate_hz, RIG.bandwidth_hz).velocity
    rms = float(np.convolve(RIG.noise_m * np.random.default_rng(2).standard_normal(200_000), taps, "valid").std())
    wanders = np.full(TIME_S.size, 1e-3)  # the motion's own std holds the path's wander, which is the floor's
    motion = pushed(0.5, 0.4, drag, velocity_std_m_per_s=wanders)
    reading = seen(read_impulse_ratio(motion, 0.05, TOUCH, RELEASE, drag, floor_of()))
    half = 0.5 * 0.04 / np.pi  # N s, of the loading
    assert reading.value == pytest.approx(0.8, rel=2e-3)
    # loading: m (0 - v_begin), unloading: m (v_end - 0)
    drawn = rms * np.random.default_rng(1).standard_normal((2, 40_000))
    ratio = (0.4 / 0.5 * half + MASS_KG * drawn[1]) / (half - MASS_KG * drawn[0])
    assert reading.std == pytest.approx(float(ratio.std()), rel=0.02)
    velocities = Quantity(-0.2, 3e-6), Quantity(0.16, 4e-6)
    found = read_momentum(motion, TOUCH, RELEASE, drag, velocities, floor_of())
    assert found is not None
    impulse, change = found
    assert impulse.value == pytest.approx(1.8 * half, rel=1e-3)
    assert impulse.std == pytest.approx(np.hypot(np.sqrt(2.0) * rms * MASS_KG, 1e-5 * impulse.value), rel=0.01)
    assert [change.value, change.std] == pytest.approx([0.36 * MASS_KG, 5e-6 * MASS_KG])


@pytest.mark.parametrize("off_s", [0.0, -4e-4, 4e-4])
def test_impulses_are_split_where_the_measured_velocity_is_zero_wherever_the_turn_was_read(off_s: float) -> None:
    u = TIME_S - 0.05
    force = np.where(np.abs(u) < 0.02, 0.5 * np.cos(np.pi * u / 0.04) * (1.0 - 8.0 * u), 0.0)
    velocity = cumulative_trapezoid(force, TIME_S, initial=0.0) / MASS_KG
    turn = 1030  # at 0.0515 s
    velocity -= velocity[turn]
    motion = motion_with(force_n=force, velocity_m_per_s=velocity)
    ratio = seen(read_impulse_ratio(motion, float(TIME_S[turn]) + off_s, TOUCH, RELEASE, (0.0, 0.0), floor_of()))
    assert ratio.value == pytest.approx(velocity[-1] / -velocity[0], rel=3e-4)


def test_the_floors_velocity_between_both_ends_is_in_the_uncertainty_of_impulses() -> None:
    floor, margin_s = floor_of(1e-4), 6.0 / RIG.bandwidth_hz
    motion = pushed(0.5, 0.4)
    begin_s, end_s = TOUCH.time_s - margin_s, RELEASE.time_s + margin_s
    at, half = 2 * np.pi * floor.octaves.frequency_hz, 0.5 * 0.04 / np.pi
    velocity = at * np.sqrt(floor._power)
    between = np.linalg.norm(velocity * np.abs(np.exp(1j * at * end_s) - np.exp(1j * at * begin_s)))
    momentum = read_momentum(motion, TOUCH, RELEASE, (0.0, 0.0), (Quantity(-0.2, 0.0), Quantity(0.16, 0.0)), floor)
    assert momentum is not None and momentum[0].std == pytest.approx(MASS_KG * between, rel=0.2)
    weighed = np.linalg.norm(velocity * np.abs(np.exp(1j * at * end_s) + 0.8 * np.exp(1j * at * begin_s)))
    ratio = seen(read_impulse_ratio(motion, 0.05, TOUCH, RELEASE, (0.0, 0.0), floor))
    assert ratio.std == pytest.approx(MASS_KG * weighed / half, rel=0.2)


@pytest.mark.parametrize("side", [0, 1])
def test_impulses_need_the_force_filters_ringing_on_either_side_of_the_contact(side: int) -> None:
    margin_s, step_s = 6.0 / RIG.bandwidth_hz, 1.0 / RIG.rate_hz
    for inside in (0.5, -0.5):  # a sample
        edges = (
            Edge(TIME_S[0] + margin_s + inside * step_s, 0.0) if side == 0 else TOUCH,
            Edge(TIME_S[-1] - margin_s - inside * step_s, 0.0) if side == 1 else RELEASE,
        )
        motion = pushed(0.5, 0.4)
        ratio = read_impulse_ratio(motion, 0.05, *edges, (0.0, 0.0), floor_of())
        momentum = read_momentum(motion, *edges, (0.0, 0.0), (Quantity(-0.2, 0.0), Quantity(0.1, 0.0)), floor_of())
        assert (isinstance(ratio, Quantity), momentum is not None) == ((inside > 0,) * 2)
    holed = np.where(np.abs(TIME_S - 0.04) < 1e-4, np.nan, pulse_force(0.5, 0.4))
    assert isinstance(
        read_impulse_ratio(replace(pushed(0.5, 0.4), force_n=holed), 0.05, *edges, (0.0, 0.0), floor_of()), NotSeen
    )
    pulled = pushed(-0.5, -0.4)
    assert isinstance(read_impulse_ratio(pulled, 0.05, TOUCH, RELEASE, (0.0, 0.0), floor_of()), NotSeen)


def spring_motion(stiffness: float) -> tuple[Motion, Flight]:
    """Return a contact from 30 to 70 ms with a force in proportion to the deflection, and the flight before it."""
    rate = np.pi / 0.04
    deflection = np.clip(np.sin(rate * (TIME_S - 0.03)), 0.0, None) * ((TIME_S > 0.03) & (TIME_S < 0.07)) * 1e-3
    flight = Flight(0.03, np.array([5e-4, -1e-3 * rate]), np.zeros((2, 2)), RIG.noise_m, 0, 599)
    motion = motion_from(TIME_S, 5e-4 - deflection, RIG)
    return replace(motion, force_n=stiffness * deflection, moving_mass_u_kg=0.0), flight


def test_a_slope_is_that_of_force_on_deflection_and_the_end_moves_it_by_as_much_as_it_is_unsure() -> None:
    motion, flight = spring_motion(220.0)
    motion = replace(motion, force_n=motion.force_n + 0.1)  # what stays the same is no slope
    reading = seen(read_slope(motion, TOUCH, RELEASE, flight, floor_of()))
    assert reading.value == pytest.approx(220.0, rel=1e-9)
    assert reading.how == "least squares of F on deflection, 8.4 to 39.0 ms after touch"
    bent = replace(motion, force_n=motion.force_n + np.where(TIME_S > 0.066, 0.02, 0.0))
    one, other = (seen(read_slope(bent, TOUCH, Edge(end, 0.0), flight, floor_of())) for end in (0.07, 0.067))
    unsure = seen(read_slope(bent, TOUCH, Edge(0.07, 3e-3), flight, floor_of()))
    assert unsure.value == one.value
    assert unsure.std == pytest.approx(np.hypot(one.std, one.value - other.value), rel=1e-9)
    for samples, is_read in ((7, False), (8, True)):
        index = np.flatnonzero((TIME_S > 0.0390) & (TIME_S < 0.06))[:samples]
        few = replace(motion, valid=np.isin(np.arange(TIME_S.size), index))
        assert isinstance(read_slope(few, TOUCH, RELEASE, flight, floor_of()), Quantity) is is_read


def test_a_slope_scatters_by_white_noise_in_force_and_deflection_as_it_says() -> None:
    clean, flight = spring_motion(220.0)
    read = []
    for noise in RIG.noise_m * np.random.default_rng(3).standard_normal((120, TIME_S.size)):
        force = clean.force_n + motion_from(TIME_S, noise, RIG).force_n
        noisy = replace(clean, displacement_m=clean.displacement_m + noise, force_n=force)
        read.append(seen(read_slope(noisy, TOUCH, RELEASE, flight, floor_of())))
    assert np.std([one.value for one in read]) == pytest.approx(read[0].std, rel=0.2)


def test_a_deflection_is_from_the_touch_on_the_flights_line_to_the_turns_parabola() -> None:
    turn_s = 0.05001
    x = np.where(TIME_S < 0.03, 2e-3 - 0.2 * (TIME_S - 0.03), -1e-3 + 30.0 * (TIME_S - turn_s) ** 2)
    motion = motion_with(displacement_m=x, valid=np.ones(TIME_S.size, np.bool_))
    reading = seen(read_deflection(motion, 0.05003, TOUCH, -0.2, floor_of(white_m=3e-9)))
    assert reading.value == pytest.approx(3e-3, rel=1e-9)
    assert reading.std == pytest.approx(3e-9, rel=1e-6)
    late = seen(read_deflection(motion, 0.05003, Edge(0.03, 1e-6), -0.2, floor_of(white_m=0.0)))
    assert late.std == pytest.approx(2e-7, rel=1e-6)
    floor = floor_of(1e-4, white_m=0.0)
    moved = np.abs(np.exp(2j * np.pi * floor.octaves.frequency_hz * 0.02003) - 1.0)
    swayed = seen(read_deflection(motion, 0.05003, TOUCH, -0.2, floor))
    assert swayed.std == pytest.approx(np.sqrt(floor._power @ moved**2), rel=1e-3)
    for hidden, is_read in ((0.02957, True), (0.02952, False)):  # two samples, one
        dark = replace(motion, valid=(hidden > TIME_S) | (TIME_S > 0.03))
        assert isinstance(read_deflection(dark, 0.05003, TOUCH, -0.2, floor_of()), Quantity) is is_read


def test_the_turn_is_where_the_line_through_the_velocity_is_zero() -> None:
    turn_s = 0.05001234
    velocity = 3.0 * (TIME_S - turn_s)
    inside = motion_with(velocity_m_per_s=velocity)
    assert find_turnaround(inside, TOUCH, RELEASE) == pytest.approx(turn_s, abs=1e-12)
    noise = 1e-4 * np.random.default_rng(2).standard_normal((300, TIME_S.size))
    found = [find_turnaround(replace(inside, velocity_m_per_s=velocity + one), TOUCH, RELEASE) for one in noise]
    off = np.array([turn_s if one is None else one for one in found]) - turn_s
    assert off.std() == pytest.approx(1e-4 / 3.0 / np.sqrt(18.0), rel=0.15)  # 18 samples about it
    assert find_turnaround(replace(inside, velocity_m_per_s=-velocity), TOUCH, RELEASE) is None
    assert find_turnaround(inside, TOUCH, Edge(0.0499, 0.0)) is None
    assert find_turnaround(inside, Edge(0.0501, 0.0), RELEASE) is None


@pytest.mark.parametrize(("every", "few"), [(1, 9), (20, 2)])  # 800 samples of a contact, or 40
def test_a_turn_is_read_from_nine_samples_or_a_twentieth_of_the_contact_to_either_side(every: int, few: int) -> None:
    velocity = 3.0 * (TIME_S - 0.0502 - 1e-7)[::every]
    motion = replace(motion_with(), time_s=TIME_S[::every], velocity_m_per_s=velocity)
    turn_s = find_turnaround(motion, TOUCH, RELEASE)
    last_before = int(np.flatnonzero(velocity < 0.0)[-1])
    for far, counts in ((few, False), (few - 1, True)):
        for at in (last_before - far, last_before + 1 + far):
            struck = velocity.copy()
            struck[at] *= 1.01
            found = find_turnaround(replace(motion, velocity_m_per_s=struck), TOUCH, RELEASE)
            assert (found != turn_s) is counts


def test_an_integral_between_samples_is_that_of_the_lines_between_them() -> None:
    random = np.random.default_rng(4)
    time, values = np.sort(random.uniform(0.0, 1.0, 12)), random.standard_normal(12)
    for begin, end in ((time[0], time[-1]), (time[2] + 1e-3, time[7] - 1e-3), (time[3], time[3] + 1e-3)):
        whole, _ = quad(lambda t: float(np.interp(t, time, values)), begin, end, points=time[1:-1], limit=200)
        assert _integral(time, values, begin, end) == pytest.approx(whole, abs=1e-9)


def test_the_width_of_a_half_sine_is_two_thirds_of_it_and_less_is_not_read_from_a_record_that_ends() -> None:
    slow = motion_with(force_n=pulse_force(0.5, 0.5))
    reading = seen(read_fwhm(slow, TOUCH, RELEASE, floor_of()))
    assert reading.value == pytest.approx(0.04 * 2 / 3, rel=2e-3)
    assert "low-passed at 250 Hz" in reading.how
    for end in (0.0695, 0.0705):
        cut = motion_with(force_n=np.where(end > TIME_S, pulse_force(0.5, 0.5), np.nan))
        assert isinstance(read_fwhm(cut, TOUCH, RELEASE, floor_of()), Quantity) is (end > 0.07)
        begun = motion_with(force_n=np.where(0.1 - end < TIME_S, pulse_force(0.5, 0.5), np.nan))
        assert isinstance(read_fwhm(begun, TOUCH, RELEASE, floor_of()), Quantity) is (end > 0.07)


def test_the_width_of_a_skewed_pulse_is_between_the_lines_that_cross_half_of_its_top_and_scatters_as_it_says() -> None:
    skewed = np.interp(TIME_S, [0.03, 0.06, 0.07], [0.0, 0.5, 0.0])
    noise_m = 2e-9
    widths, stds = [], []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pulse, "SMOOTH_HZ", (250.0,))
        for seed in range(60):
            noise = noise_m * np.random.default_rng(seed).standard_normal(TIME_S.size)
            added = motion_from(TIME_S, noise, RIG).force_n if seed else 0.0
            motion = motion_with(force_n=skewed + added)
            reading = seen(read_fwhm(motion, TOUCH, RELEASE, floor_of(white_m=noise_m)))
            widths.append(reading.value)
            stds.append(reading.std)
    smooth = smooth_force(motion_with(force_n=skewed), 250.0)
    assert smooth is not None
    top = int(smooth.argmax())
    begin = np.interp(0.5 * smooth[top], smooth[600:top], TIME_S[600:top])
    end = np.interp(-0.5 * smooth[top], -smooth[top:1400], TIME_S[top:1400])
    assert widths[0] == pytest.approx(end - begin, rel=1e-9)
    assert np.std(widths[1:]) == pytest.approx(np.mean(stds), rel=0.25)


def test_a_floor_that_moves_is_in_the_slope_as_what_force_and_deflection_make_of_its_sines() -> None:
    motion, flight = spring_motion(220.0)
    floor = floor_of(1e-3, white_m=0.0)
    inside = (TIME_S >= 0.03 + 0.209 * 0.04) & (TIME_S <= 0.03 + 0.975 * 0.04)
    centred = np.sin(np.pi * (TIME_S[inside] - 0.03) / 0.04)
    centred -= centred.mean()
    weights = centred / (1e-3 * centred @ centred)
    seen_of = np.exp(2j * np.pi * floor.octaves.frequency_hz[:, None] * TIME_S[inside]) @ weights
    of_floor = MASS_KG * (2 * np.pi * floor.octaves.frequency_hz) ** 2
    larger = np.maximum(of_floor, np.abs(220.0 - of_floor))
    expected = np.linalg.norm(np.sqrt(floor._power) * np.abs(seen_of) * larger)
    assert seen(read_slope(motion, TOUCH, RELEASE, flight, floor)).std == pytest.approx(expected, rel=0.2)


def test_the_width_is_that_of_the_contact_whatever_pushes_the_block_half_a_contact_away() -> None:
    pushed = pulse_force(0.5, 0.5)
    plain = seen(read_fwhm(motion_with(force_n=pushed), TOUCH, RELEASE, floor_of()))
    for away in (TIME_S < 0.006, TIME_S > 0.094):
        other = motion_with(force_n=np.where(away, 3.0, pushed))
        assert seen(read_fwhm(other, TOUCH, RELEASE, floor_of())).value == pytest.approx(plain.value, rel=1e-3)

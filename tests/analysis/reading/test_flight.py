"""A flight's polynomial against numpy's own, its uncertainties against scatter, and bins counted from the contact."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.reading import both_flights
from analysis.reading.both_flights import _polynomials, _unweighted, find_knocks, read_flights
from analysis.reading.flight import MAX_BINS, Bins, Flight, binned, fit_flight, select
from analysis.shot.motion import Motion
from tests.analysis.synthetic_collision import Synthetic, motion_from

RIG = Synthetic(rate_hz=1e4, bandwidth_hz=1e3)
TIME_S = np.arange(0.0, 0.06, 1 / RIG.rate_hz)


def parabola(seed: int = 1, noise_m: float = RIG.noise_m, hidden: slice = slice(0, 0)) -> Motion:
    """Return a fall from rest that loses 0.4 m/s^2."""
    noise = np.random.default_rng(seed).normal(0.0, noise_m, TIME_S.size)
    x = 1e-3 - 0.2 * TIME_S + 0.2 * TIME_S**2 + noise
    x[hidden] = np.nan
    return motion_from(TIME_S, x, RIG)


def test_a_flight_continues_its_polynomial_and_its_velocity_has_the_covariances_uncertainty() -> None:
    covariance = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]])
    flight = Flight(2.0, np.array([1.0, -3.0, 0.25]), covariance, 1e-10, 0, 9)
    assert flight.position_m(np.array([2.0, 4.0])).tolist() == [1.0, 1.0 - 6.0 + 1.0]
    row = np.array([0.0, 1.0, 2 * 1.5])
    assert flight.velocity(3.5) == pytest.approx((-3.0 + 0.75, np.sqrt(row @ covariance @ row)))
    assert flight.acceleration_m_per_s2 == 0.5
    straight = Flight(2.0, np.array([1.0, -3.0]), covariance[:2, :2], 1e-10, 0, 9)
    assert straight.acceleration_m_per_s2 == 0.0
    assert straight.velocity(9.0) == pytest.approx((-3.0, np.sqrt(3.0)))


def test_a_flight_is_least_squares_about_its_time_zero_with_the_noise_left_over() -> None:
    motion = parabola(hidden=slice(120, 140))
    flight = fit_flight(motion, 100, 299, nearest=310)
    assert flight is not None
    index = np.setdiff1d(np.arange(100, 300), np.arange(120, 140))
    tau = TIME_S[index] - TIME_S[310]
    coefficients, covariance = np.polyfit(tau, motion.displacement_m[index], 2, cov=True)
    assert flight.coefficients == pytest.approx(coefficients[::-1], rel=1e-7)
    assert flight.covariance == pytest.approx(covariance[::-1, ::-1], rel=1e-5)
    left = motion.displacement_m[index] - np.polyval(coefficients, tau)
    assert flight.noise_std_m == pytest.approx(np.sqrt(left @ left / (index.size - 3)), rel=1e-6)
    assert (flight.time_zero_s, flight.first, flight.last) == (TIME_S[310], 100, 299)
    beyond = fit_flight(motion, -5, TIME_S.size + 5, nearest=TIME_S.size + 5)
    assert beyond is not None
    assert (beyond.time_zero_s, beyond.first, beyond.last) == (TIME_S[-1], 0, TIME_S.size - 1)


@pytest.mark.parametrize(
    ("samples", "curved", "degree"),
    [(30, False, 1), (32, False, 2), (11, True, 1), (12, True, 2), (12, False, 1)],
)
def test_a_flight_is_curved_that_lasts_3_ms_or_is_said_to_be_and_has_12_samples(
    samples: int, curved: bool, degree: int
) -> None:
    flight = fit_flight(parabola(), 100, 99 + samples, nearest=100, curved=curved)
    assert flight is not None and flight.coefficients.size == degree + 1


def test_a_flight_of_few_samples_has_the_stated_noise_and_one_of_three_is_none() -> None:
    motion = replace(parabola(), displacement_std_m=np.full(TIME_S.size, 7e-10))
    for samples, stated in ((9, True), (10, False)):  # of which two are the line's
        flight = fit_flight(motion, 100, 99 + samples, nearest=100)
        assert flight is not None and (flight.noise_std_m == 7e-10) is stated
    assert fit_flight(motion, 100, 103, nearest=100) is not None
    assert fit_flight(motion, 100, 102, nearest=100) is None


def test_bins_are_means_of_half_a_millisecond_counted_from_the_contact_outwards() -> None:
    motion = parabola(hidden=slice(452, 453))
    bins = binned(motion, (3, 200), (401, 577))
    assert (bins.each, bins.step_s) == (5, 1 / RIG.rate_hz)
    into = [range(201 - 5 * k, 206 - 5 * k) for k in range(39, 0, -1)]
    out = [range(401 + 5 * k, 406 + 5 * k) for k in range(35)]
    kept = [*into, *(one for one in out if 452 not in one)]
    assert bins.time_s == pytest.approx([TIME_S[list(one)].mean() for one in kept])
    assert bins.value_m == pytest.approx([motion.displacement_m[list(one)].mean() for one in kept], rel=1e-12)
    assert bins.into.tolist() == [True] * len(into) + [False] * (len(kept) - len(into))
    assert bins.std_m == pytest.approx(RIG.noise_m / np.sqrt(5), rel=0.2)
    assert bins.middle_s == pytest.approx(0.5 * (bins.time_s[0] + bins.time_s[-1]))
    assert bins.resolution_hz == pytest.approx(1.0 / (bins.time_s[-1] - bins.time_s[0] + 5e-4))
    only = select(bins, bins.into)
    assert np.array_equal(only.time_s, bins.time_s[bins.into]) and np.array_equal(only.value_m, bins.value_m[:39])
    assert only.into.all() and only.into.size == 39


def test_bins_are_longer_where_there_would_be_too_many_and_few_samples_have_the_stated_noise() -> None:
    motion = replace(parabola(), displacement_std_m=np.full(TIME_S.size, 7e-10))
    long = binned(motion, (0, 599), None)
    assert long.each == 6 and long.time_s.size == 100 <= MAX_BINS
    assert long.into.all()
    for samples, stated in ((33, True), (39, False)):  # third differences are three fewer
        bins = binned(motion, (100, 99 + samples), None)
        assert bool(bins.std_m * np.sqrt(bins.each) == pytest.approx(7e-10)) is stated


def test_two_flights_are_least_squares_with_velocities_at_the_ends_that_face_the_contact() -> None:
    motion = parabola(noise_m=1e-8)
    flights = read_flights(motion, (0, 249), (300, 599))
    assert flights is not None and flights.outgoing is not None and flights.lines == () and flights.knocks_s == ()
    for flight, (first, last, zero) in zip(
        (flights.incoming, flights.outgoing), ((0, 249, 249), (300, 599, 300)), strict=True
    ):
        whole = slice(first, last + 1)
        tau = TIME_S[whole] - TIME_S[zero]
        alone, covariance = np.polyfit(tau, motion.displacement_m[whole], 2, cov="unscaled")
        std = 1e-8 * np.sqrt(covariance[1, 1])
        assert (flight.time_zero_s, flight.first, flight.last) == (TIME_S[zero], first, last)
        assert flight.coefficients[1] == pytest.approx(alone[1], abs=std)
        assert 0.8 * std < flight.velocity(TIME_S[zero])[1] < 4.0 * std  # a floor is not ruled out
        assert flight.coefficients[2] == pytest.approx(0.2, abs=5 * 1e-8 * np.sqrt(covariance[0, 0]))
        assert flight.noise_std_m == pytest.approx(1e-8, rel=0.2)
    plain = [1e-8 * np.sqrt(np.polyfit(TIME_S[:n], TIME_S[:n], 2, cov="unscaled")[1][1, 1]) for n in (250, 300)]
    assert np.array(flights.plain) / plain == pytest.approx([1.0, 1.0], abs=0.2)
    stds = [one.velocity(one.time_zero_s)[1] for one in (flights.incoming, flights.outgoing)]
    assert 0.0 < flights.velocity_covariance < 0.5 * stds[0] * stds[1]  # of slow motion
    alone_in = read_flights(motion, (0, 249), None)
    assert alone_in is not None and alone_in.outgoing is None
    assert (alone_in.plain[1], alone_in.velocity_covariance) == (0.0, 0.0)


def test_knocks_are_left_out_of_the_bins_and_told_from_first_to_last_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = parabola()
    plain = read_flights(motion, (0, 249), (300, 599))
    monkeypatch.setattr(both_flights, "find_knocks", lambda *of: ([(10, 14), (60, 62)], True))
    flights = read_flights(motion, (0, 249), (300, 599))
    assert plain is not None and flights is not None and flights.unremovable_knock and not plain.unremovable_knock
    (first, second) = flights.knocks_s  # 50 bins of five samples to the touch, the others from the release on
    assert first == pytest.approx((TIME_S[50], TIME_S[69])) and second == pytest.approx((TIME_S[350], TIME_S[359]))
    loud = motion.displacement_m.copy()
    loud[50:70] += 1e-6
    loud[350:360] -= 1e-6
    shaken = read_flights(motion_from(TIME_S, loud, RIG), (0, 249), (300, 599))
    assert shaken is not None
    assert shaken.incoming.coefficients == pytest.approx(flights.incoming.coefficients, rel=1e-6)


@pytest.mark.parametrize("bins", [3, 4])
def test_a_flight_of_four_bins_is_read_and_one_of_three_is_not(bins: int) -> None:
    motion = parabola()
    assert (read_flights(motion, (100, 99 + 5 * bins), (300, 599)) is None) is (bins < 4)
    flights = read_flights(motion, (0, 249), (300, 299 + 5 * bins))
    assert flights is not None and (flights.outgoing is None) is (bins < 4)


@pytest.mark.parametrize("bins", [7, 8])
def test_of_eight_bins_a_flight_is_curved_and_of_seven_straight(bins: int) -> None:
    flights = read_flights(parabola(), (250 - 5 * bins, 249), (300, 299 + 5 * (15 - bins)))
    assert flights is not None and flights.outgoing is not None
    sizes = flights.incoming.coefficients.size, flights.outgoing.coefficients.size
    assert sizes == ((2, 3) if bins == 7 else (3, 2))


def test_unweighted_leave_the_curvature_of_the_flights() -> None:
    time = np.concatenate([np.linspace(-1e-2, 0.0, 9), np.linspace(0.03, 0.04, 9)])
    value = 3e-4 - 0.2 * time + 1e-9 * np.sin(700.0 * time)
    bins: Any = Bins(time, value, time < 0.01, 5, 1e-4, 1e-10)
    design = np.stack([np.ones(18), time, time**2], axis=1)
    coefficients, line = _unweighted(bins, design, (2,))
    slope, offset = np.polyfit(time, value, 1)
    assert coefficients == pytest.approx([offset, slope, 0.0], rel=1e-9)
    assert line == pytest.approx(offset + slope * time, rel=1e-9)


def bins_of_rest(loud: slice, size: float, bins: tuple[int, int] = (40, 50)) -> tuple[Any, Any]:
    rest = np.random.default_rng(1).standard_normal(sum(bins))
    rest[loud] += size * (-1.0) ** np.arange(rest[loud].size)
    return rest, np.arange(rest.size) < bins[0]


def test_a_knock_is_what_is_five_times_as_loud_as_the_quiet_half_with_what_rings_about_it() -> None:
    assert find_knocks(*bins_of_rest(slice(0, 0), 0.0), 1.0) == ([], False)
    assert find_knocks(*bins_of_rest(slice(20, 23), 2.0), 1.0) == ([], False)
    (begin, end), *more = find_knocks(*bins_of_rest(slice(20, 23), 30.0), 1.0)[0]
    assert 12 <= begin <= 16 and 27 <= end <= 31 and more == []
    for at, whole in ((4, (0, 0)), (75, (0, 90))):  # what is left before or after it would be no line
        ((begin, end),), kept = find_knocks(*bins_of_rest(slice(at, at + 3), 30.0), 1.0)
        assert not kept and (begin == 0 if at == 4 else end < 90) and whole
    assert find_knocks(*bins_of_rest(slice(20, 23), 30.0), 100.0) == ([], False)  # white noise does as much


def test_a_knock_has_twenty_five_times_the_power_of_the_quiet_and_its_ends_stand_for_the_bins_beyond() -> None:
    into = np.arange(90) < 40
    rest = np.where(np.arange(90) % 2, 1.0, -1.0)  # second differences of 4 everywhere
    for times, found in ((4.8, False), (5.2, True)):
        loud = rest * np.where((np.arange(90) >= 15) & (np.arange(90) < 25), times, 1.0)
        assert bool(find_knocks(loud, into, 1e-3)[0]) is found
    first, last = rest.copy(), rest.copy()
    first[:4] *= 9.0
    last[-4:] *= 9.0
    assert find_knocks(first, into, 1e-3)[0][0][0] == 0
    assert find_knocks(last, into, 1e-3)[0][0][1] == 90
    for bins, seen in ((3, False), (4, True)):  # of fewer there is no power
        blow = np.where(np.arange(90) < bins, 9.0 * rest, rest)
        assert find_knocks(blow, np.arange(90) < bins, 1e-3) == ([], seen)


def test_a_knock_reaches_four_bins_beyond_the_powers_that_hold_it_and_leaves_ten_of_a_flight() -> None:
    """A blow in one bin is in three second differences, and these are in the power of six bins."""
    into = np.arange(90) < 40
    even = np.where(np.arange(90) % 2, 1.0, -1.0)
    for bins, found in (((20,), [(14, 28)]), ((60,), [(54, 68)]), ((20, 60), [(14, 28), (54, 68)]), ((0,), [(0, 8)])):
        blown = even.copy()
        blown[list(bins)] += 60.0
        assert find_knocks(blown, into, 1e-3) == (found, False)
    for last, rest in ((18, ([(5, 26)], False)), (19, ([], True))):  # nine of thirty bins stay, or ten ...
        blown = np.where(np.arange(80) % 2, 1.0, -1.0)
        blown[11 : last + 1] *= 60.0
        assert find_knocks(blown, np.arange(80) < 31, 1e-3) == rest


def test_lines_are_looked_for_in_24_bins_of_flight_and_more() -> None:
    rig = Synthetic(rate_hz=1e4, bandwidth_hz=1e3)
    time = np.arange(0.0, 0.03, 1e-4)
    x = -0.2 * time + 3e-7 * np.sin(2 * np.pi * 400.0 * time)
    motion = motion_from(time, x + np.random.default_rng(1).normal(0.0, 1e-10, time.size), rig)
    for bins, found in ((23, False), (24, True)):
        flights = read_flights(motion, (300 - 5 * bins, 299), None)
        assert flights is not None and bool(flights.lines) is found


def test_two_knocks_are_left_out_of_their_own_flights_and_one_that_fills_a_flight_is_said() -> None:
    rest, into = bins_of_rest(slice(20, 22), 30.0)
    rest[60] += 40.0
    found, kept = find_knocks(rest, into, 1.0)
    assert [(begin < at < end) for (begin, end), at in zip(found, (20, 60), strict=True)] == [True, True]
    assert found[0][1] <= 40 <= found[1][0] and not kept
    assert find_knocks(*bins_of_rest(slice(4, 12), 30.0, (16, 50)), 1.0) == ([], True)
    assert find_knocks(*bins_of_rest(slice(0, 50), 30.0), 1.0) == ([], True)  # more than half of all


def test_a_flights_polynomials_are_the_means_over_each_bins_samples() -> None:
    each, step_s = 8, 1e-4
    samples = np.arange(40 * each).reshape(40, each) * step_s
    time_s = samples.mean(axis=1)
    into = time_s < 0.016
    zeros = 0.016, 0.0175
    bins = Bins(time_s, np.zeros(40), into, each, step_s, 1e-10)
    columns, drags = _polynomials(bins, zeros)
    assert drags == (2, 5)
    for side, zero, first in ((into, zeros[0], 0), (~into, zeros[1], 3)):
        for degree in range(3):
            mean = np.where(side, ((samples - zero) ** degree).mean(axis=1), 0.0)
            assert columns[:, first + degree] == pytest.approx(mean, rel=1e-9, abs=1e-15)

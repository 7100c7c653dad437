"""Timing, speed and place of a collision: a half sine between two flights, whose every number is known."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.inference.model.course import NoCollision, _flight, _half_sine, _joined, _onset, read_course

Floats = NDArray[np.float64]
DT, TOUCH, SPEED, RATE, BACK = 1e-5, 0.0123456, -0.25, 210.0, 0.8
NOISE = 1e-9


def collision(
    time_s: Floats, touch: float = TOUCH, speed: float = SPEED, rate: float = RATE, back: float = BACK
) -> Floats:
    """Return flight, half sine and flight, written from its three parts."""
    lasts = math.pi / rate
    parts = [time_s < touch, (time_s >= touch) & (time_s < touch + lasts), time_s >= touch + lasts]
    each = [
        lambda t: speed * (t - touch),
        lambda t: speed / rate * np.sin(rate * (t - touch)),
        lambda t: -back * speed * (t - touch - lasts),
    ]
    return np.asarray(np.piecewise(time_s, parts, each))


def noisy(samples: int = 4500, begin: float = 0.0, seed: int = 1, noise: float = NOISE) -> tuple[Floats, Floats]:
    time_s = begin + np.arange(samples) * DT
    return time_s, 3e-3 + collision(time_s - begin) + noise * np.random.default_rng(seed).standard_normal(samples)


@pytest.mark.parametrize("begin", [0.0, 100.0, -7.0])
def test_a_course_is_that_of_the_collision(begin: float) -> None:
    time_s, place = noisy(begin=begin)
    course = read_course(time_s, place, np.ones(time_s.size, dtype=bool))
    contact = math.pi / RATE
    # the force of half a sine has risen to a twentieth of its peak after so long
    touch = begin + TOUCH + math.asin(0.05) / RATE
    assert course.touch_time_s == pytest.approx(touch, abs=1e-4)
    assert course.touch_position_m == pytest.approx(3e-3 + SPEED * (touch - begin - TOUCH), abs=3e-5)
    assert course.velocity_in_m_per_s == pytest.approx(SPEED, rel=1e-3)
    assert course.turnaround_time_s == pytest.approx(begin + TOUCH + contact / 2, abs=2e-4)
    depth = SPEED / RATE - SPEED * (course.touch_time_s - begin - TOUCH)  # from the touch that was read
    assert course.rate_rad_per_s == pytest.approx(SPEED / depth, rel=0.01)
    assert course.contact_time_s == pytest.approx(contact * RATE * depth / SPEED, rel=0.01)
    assert course.release_time_s == pytest.approx(course.touch_time_s + course.contact_time_s, abs=1e-9)
    assert course.noise_std_m == pytest.approx(NOISE, rel=0.1)
    touch = (course.touch_time_s - begin) / DT
    assert course.quiet_in.start == 0 and touch - 4 <= course.quiet_in.stop <= touch - 2
    out = (course.release_time_s - begin + 0.15 * course.contact_time_s) / DT
    assert out + 3 <= course.quiet_out.start <= out + 7 and course.quiet_out.stop == time_s.size
    np.testing.assert_array_equal(
        course.own, [course.velocity_in_m_per_s, course.touch_time_s, course.touch_position_m]
    )


def test_samples_that_are_not_valid_take_no_part() -> None:
    time_s, place = noisy()
    valid = np.ones(time_s.size, dtype=bool)
    valid[[300, 301, 2000]] = False
    valid[:50] = valid[-70:] = False
    spoilt = np.where(valid, place, 1.0)
    spoilt[900] = np.nan
    course = read_course(time_s, spoilt, valid)
    assert course.touch_time_s == pytest.approx(TOUCH + math.asin(0.05) / RATE, abs=1e-4)
    assert course.velocity_in_m_per_s == pytest.approx(SPEED, rel=1e-3)
    assert course.quiet_in.start == 50 and course.quiet_out.stop == time_s.size - 70


@pytest.mark.parametrize("noise", [2e-6, 2e-5])
def test_a_coarse_record_is_read_from_half_a_sine_through_all_samples(noise: float) -> None:
    """Depth over noise of 600 and of 60."""
    time_s, place = noisy(noise=noise, seed=4)
    time_s, place = time_s[::4], place[::4]
    course = read_course(time_s, place, np.ones(time_s.size, dtype=bool))
    share = noise / 2e-5
    assert course.touch_time_s == pytest.approx(TOUCH, abs=4e-5 * share)
    assert course.rate_rad_per_s == pytest.approx(RATE, rel=0.01 * share)
    assert course.velocity_in_m_per_s == pytest.approx(SPEED, rel=0.004 * share)
    assert course.turnaround_time_s == pytest.approx(course.touch_time_s + 0.5 * course.contact_time_s, abs=1e-12)
    assert course.touch_position_m == pytest.approx(3e-3, abs=2e-5 * share)


def test_what_is_no_collision_is_refused_in_words() -> None:
    time_s, place = noisy()
    every = np.ones(time_s.size, dtype=bool)

    def refused(time_s: Floats, place: Floats, valid: NDArray[np.bool_], why: str) -> None:
        with pytest.raises(NoCollision, match=why):
            read_course(time_s, place, valid)

    few = np.zeros(time_s.size, dtype=bool)
    few[np.linspace(0, time_s.size - 1, 49).astype(int)] = True
    refused(time_s, place, few, "fewer than 50")
    refused(time_s, -place, every, "no turnaround|no block moving")
    turn = int(np.argmin(place))
    refused(time_s[: turn + 5], place[: turn + 5], every[: turn + 5], "no turnaround")
    random = np.random.default_rng(2).standard_normal(time_s.size)
    level = random - 5.0 * np.exp(-(((np.arange(time_s.size) - 2000) / 300.0) ** 2))
    refused(time_s, 1e-9 * level, every, "no block moving")


def test_the_joined_flights_are_the_collision() -> None:
    time_s = np.linspace(0.0, 0.05, 700)
    z = np.array([TOUCH, 2e-3, SPEED, math.log(RATE), BACK])
    np.testing.assert_allclose(_joined(z, time_s), 2e-3 + collision(time_s), atol=1e-15)
    found = _half_sine(time_s, 2e-3 + collision(time_s), (TOUCH + 1e-3, 2e-3 + 1e-4, 1.1 * SPEED, 0.7 * RATE))
    assert found == pytest.approx((TOUCH, 2e-3, SPEED, RATE), rel=1e-6)
    assert _half_sine(time_s, -collision(time_s), (TOUCH, 0.0, SPEED, RATE)) is None


def test_a_flights_line_is_that_of_its_samples() -> None:
    time_s = 50.0 + np.arange(20) * 0.1
    slope, height = _flight(time_s, 3.0 * time_s - 7.0 + np.where(np.arange(20) < 5, 100.0, 0.0), 5, 20)
    assert (slope, height) == (pytest.approx(3.0), pytest.approx(-7.0))


@pytest.mark.parametrize(("dip", "mark"), [(0.0, 0.05), (0.03, 0.05), (0.1, 0.12), (0.3, 0.36), (0.4, 0.4), (0.9, 0.4)])
def test_the_touch_is_where_the_force_exceeds_what_pulls_the_other_way_and_a_twentieth_of_its_peak(
    dip: float, mark: float
) -> None:
    """By a fifth, and two fifths of the peak at most; a plate cannot pull."""
    time_s = np.arange(3000) * DT
    peak, lasts = abs(SPEED) * RATE, math.pi / RATE
    inside = (time_s > TOUCH) & (time_s < TOUCH + lasts)
    force = np.where(inside, np.sin(RATE * (time_s - TOUCH)), 0.0)
    force -= dip * np.exp(-(((time_s - 0.6 * TOUCH) / 4e-4) ** 2))
    place = np.cumsum(np.cumsum(peak * force)) * DT**2 + SPEED * time_s
    turn = int((TOUCH + 0.5 * lasts) / DT)
    found = _onset(time_s, place, 1e-13, RATE, SPEED, turn, DT)
    assert found == pytest.approx(TOUCH + math.asin(mark) / RATE, abs=3.0 * DT)
    # where nothing is loud enough it is half a swing before the turn
    level = _onset(time_s, SPEED * time_s, 1e-13, RATE, SPEED, turn, DT)
    assert level == pytest.approx(time_s[turn] - 0.5 * lasts, abs=DT)


def refusal(time_s: Floats, place: Floats) -> str:
    """Return why a record shows no collision, or nothing."""
    try:
        read_course(time_s, place, np.ones(time_s.size, dtype=bool))
    except NoCollision as why:
        return str(why)
    return ""


@pytest.mark.parametrize(
    ("before", "after", "inside"), [(19, 900, False), (20, 900, True), (900, 9, False), (900, 10, True)]
)
def test_a_turn_must_lie_within_the_record(before: int, after: int, inside: bool) -> None:
    time_s, place = noisy(noise=1e-12)
    turn = int(np.argmin(place))
    some = slice(turn - before, turn + after)
    assert ("no turnaround" in refusal(time_s[some], place[some])) is not inside

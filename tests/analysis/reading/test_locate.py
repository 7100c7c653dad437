"""Where a collision lies in a record: turns, the duration of the contact, and the samples of touch and release."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.reading.locate import (
    _contact_samples,
    _extrapolated_release,
    _faded_to,
    _filled,
    _refined_touch,
    _slows,
    _smooth_acceleration,
    _span,
    _Turn,
    _turns,
    _width,
    find_collision,
)
from analysis.shot.motion import Motion
from tests.analysis.synthetic_collision import Synthetic, motion_from

RIG = Synthetic(rate_hz=1e4, bandwidth_hz=1e3)
SPEED = 0.2
RATE = RIG.rate_hz


def bounce(*, before: int = 400, contact: int = 300, after: int = 500, out: float = SPEED) -> Any:
    """Return a displacement with one half-sine contact, of so many samples each, without noise."""
    u, rate = np.arange(contact), np.pi / contact
    inside = -SPEED / RATE * np.sin(rate * u) / rate
    into = SPEED / RATE * np.arange(before, 0, -1)
    away = out / RATE * np.arange(after)
    return np.concatenate([into, inside, away])


def motion_of(x: Any, noise_m: float = RIG.noise_m, seed: int = 1) -> Motion:
    noise = np.random.default_rng(seed).normal(0.0, noise_m, x.size)
    return motion_from(np.arange(x.size) / RATE, x + noise, replace(RIG, noise_m=noise_m))


def test_a_half_sine_contact_is_located_to_a_hundredth_of_it_with_its_flights() -> None:
    span = find_collision(motion_of(bounce()))
    assert span is not None
    assert span.first == pytest.approx(400, abs=4) and span.last == pytest.approx(700, abs=4)
    assert span.turn == pytest.approx(550, abs=1)
    assert (span.flight_first, span.flight_last) == (0, 1199)
    assert (span.disturbed_before, span.disturbed_after, span.finished) == (False, False, True)


def test_the_duration_of_a_contact_follows_from_how_long_the_velocity_turns() -> None:
    for contact in (150, 300):
        x = bounce(contact=contact)
        turn = _Turn(0, 400 + contact // 2, x.size - 1, True)
        lengths = _contact_samples(motion_of(x), x, turn)
        assert lengths is not None
        assert lengths[0] == pytest.approx(contact, rel=0.2)
        assert lengths[1] == pytest.approx(SPEED / RATE, rel=1e-6)
    gone = bounce()[:551]  # of a record that ends at the turn the first half counts twice
    lengths = _contact_samples(motion_of(gone), gone, _Turn(0, 550, 550, False))
    assert lengths is not None and lengths[0] == pytest.approx(300, rel=0.2)
    slower = bounce(out=0.5 * SPEED)
    lengths = _contact_samples(motion_of(slower), slower, _Turn(0, 550, slower.size - 1, True))
    assert lengths is not None and lengths[1] == pytest.approx(SPEED / RATE, rel=1e-6)
    # from 0.7 of its own speed to the turn each way, over the share of a half-sine that this is
    share = (np.arcsin(0.7) + np.arcsin(0.35)) / (2.0 * np.arcsin(0.7))
    assert lengths[0] == pytest.approx(share * 300, rel=0.1)
    assert _contact_samples(motion_of(gone), gone, _Turn(550, 550, 550, False)) is None


def test_another_force_in_a_flight_ends_it_on_its_own_side() -> None:
    push = 3e-5 * np.clip(np.arange(600) - 300, 0, 100) ** 2 / 1e4 * 40
    later = np.concatenate([bounce(after=0), bounce(after=600)[700:] + push])
    span = find_collision(motion_of(later))
    assert span is not None
    assert (span.disturbed_before, span.disturbed_after) == (False, True)
    assert 900 < span.flight_last < 1010 and span.flight_first == 0
    backwards = find_collision(motion_of(later[::-1].copy()))
    assert backwards is not None
    assert (backwards.disturbed_before, backwards.disturbed_after) == (True, False)
    assert backwards.flight_last == 1299
    assert backwards.flight_first == pytest.approx(1299 - span.flight_last, abs=8)
    assert backwards.first == pytest.approx(1299 - span.last, abs=4)


def test_a_record_that_ends_in_the_contact_is_unfinished_and_one_that_ends_in_the_flight_to_it_has_none() -> None:
    x = bounce()
    for samples, finished in ((500, False), (545, False), (800, True)):
        span = find_collision(motion_of(x[:samples]))
        assert span is not None and span.finished is finished
        assert span.first == pytest.approx(400, abs=5)
        assert span.last == (samples - 1 if not finished else pytest.approx(700, abs=5))
    assert find_collision(motion_of(x[:400])) is None
    assert find_collision(motion_of(-x[:900])) is None


def test_a_fall_ends_slower_than_it_was_in_a_contact_alone() -> None:
    x = -np.arange(200.0)
    assert not _slows(x)
    for part, slows in ((0.95, False), (0.85, True)):
        assert bool(_slows(np.concatenate([x, x[-1] - part * np.arange(1.0, 12.0)]))) is slows
    assert not _slows(np.array([0.0, -1.0]))


def test_the_first_collision_after_the_trigger_is_taken_or_the_first_where_none_follows() -> None:
    once = bounce(before=400, after=400)
    twice = motion_of(np.concatenate([once, once]))
    for trigger_s, at in ((None, 550), (0.0549, 550), (0.0552, 1650), (0.2, 550)):
        span = find_collision(replace(twice, trigger_time_s=trigger_s))
        assert span is not None and span.turn == pytest.approx(at, abs=1)


def test_turns_are_minima_between_a_sufficient_fall_and_rise() -> None:
    once = bounce(before=400, after=400)
    x = np.concatenate([once, once])
    first, second = _turns(motion_of(x), x)
    assert (first.begin, first.at, first.end, first.rises) == (0, 550, pytest.approx(1100, abs=1), True)
    assert (second.begin, second.at, second.end, second.rises) == (pytest.approx(1100, abs=1), 1650, 2199, True)
    depth = float(once[0] - once.min())
    for part, seen in ((0.015, False), (0.03, True)):  # 2 % of the whole path
        dip = np.full(300, once[-1])
        dip[100:200] -= part * depth * np.sin(np.pi * np.arange(100) / 100)
        both = np.concatenate([once, dip])
        assert (len(_turns(motion_of(both), both)) == 2) is seen
    for noise, seen in ((0.9, True), (1.1, False)):  # thirty of it
        loud = replace(motion_of(once), displacement_std_m=np.full(once.size, noise * depth / 30.0))
        assert bool(_turns(loud, once)) is seen


@pytest.mark.parametrize("samples", [1100, 9000])  # each sample looked at, and every fourth
def test_a_turn_is_the_lowest_sample_however_coarsely_it_was_looked_for(samples: int) -> None:
    scale = samples / 1100
    x = bounce(before=round(400 * scale), contact=round(300 * scale), after=round(400 * scale))
    (turn,) = _turns(motion_of(x), x)
    assert turn.at == int(x.argmin())
    assert (turn.begin, turn.end, turn.rises) == (0, x.size - 1, True)


def test_holes_are_bridged_by_straight_lines_and_32_samples_have_to_be_known() -> None:
    x = bounce()
    motion = motion_of(x)
    holed = x.copy()
    holed[100:110] = np.nan
    filled = _filled(motion_of(holed, 1e-12))
    assert filled is not None and filled[100:110] == pytest.approx(x[100:110], abs=1e-10)
    assert _filled(motion) is motion.displacement_m
    for known in (31, 32):
        few = replace(motion, valid=np.arange(x.size) < known)
        filled = _filled(few)
        assert (filled is not None) is (known == 32)
        if filled is not None:
            assert filled[known:] == pytest.approx(motion.displacement_m[known - 1])


def test_the_smoothed_acceleration_is_the_second_difference_of_means() -> None:
    x, width = np.random.default_rng(2).standard_normal(80), 6
    box = np.ones(3) / 3
    mean = np.convolve(x, box, mode="same")
    direct = (mean[2 * width :] - 2 * mean[width:-width] + mean[: -2 * width]) / width**2
    got = _smooth_acceleration(x, width)
    assert got[width + 2 : -width - 2] == pytest.approx(direct[2:-2], rel=1e-9)
    assert np.all(got[:width] == got[width]) and np.all(got[-width:] == got[-width - 1])
    k = np.arange(80.0)
    assert _smooth_acceleration(0.25 * k**2 + k, width)[width + 2 : -width - 2] == pytest.approx(0.5)
    assert _smooth_acceleration(k, width)[:width] == pytest.approx(0.0, abs=1e-12)  # reflected about the ends
    assert not _smooth_acceleration(x[:12], width).any() and _smooth_acceleration(x[:13], width).any()


def test_a_force_is_smoothed_over_a_tenth_of_the_contact_or_over_more_until_its_noise_is_small() -> None:
    x = bounce()
    quiet = motion_of(x)
    assert _width(quiet, 300.0, SPEED / RATE) == 30
    peak = np.pi * SPEED / RATE / 300.0  # m per sample^2
    random = np.random.default_rng(3)
    noise_m = 6e-6
    found = _width(replace(quiet, displacement_std_m=np.full(x.size, noise_m)), 300.0, SPEED / RATE)
    assert 30 < found < 120
    rms = [
        float(np.std(_smooth_acceleration(noise_m * random.standard_normal(60_000), w)))
        for w in (found, round(found / 1.32))
    ]
    assert rms[0] < 0.2 * 0.03 * peak < 1.3 * rms[1]  # a fifth of the force that counts
    loudest = _width(replace(quiet, displacement_std_m=np.full(x.size, 1e-3)), 300.0, SPEED / RATE)
    assert loudest == 120
    assert _width(quiet, 4.0, SPEED / RATE) == 1


def test_a_touch_is_the_sample_before_the_force_rises_above_six_of_its_noise() -> None:
    noise, edge = 1e-4, 500
    flown = noise * np.random.default_rng(5).uniform(-1.0, 1.0, 1000)
    inside = np.arange(1000) >= edge
    force = np.where(inside, 0.5, flown)
    motion = replace(motion_of(np.zeros(1000)), force_n=force, force_std_n=np.full(1000, noise))
    for further in (-15, 0, 9):
        assert _refined_touch(motion, edge + further, 20) == edge - 1
    weak = replace(motion, force_n=np.where(inside, 13.0 * noise, force))
    assert _refined_touch(weak, edge - 5, 20) == edge - 1
    drowned = replace(motion, force_n=np.where(inside, 11.0 * noise, force))
    assert _refined_touch(drowned, edge - 5, 20) == edge + 5  # half a width inside
    loud = replace(drowned, force_n=np.where(inside, 25.0 * noise, 10.0 * flown))  # than it says
    assert _refined_touch(loud, edge - 5, 20) == edge + 5


@pytest.mark.parametrize("lost", [0.03, 0.3])  # of the peak
@pytest.mark.parametrize("smoothed", [0.02, 0.1, 0.3])
def test_a_force_that_fades_ends_where_its_half_sine_does(lost: float, smoothed: float) -> None:
    """The second difference of a contact that springs with a little damping, of 2,870 samples."""
    contact = 2870
    width = round(smoothed * contact)
    for damping, off in ((0.0, 0.002), (0.01, 0.004)):  # of critical: it fades earlier
        rate, t = np.pi / contact, np.arange(2 * contact)
        rung = rate * np.sqrt(1.0 - damping**2)
        decay = np.exp(-damping * rate * t)
        deep = decay * np.sin(rung * t) / rung
        speed = decay * (np.cos(rung * t) - damping * rate / rung * np.sin(rung * t))
        end = 100 + int(np.flatnonzero((rate**2 * deep + 2.0 * damping * rate * speed)[100:] < 0.0)[0])
        x = np.concatenate([np.arange(-contact, 0), np.where(t < end, deep, deep[end] + speed[end] * (t - end))])
        turn = int(x.argmax())
        force = -_smooth_acceleration(x, width)[turn:]
        seen = force[: int(np.flatnonzero(force < lost * force[0])[0]) + 1]
        half, std = _extrapolated_release(seen / force[0], lost, width)
        assert turn + half == pytest.approx(contact + end, abs=off * contact)
        fades = np.arcsin(max(lost, 0.15)) / np.pi * contact
        assert std == pytest.approx(np.linalg.norm((0.05 * fades, 0.01 * width, 0.5)), rel=0.3)


def test_a_force_that_is_seen_for_longer_or_less_than_a_half_sine_ends_where_it_is_lost() -> None:
    width, half = 30, 150
    x = np.cumsum(np.cumsum(np.maximum(np.cos(0.5 * np.pi * np.arange(-300, 300) / half), 0.0)))
    force = _smooth_acceleration(x, width)[299:]
    force /= force[0]
    lost = round(half * _faded_to(0.03, 0.1))
    for size in (lost - 6, lost + 6):
        assert _extrapolated_release(force[:size], 0.03, width)[0] == pytest.approx(half, abs=1.5)
    for size in (lost - 9, lost + 9):
        assert _extrapolated_release(force[:size], 0.03, width) == (size - 6.0, 6.0)


def test_a_contact_that_pulls_is_none() -> None:
    x = bounce()
    turn = _Turn(0, 550, x.size - 1, True)
    assert _span(motion_of(x), x, turn) is not None
    assert _span(motion_of(-x), -x, replace(turn, begin=500)) is None


@pytest.mark.parametrize(("rests", "one"), [(15, True), (80, False)])
def test_a_force_that_rests_for_a_tenth_of_the_contact_has_ended(rests: int, one: bool) -> None:
    """A push that turns the block round, a rest, and a weaker push."""
    parts = [(400, 0.0), (240, 1.7), (rests, 0.0), (60, 0.25), (500, 0.0)]  # samples, times the speed
    pushes = [part * np.pi / (2 * n) * np.sin(np.pi * (np.arange(n) + 0.5) / n) for n, part in parts]
    speed = SPEED / RATE * (np.cumsum(np.concatenate(pushes)) - 1.0)
    span = find_collision(motion_of(np.cumsum(speed)))
    assert span is not None
    assert span.last == pytest.approx(640 + (rests + 60 if one else 0), abs=8)


def test_a_pull_in_flight_is_another_force_as_a_push_is() -> None:
    for sign in (1.0, -1.0):
        pull = sign * 4e-9 * 1000 * np.clip(np.arange(600) - 300, 0, 100) ** 2 / 1e3
        span = find_collision(motion_of(np.concatenate([bounce(after=0), bounce(after=600)[700:] + pull])))
        assert span is not None and span.disturbed_after and span.flight_last < 1010

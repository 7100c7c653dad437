"""A push by hand: where it begins and ends, and that it moves as smoothly as a hand."""

import numpy as np
import pytest

from instrument.bench.effects import parse
from instrument.bench.frame import frame_of
from instrument.bench.mechanics import Bodies
from instrument.bench.rig import HOLD_M, RELEASE_M, held_block_motion, next_push_time_s, push_duration_s, simulate_push
from instrument.bench.site import QUIET, site_named

SPEED = 0.25


@pytest.fixture(scope="module")
def pushed():
    frame = frame_of(site_named("VC-A"), 4)
    return simulate_push(2.0, -SPEED, parse("sensor_drift:ramp_m_per_s2=1e-3"), Bodies(), frame), frame


def test_a_shot_is_pushed_released_caught_and_brought_back_at_its_times(pushed):
    shot, _ = pushed
    assert push_duration_s(-SPEED) == pytest.approx(2 * 18e-3 / SPEED) == push_duration_s(SPEED)
    assert shot.start_s == 2.0 and shot.release_s == pytest.approx(2.0 + 0.144)
    assert shot.caught_s == pytest.approx(shot.release_s + RELEASE_M / SPEED + 0.03 + 0.19)
    assert shot.end_s == pytest.approx(shot.caught_s + 0.1 + 0.5) and shot.time_s[-1] == shot.end_s
    assert np.all(np.diff(shot.time_s) > 0) and shot.time_s[0] == 2.0


def test_the_block_starts_and_ends_at_rest_in_the_hand_and_flies_with_the_asked_speed(pushed):
    shot, frame = pushed
    at = np.array([shot.start_s, shot.release_s - 1e-9, shot.end_s])
    x, v, block = shot.at(at)
    assert block == pytest.approx([HOLD_M, RELEASE_M, HOLD_M], abs=1e-9)
    assert x == pytest.approx([HOLD_M, RELEASE_M, HOLD_M], abs=1e-9)
    assert v == pytest.approx([0.0, -SPEED, 0.0], abs=1e-5)
    flight = shot.release_s + np.linspace(0.0, 0.9 * RELEASE_M / SPEED, 50)
    x, v, block = shot.at(flight)
    since = flight - shot.release_s
    assert block == pytest.approx(RELEASE_M - SPEED * since, abs=1e-12)  # inertial, whatever the frame does
    assert x - block == pytest.approx(0.5e-3 * since**2, abs=1e-12)  # what the optics drift
    assert v == pytest.approx(-SPEED + 1e-3 * since, abs=1e-9)
    struck = np.array([shot.release_s + shot.trajectory.release_time_s + 1e-3])
    assert shot.at(struck)[2] == pytest.approx(
        shot.trajectory.block_m(struck - shot.release_s) + frame.motion(struck)[0], abs=1e-12
    )


def test_velocity_is_the_slope_of_the_optical_path_all_the_way(pushed):
    shot, _ = pushed
    steps = np.diff(shot.time_s)
    apart = steps > 1e-7
    slope = np.diff(shot.optical_m)[apart] / steps[apart]
    middle = 0.5 * (shot.optical_m_per_s[1:] + shot.optical_m_per_s[:-1])[apart]
    assert slope == pytest.approx(middle, rel=0, abs=2e-4)
    block_slope = np.diff(shot.block_m)[apart] / steps[apart]
    assert block_slope == pytest.approx(
        0.5 * (shot.block_m_per_s[1:] + shot.block_m_per_s[:-1])[apart], rel=0, abs=2e-4
    )
    catch = (shot.time_s >= shot.caught_s) & (shot.time_s <= shot.caught_s + 0.1)
    slowing = np.diff(np.abs(shot.block_m_per_s[catch]))
    assert np.all(slowing <= 1e-12)
    for met_s in (shot.release_s, shot.caught_s, shot.caught_s + 0.1):  # no jump from one part to the next
        near = np.abs(shot.time_s - met_s) < 2e-3
        assert np.abs(np.diff(shot.optical_m_per_s[near])).max() < 3e-4  # the drift ends with the flight


def test_hand_and_path_meet_where_a_push_begins():
    assert next_push_time_s(0.0) == 0.0 and next_push_time_s(1 / 9) == pytest.approx(1 / 9)
    assert next_push_time_s(0.1) == pytest.approx(1 / 9) and next_push_time_s(1 / 9 + 1e-3) == pytest.approx(2 / 9)
    x, v = held_block_motion(np.array([0.0, 1 / 18, 1 / 9, 1 / 36]))
    assert x - HOLD_M == pytest.approx([0.0, 3e-6, 0.0, 1.5e-6], abs=1e-15)
    assert v == pytest.approx([0.0, 0.0, 0.0, 1.5e-6 * 2 * np.pi * 9], abs=1e-15)


def test_a_quiet_bench_returns_the_block_as_it_came():
    shot = simulate_push(0.0, -SPEED, {}, Bodies(), frame_of(QUIET, 1))
    assert shot.optical_m == pytest.approx(shot.block_m, abs=1e-15)

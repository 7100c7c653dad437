"""The motion of the site is measured at rest only, and kept while the block moves."""

import numpy as np
import pytest

from analysis.reading.site import PlannedShot
from analysis.signal.stream import LiveChunk
from instrument.devices.digitizer import CaptureSettings
from instrument.live.live_thread import RestWatch, planned_shot

RATE = 10e3


def _fed(watch, velocity, blocks=(331, 97, 1000)):
    at, turn = 0, 0
    while at < velocity.size:
        part = velocity[at : at + blocks[turn % len(blocks)]]
        empty = np.zeros(part.size)
        watch.add(LiveChunk(empty, empty, part, empty, 1e6, None))
        at, turn = at + part.size, turn + 1
    return watch


def test_a_rest_of_seconds_shows_the_floor_and_a_push_leaves_the_last_one_standing():
    time_s = np.arange(round(2 * RATE)) / RATE
    still = 1e-6 * np.random.default_rng(1).standard_normal(time_s.size) + 9e-6 * np.sin(2 * np.pi * 24.9 * time_s)
    watch = _fed(RestWatch(RATE, PlannedShot()), still)
    assert watch.floor.lines[0].frequency_hz == pytest.approx(24.9, abs=0.1)
    before = watch.floor
    _fed(watch, np.concatenate((np.full(3000, 0.2), still[:5000])))  # pushed, then not long enough at rest
    assert watch.floor is before
    _fed(watch, np.concatenate(([np.nan], still)))
    assert watch.floor is not before and watch.floor.seconds < 2.0


def test_rest_begins_after_the_last_push_of_a_block_of_samples():
    still = 1e-6 * np.random.default_rng(2).standard_normal(round(0.8 * RATE))
    twice = np.concatenate((still, np.full(400, 0.2), still[:4000], np.full(400, 0.2), still))
    watch = _fed(RestWatch(RATE, PlannedShot()), twice, blocks=(twice.size,))
    assert watch.floor is None  # 0.8 s since the second push are too short
    _fed(watch, still, blocks=(still.size,))
    assert watch.floor.seconds == pytest.approx(1.6, abs=1e-3)


def test_a_floor_is_read_anew_after_as_much_rest_as_it_was_read_from():
    still = 1e-6 * np.random.default_rng(3).standard_normal(round(1.5 * RATE))
    watch = _fed(RestWatch(RATE, PlannedShot()), still, blocks=(still.size,))
    first = watch.floor
    _fed(watch, still[: round(1.4 * RATE)], blocks=(1000,))
    assert watch.floor is first
    _fed(watch, still[: round(0.2 * RATE)], blocks=(1000,))
    assert watch.floor is not first and watch.floor.seconds == pytest.approx(3.0, abs=0.11)


def test_a_floor_of_the_longest_record_is_read_every_four_seconds():
    still = 1e-6 * np.random.default_rng(3).standard_normal(round(6.0 * RATE))
    watch = _fed(RestWatch(RATE, PlannedShot()), still, blocks=(still.size,))
    first = watch.floor
    assert first.seconds == pytest.approx(4.0, abs=1e-3)
    _fed(watch, still[: round(3.9 * RATE)], blocks=(1000,))
    assert watch.floor is first
    _fed(watch, still[: round(0.2 * RATE)], blocks=(1000,))
    assert watch.floor is not first


def test_what_never_rests_has_no_floor():
    assert _fed(RestWatch(RATE, PlannedShot()), np.full(30_000, 0.1)).floor is None


def test_the_flights_are_those_of_the_settings():
    shot = planned_shot(CaptureSettings(10e6, 1_500_000, 60_000))
    assert shot.before_s == pytest.approx(8.6e-3) and shot.after_s == pytest.approx(0.15 - 8.6e-3 - 28.7e-3)
    short = planned_shot(CaptureSettings(10e6, 10_000, 0))
    assert (short.before_s, short.after_s) == (2.6e-3, 2e-3)  # a flight of no length has no noise to plan with

"""Readings of a shot in a laboratory: right within what they state, or flagged with what is wrong."""

import numpy as np
import pytest

from analysis.reading.locate import find_collision
from analysis.reading.read import read_frame_motion, read_impact
from analysis.shot.impact import Impact
from analysis.shot.quantity import Quantity
from tests.analysis.disturbance import Disturbance, Knock, Line, disturbed_motion
from tests.analysis.synthetic_collision import Synthetic, motion_from, motion_of, position_m

RIG = Synthetic(speed_m_per_s=0.16, touch_s=0.012003)
COR = 0.261702343 / 0.265
TRUE = {
    "velocity_in_m_per_s": -0.16,
    "velocity_out_m_per_s": 0.16 * COR,
    "cor_quasi_static": COR,
    "force_peak_n": 0.511915 * 0.16 / 0.265,
    "contact_time_s": 28.70771255e-3,
    "deflection_max_m": 2.388512e-3 * 0.16 / 0.265,
}


def pulls(impact: Impact) -> dict[str, float]:
    """Return how far each reading lies from the truth, in its own standard uncertainties."""
    found = {}
    for name, value in TRUE.items():
        reading = getattr(impact, name)
        assert isinstance(reading, Quantity), (name, reading)
        found[name] = (reading.value - value) / reading.std
    return found


def all_right(impact: Impact) -> bool:
    return all(abs(pull) < 5.0 for pull in pulls(impact).values())


@pytest.mark.parametrize("phase", [0.0, 1.1, 2.2, 4.0])
def test_a_fan_of_600_hz_and_10_nm_is_found_and_taken_off(phase: float) -> None:
    impact = read_impact(disturbed_motion(RIG, Disturbance(lines=(Line(600.0, 1e-8, phase),))))
    assert all_right(impact), pulls(impact)
    assert "vibration" in impact.flags
    assert impact.disturbance is not None
    (line,) = impact.disturbance.lines
    assert line.frequency_hz.value == pytest.approx(600.0, abs=0.05)
    assert line.amplitude_m.value == pytest.approx(1e-8, rel=0.01)
    # what is known of the line costs next to nothing: the uncertainty is that of a quiet table, to a half
    assert impact.cor_quasi_static.std < 1.5 * read_impact(motion_of(RIG)).cor_quasi_static.std  # type: ignore[union-attr]


def test_several_machines_at_once() -> None:
    lines = (Line(153.2, 5.3e-8, 0.4), Line(297.8, 3.3e-8, 2.0), Line(118.8, 1.2e-8, 5.0))
    impact = read_impact(disturbed_motion(RIG, Disturbance(lines=lines)))
    assert all_right(impact), pulls(impact)
    assert impact.disturbance is not None
    found = sorted(line.frequency_hz.value for line in impact.disturbance.lines)
    assert found == pytest.approx([118.8, 153.2, 297.8], abs=0.1)


@pytest.mark.parametrize("criterion", ["VC-A", "VC-C", "VC-E"])
def test_a_buildings_floor_stands_in_the_uncertainties(criterion: str) -> None:
    for seed in (1, 2):
        impact = read_impact(disturbed_motion(RIG, Disturbance(criterion=criterion, seed=seed)))
        assert all_right(impact), (seed, pulls(impact))
        assert "vibration" in impact.flags
        assert impact.disturbance is not None
        assert impact.disturbance.shares["velocity_in_m_per_s"] > 0.9


def test_a_knock_in_the_approach_is_left_out() -> None:
    impact = read_impact(disturbed_motion(RIG, Disturbance(knocks=(Knock(5e-3, 5e-8),))))
    assert "knock" in impact.flags
    assert all_right(impact), pulls(impact)


@pytest.mark.parametrize("at_s", [9.3e-3, 10e-3, 10.5e-3])
@pytest.mark.parametrize("amplitude_m", [5e-8, 1e-7])
def test_a_knock_shortly_before_the_touch_is_not_taken_for_it_without_a_word(at_s: float, amplitude_m: float) -> None:
    """The flight leaves its line at the knock, but no contact comes so slowly: the numbers say how unsure."""
    impact = read_impact(disturbed_motion(RIG, Disturbance(knocks=(Knock(at_s, amplitude_m),))))
    assert impact.touch_time_s.std > 0.8e-3
    assert all_right(impact), pulls(impact)
    assert read_impact(motion_of(RIG, 1)).touch_time_s.std < 1e-5


def test_a_knock_that_rings_until_the_record_ends_is_left_out_to_the_end() -> None:
    motion = disturbed_motion(RIG, Disturbance(knocks=(Knock(50e-3, 5e-8),)))
    impact = read_impact(motion)
    assert impact.disturbance is not None
    ((begin_s, end_s),) = impact.disturbance.knocks_s
    assert 45e-3 < begin_s < 50e-3
    last_s = float(motion.time_s[-1])
    assert last_s - 0.5e-3 < end_s <= last_s + 1e-9  # displacements are averaged over 0.5 ms


def test_a_knock_that_the_record_begins_in_is_left_out_from_its_first_samples_on() -> None:
    """What was left out is stated from the first sample of it to the last, not from the middles of their means."""
    rig = Synthetic(speed_m_per_s=0.16, touch_s=0.018003, duration_s=0.07)
    impact = read_impact(disturbed_motion(rig, Disturbance(knocks=(Knock(1e-3, 5e-8, decay_s=1e-3),))))
    assert impact.disturbance is not None
    ((begin_s, end_s),) = impact.disturbance.knocks_s
    assert begin_s < 0.1e-3
    assert 5e-3 < end_s < rig.touch_s


@pytest.mark.parametrize(("amplitude_m", "hz_per_s"), [(5e-8, 300.0), (2e-7, 100.0)])
def test_a_machine_that_runs_up_is_not_taken_for_two_at_nearly_one_frequency(
    amplitude_m: float, hz_per_s: float
) -> None:
    """Two sines closer than the flights can tell apart fit anything by nearly cancelling each other."""
    time = np.arange(0.0, RIG.duration_s, 1.0 / RIG.rate_hz)
    angle = 2 * np.pi * (600.0 * time + 0.5 * hz_per_s * (time - 0.03) ** 2)
    x = position_m(RIG, time) + amplitude_m * np.sin(angle)
    x += np.random.default_rng(1).normal(0.0, RIG.noise_m, time.size)
    impact = read_impact(motion_from(time, x, RIG))
    assert impact.disturbance is not None
    found = sorted(line.frequency_hz.value for line in impact.disturbance.lines)
    assert np.all(np.diff(found) > 0.5 / RIG.duration_s)
    assert max(line.amplitude_m.value for line in impact.disturbance.lines) < 1.1 * amplitude_m
    assert abs(pulls(impact)["velocity_in_m_per_s"]) < 5.0


@pytest.mark.parametrize("lines", [(), (Line(600.0, 1e-8, 1.1),), (Line(40.0, 2e-7, 0.3),)])
def test_what_shook_is_the_same_without_reading_all(lines: tuple[Line, ...]) -> None:
    motion = disturbed_motion(RIG, Disturbance(lines=lines))
    disturbance = read_impact(motion).disturbance
    assert disturbance is not None
    vibration = read_frame_motion(motion)
    assert (vibration is None) == (disturbance.vibration is None) == (not lines)
    assert repr(vibration) == repr(disturbance.vibration)


def test_a_quiet_table_is_not_called_a_shaking_one() -> None:
    for seed in range(4):
        assert read_impact(motion_of(RIG, seed)).flags == ()


def test_what_rings_after_the_impact_alone_is_not_taken_off_the_contact() -> None:
    time = np.arange(0.0, RIG.duration_s, 1.0 / RIG.rate_hz)
    after = np.maximum(time - RIG.touch_s - 28.7e-3, 0.0)
    x = position_m(RIG, time) + 2e-8 * np.sin(2 * np.pi * 700.0 * after)
    x += np.random.default_rng(1).normal(0.0, RIG.noise_m, time.size)
    impact = read_impact(motion_from(time, x, RIG))
    assert impact.disturbance is not None
    assert impact.disturbance.lines == ()
    assert abs(pulls(impact)["force_peak_n"]) < 5.0


def test_a_hand_that_catches_the_block_ends_the_reading() -> None:
    time = np.arange(0.0, 0.09, 1.0 / RIG.rate_hz)
    caught_s = 0.060
    x = position_m(RIG, time)
    late = time > caught_s
    speed = 0.16 * COR
    x[late] = x[~late][-1] + speed * 2e-3 * -np.expm1(-(time[late] - caught_s) / 2e-3)
    x += np.random.default_rng(1).normal(0.0, RIG.noise_m, time.size)
    impact = read_impact(motion_from(time, x, RIG))
    assert "flight_cut" in impact.flags
    assert all_right(impact), pulls(impact)


@pytest.mark.parametrize("lasts_s", [0.4, 0.6, 1.0, 3.0])
def test_a_record_that_outlasts_the_flight_gives_the_same_numbers_flagged(lasts_s: float) -> None:
    """The hand catches the block, carries it back and holds it: what a long record holds besides the shot."""
    time = np.arange(0.0, lasts_s, 1.0 / RIG.rate_hz)
    x = position_m(RIG, time)
    caught = int(0.26 * RIG.rate_hz)
    speed, after = 0.16 * COR, time[caught:] - time[caught]
    x[caught:] = x[caught] + speed * 0.05 * -np.expm1(-after / 0.05)
    back = np.clip((after - 0.12) / 0.5, 0.0, 1.0)
    x[caught:] -= 0.02 * back**2 * (3.0 - 2.0 * back)
    x += np.random.default_rng(1).normal(0.0, RIG.noise_m, time.size)
    impact = read_impact(motion_from(time, x, RIG))
    assert all_right(impact), pulls(impact)
    assert impact.flags == ("goes_on",)


def test_the_first_collision_after_the_trigger_is_read() -> None:
    """Two impacts in one record, the block thrown back by a hand between them."""
    once = Synthetic(speed_m_per_s=0.16, touch_s=0.012003, duration_s=0.08)
    time = np.arange(0.0, once.duration_s, 1.0 / once.rate_hz)
    first = position_m(once, time)
    x = np.concatenate([first, first[::-1][1:], first[1:]])
    x += np.random.default_rng(1).normal(0.0, once.noise_m, x.size)
    motion = motion_from(np.arange(x.size) / once.rate_hz, x, once)
    span = find_collision(motion)
    assert span is not None
    assert motion.time_s[span.turn] == pytest.approx(0.012003 + 14.3e-3, abs=1e-3)
    assert all_right(read_impact(motion))


def test_bounces_of_a_plate_in_a_building_are_not_read_from_what_the_floor_does() -> None:
    """A flight of a millisecond is bent by a nanometre: as much as the first samples of a contact."""
    quiet = read_impact(motion_of(RIG)).cor_kinetic.onsets
    assert isinstance(quiet, Quantity)
    for seed in (1, 2, 3):
        onsets = read_impact(disturbed_motion(RIG, Disturbance(criterion="VC-C", seed=seed))).cor_kinetic.onsets
        assert isinstance(onsets, Quantity)
        assert abs(onsets.value - 0.500) < 5.0 * onsets.std, seed
        assert onsets.std < 0.03

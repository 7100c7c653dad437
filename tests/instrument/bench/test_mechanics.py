"""The simulated collision against the reference solution, and its balance of energy and momentum."""

import numpy as np
import pytest

from instrument.bench import forces as slot
from instrument.bench.effects import force_slots, parse
from instrument.bench.frame import Frame
from instrument.bench.mechanics import Bodies, FrameAcceleration, _step, collide
from instrument.bench.sines import Sines
from instrument.bench.site import QUIET

SPEED = 0.265


@pytest.fixture(scope="module")
def paper():
    return collide(-SPEED)


def test_events_of_the_reference_solution(paper):
    touch = paper.touch_time_s
    found = [(time - touch) * 1e3 for _, time in paper.events]
    assert [what for what, _ in paper.events] == ["touch", "release"] * 3
    assert found == pytest.approx([0, 0.45318387, 1.56573968, 2.16218652, 2.34904083, 28.70771255], abs=2e-8)
    assert touch == pytest.approx(2e-3 / SPEED, abs=1e-14)


def test_velocity_force_and_deflection_of_the_reference_solution(paper):
    assert paper.velocity_in_m_per_s == pytest.approx(-SPEED, abs=1e-14)
    assert paper.velocity_out_m_per_s == pytest.approx(0.261702343, abs=1e-9)
    time = np.arange(0.0, 0.06, 1e-6)
    assert -paper.block_m(time).min() == pytest.approx(2.388512e-3, abs=1e-9)
    force = Bodies().block_mass_kg * paper.acceleration_m_per_s2
    peak = int(np.argmax(force))
    assert force[peak] == pytest.approx(0.511915, abs=1e-6)
    assert (paper.time_s[peak] - paper.touch_time_s) * 1e3 == pytest.approx(14.3312, abs=5e-3)


def test_step_halved_changes_nothing_that_the_optics_could_see(paper):
    fine = collide(-SPEED, steps_s=(1e-6, 2.5e-6))
    time = np.arange(0.0, 0.06, 1e-5)
    assert np.abs(fine.block_m(time) - paper.block_m(time)).max() < 1e-13  # a floor of 1e-10 m is measured


def test_nothing_is_lost_without_damping():
    elastic = Bodies(contact_damping_n_s_per_m=0.0)
    run = collide(-SPEED, bodies=elastic)
    y = run.states
    overlap = np.maximum(0.0, y[:, slot.PLATE_X] - y[:, slot.BLOCK_X])
    energy = (
        0.5 * elastic.block_mass_kg * y[:, slot.BLOCK_V] ** 2
        + 0.5 * elastic.plate_mass_kg * y[:, slot.PLATE_V] ** 2
        + 0.5 * elastic.plate_stiffness_n_per_m * y[:, slot.PLATE_X] ** 2
        + 0.5 * elastic.contact_stiffness_n_per_m * overlap**2
    )
    assert np.ptp(energy) < 1e-9 * energy[0]


def test_what_the_contact_damper_takes_is_missing(paper):
    y = paper.states
    body = Bodies()
    overlap = np.maximum(0.0, y[:, slot.PLATE_X] - y[:, slot.BLOCK_X])
    power = body.contact_damping_n_s_per_m * (y[:, slot.PLATE_V] - y[:, slot.BLOCK_V]) ** 2
    taken = np.sum(np.where(overlap[:-1] > 0, 0.5 * (power[1:] + power[:-1]) * np.diff(paper.time_s), 0.0))
    before = 0.5 * body.block_mass_kg * SPEED**2
    after = (
        0.5 * body.block_mass_kg * y[-1, slot.BLOCK_V] ** 2
        + 0.5 * body.plate_mass_kg * y[-1, slot.PLATE_V] ** 2
        + 0.5 * body.plate_stiffness_n_per_m * y[-1, slot.PLATE_X] ** 2
    )
    assert before - after == pytest.approx(taken, rel=1e-3)
    assert taken > 1e-3 * before


def test_plate_arrives_swinging_as_asked():
    run = collide(-SPEED, plate_at_touch=(2e-6, -3e-3))
    at = np.searchsorted(run.time_s, run.touch_time_s)
    assert run.states[at, slot.PLATE_X] == pytest.approx(2e-6, rel=1e-5)
    assert run.states[at, slot.PLATE_V] == pytest.approx(-3e-3, rel=1e-5)


def test_a_block_that_moves_away_is_refused():
    with pytest.raises(ValueError, match="towards the plate"):
        collide(0.1)


def test_a_block_that_never_arrives_has_no_impact():
    run = collide(-SPEED, duration_s=1e-3)
    assert run.events == () and np.isnan(run.velocity_out_m_per_s)


def _run(text, bodies=None, **more):
    return collide(-SPEED, bodies=bodies, extra=force_slots(parse(text)), **more)


def _stored(y, bodies):
    """Return the energy in J of block and plate, and the overlap of the two in m."""
    bent = (
        0.5 * bodies.block_mass_kg * y[:, slot.BLOCK_V] ** 2
        + 0.5 * bodies.plate_mass_kg * y[:, slot.PLATE_V] ** 2
        + 0.5 * bodies.plate_stiffness_n_per_m * y[:, slot.PLATE_X] ** 2
    )
    return bent, np.maximum(y[:, slot.PLATE_X] - y[:, slot.BLOCK_X], 0.0)


def test_a_contact_whose_area_grows_gives_back_the_energy_of_its_law():
    bodies = Bodies(contact_damping_n_s_per_m=0.0)
    run = _run("contact_area:gain=0.5,overlap_m=1e-5", bodies, steps_s=(1e-6, 1e-5))
    bent, xi = _stored(run.states, bodies)
    # the integral of k xi (1 + a (1 - exp(-xi / l)))
    pressed = 1e4 * (1.5 * xi**2 / 2 - 0.5 * 1e-5 * (1e-5 - (xi + 1e-5) * np.exp(-xi / 1e-5)))
    assert np.ptp(bent + pressed) < 1e-6 * bent[0] < 1e-2 * np.ptp(pressed)


def test_a_magnet_repels_with_a_force_that_fades_over_its_range():
    bodies = Bodies(contact_damping_n_s_per_m=0.0)
    run = _run("magnet:force_n=5e-3,range_m=1e-3", bodies, steps_s=(1e-6, 1e-5))
    bent, xi = _stored(run.states, bodies)
    gap = np.maximum(run.states[:, slot.BLOCK_X] - run.states[:, slot.PLATE_X], 0.0)
    magnet = 5e-3 * (1e-3 * np.exp(-gap / 1e-3) + xi)  # overlapping, it stays what it is at the gap zero
    assert np.ptp(bent + 0.5 * 1e4 * xi**2 + magnet) < 1e-6 * bent[0] < 1e-2 * np.ptp(magnet)


def test_a_block_in_flight_is_not_moved_by_the_frame_that_it_is_seen_from():
    frame = Frame(QUIET, 0, Sines(np.array([1500.0]), np.array([1e-4]), np.array([0.4])))
    run = collide(-SPEED, frame=frame, duration_s=0.007)
    assert run.events == ()
    x, v = frame.motion(run.time_s)
    assert run.states[:, slot.BLOCK_X] + x == pytest.approx(2e-3 - SPEED * run.time_s, rel=0, abs=5e-10)
    assert run.states[:, slot.BLOCK_V] + v == pytest.approx(-SPEED, rel=0, abs=1e-6)
    plate = run.states[:, slot.PLATE_X] + x  # a spring on a shaken clamp, in its stationary motion
    w = np.sqrt(221.4 / 1.984e-4)
    answer = 1 / (1 - (1500.0 / w) ** 2)
    assert np.abs(plate - answer * x).max() < 0.02 * np.abs(answer * x).max()


def test_a_picked_up_mass_takes_its_share_of_the_momentum_once_on_the_way_out():
    run = _run("mass_jump:mass_kg=1e-4,position_m=1e-3")
    x, v = run.states[:, slot.BLOCK_X], run.states[:, slot.BLOCK_V]
    out = run.time_s > run.release_time_s
    assert v[out & (x < 1e-3)] == pytest.approx(run.velocity_out_m_per_s, rel=1e-12)
    assert v[out & (x > 1e-3 + 1e-12)] == pytest.approx(run.velocity_out_m_per_s * 17.85 / 17.95, rel=1e-12)
    assert run.velocity_in_m_per_s == -SPEED


def test_a_mass_picked_up_while_they_touch_takes_its_share_once_though_they_part_later():
    run = collide(-SPEED, extra={slot.JUMP_MASS: 1e-3, slot.JUMP_X: -1e-3})
    v, a = run.states[:, slot.BLOCK_V], run.acceleration_m_per_s2
    sudden = np.diff(v) - 0.5 * (a[1:] + a[:-1]) * np.diff(run.time_s)
    (at,) = np.flatnonzero(np.abs(sudden) > 1e-3)
    assert run.states[at, slot.BLOCK_X] == pytest.approx(-1e-3, abs=2e-6) and run.time_s[at] < run.release_time_s
    assert v[at + 1] / v[at] == pytest.approx(17.85 / 18.85, rel=1e-3)


def test_a_picked_up_mass_stays_on_the_block_that_a_spring_brings_back():
    run = collide(-SPEED, extra={slot.K_BEARING: 200.0, slot.JUMP_MASS: 2e-3, slot.JUMP_X: 1e-3})
    x, v, a = run.states[:, slot.BLOCK_X], run.states[:, slot.BLOCK_V], run.acceleration_m_per_s2
    jumped = int(np.flatnonzero((x > 1e-3) & (v > 0.0))[0])
    again = next(time for what, time in run.events if time > run.time_s[jumped])
    back = (run.time_s > run.time_s[jumped]) & (run.time_s < again) & (v < 0.0)
    assert np.count_nonzero(back) > 1000 and x[back].min() < 1e-3 < x[back].max()
    assert a[back] == pytest.approx(-200.0 * x[back] / 19.85e-3, rel=1e-9)


def test_a_drag_of_one_direction_drives_the_block_in_and_brakes_it_out():
    run = _run("asymmetric_drag:coefficient_n_s_per_m=1e-3")
    assert run.velocity_in_m_per_s == pytest.approx(-SPEED - 1e-3 * 2e-3 / 17.85e-3, rel=1e-9)
    out = run.time_s >= run.release_time_s
    fades = np.exp(-1e-3 / 17.85e-3 * (run.time_s[out] - run.release_time_s))
    assert run.states[out, slot.BLOCK_V] == pytest.approx(run.velocity_out_m_per_s * fades, rel=1e-9)


@pytest.mark.parametrize(("stribeck", "share"), [(SPEED, np.exp(-1.0)), (1e-3, 0.0), (1e3, 1.0)])
def test_bristles_slide_with_the_force_of_their_stribeck_curve(stribeck, share):
    """Once bent, they hold with F + (F_s - F) exp(-(v / v_s)^2)."""
    text = f"bristle_friction:force_n=1e-4,static_force_n=3e-4,stribeck_velocity_m_per_s={stribeck},deflection_m=5e-6"
    run = _run(text, distance_m=2e-3)
    bent = (run.time_s > 1e-3) & (run.time_s < 7e-3)
    force = Bodies().block_mass_kg * run.acceleration_m_per_s2[bent]
    assert force == pytest.approx(1e-4 + 2e-4 * share, rel=1e-3)
    begins = Bodies().block_mass_kg * run.acceleration_m_per_s2[0]
    assert begins == pytest.approx(0.0, abs=1e-9)  # not bent yet


def test_a_clamp_slips_by_the_force_beyond_its_threshold():
    run = _run("clamp_slip:threshold_n=0.1,mobility_m_per_n_s=1e-5", steps_s=(1e-6, 1e-5))
    y = run.states
    hold = 221.4 * (y[:, slot.PLATE_X] - y[:, slot.SLIP_X])
    beyond = np.where(np.abs(hold) > 0.1, hold - 0.1 * np.sign(hold), 0.0)
    slipped = np.concatenate(([0.0], np.cumsum(0.5 * (beyond[1:] + beyond[:-1]) * np.diff(run.time_s)))) * 1e-5
    assert y[:, slot.SLIP_X] == pytest.approx(slipped, abs=2e-3 * np.ptp(slipped))
    assert slipped.min() < -1e-8


def test_a_weaker_resonance_or_bristle_shortens_the_steps_that_must_resolve_it():
    """0.1 rad of the fastest oscillation a step, and a tenth of the bristles' bend."""

    def longest(text):
        run = _run(text, duration_s=0.05)
        steps = np.diff(run.time_s)
        touching = np.searchsorted([time for _, time in run.events], 0.5 * (run.time_s[1:] + run.time_s[:-1])) % 2 == 1
        return steps[touching].max(), steps[~touching].max()

    for name, more in (("block_mode", ",mass_kg=1e-4"), ("second_plate_mode", ""), ("support_compliance", "")):
        assert longest(f"{name}:frequency_hz=6000{more}") == pytest.approx([0.1 / (2 * np.pi * 6000)] * 2, rel=1e-6)
    assert longest("tilt") == pytest.approx([4e-6, 1e-5], rel=1e-6)
    assert longest("bristle_friction:deflection_m=5e-6") == pytest.approx([0.1 * 5e-6 / SPEED] * 2, rel=1e-6)
    assert longest("bristle_friction:deflection_m=1.5e-5") == pytest.approx([4e-6, 0.1 * 1.5e-5 / SPEED], rel=1e-6)


def test_a_block_that_friction_stops_is_refused():
    with pytest.raises(ValueError, match="more events"):
        _run("coulomb_friction:force_n=1.0")


def test_one_step_follows_a_force_that_is_cubic_in_time_exactly():
    """A step of fifth order has a path of fifth degree exactly, whatever its length."""
    p = np.zeros(slot.PARAMETERS)
    p[slot.M_BLOCK], p[slot.M_PLATE] = 2.0, 1.0
    a = np.polynomial.Polynomial([3.0, -5.0, 7.0, -4.0])
    drive = FrameAcceleration(0.8, a(0.8 * np.arange(4)), a.deriv()(0.8 * np.arange(4)))
    y, new, at, h = np.zeros(slot.STATES), np.empty(slot.STATES), 0.7, 1.5
    y[[slot.BLOCK_X, slot.BLOCK_V]] = 90.0, 2.0
    _step(y, at, h, p, np.zeros(slot.SWITCHES, np.int64), drive, np.empty((7, slot.STATES)), new)
    speed = -a.integ(1, lbnd=at)
    fallen = speed.integ(1, lbnd=at)(at + h)
    assert new[[slot.BLOCK_V, slot.PLATE_V]] == pytest.approx([2.0 + speed(at + h), speed(at + h)], rel=1e-12)
    assert new[[slot.BLOCK_X, slot.PLATE_X]] == pytest.approx([90.0 + 2.0 * h + fallen, fallen], rel=1e-12)


def test_a_start_within_reach_begins_with_that_force_and_no_event():
    run = _run("adhesion:force_n=5e-3,range_m=3e-3", distance_m=2e-3, duration_s=1e-4)
    assert run.time_s == pytest.approx(1e-5 * np.arange(11), rel=1e-9)
    assert run.acceleration_m_per_s2 == pytest.approx(-5e-3 / 17.85e-3, rel=1e-9)


def test_the_end_of_a_shot_is_its_last_node():
    run = collide(-SPEED, duration_s=0.0123456)
    assert run.time_s[0] == 0.0 and run.time_s[-1] == 0.0123456 and np.all(np.diff(run.time_s) > 0.0)
    assert run.states.shape == (run.time_s.size, slot.STATES)

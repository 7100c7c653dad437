"""The simulated collision against the reference solution, and its balance of energy and momentum."""

import numpy as np
import pytest

from instrument.bench import forces as slot
from instrument.bench.mechanics import Bodies, collide

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

"""The simulated rig and the analysis share no code and solve the same collision: they agree to rounding."""

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import Collision
from analysis.collision.solver import general
from instrument.bench.effects import CATALOGUE, draw
from instrument.bench.measured_path import simulate_collision
from instrument.bench.mechanics import Bodies, collide
from tests.bench.plate import plate_m

SPEED, DISTANCE_M = 0.265, 2e-3
BODIES = Bodies(18e-3, 2.1e-4, 230.0, 0.9e4, 0.45)
TIME = np.arange(0.0, 0.05, 1e-4)
FORCES = [name for name in CATALOGUE if effect_named(name).kernel is not None]


def _solved(effects, touch_s, velocity_in, plate=(0.0, 0.0)):
    """Return block, its velocity and plate as the analysis solves them, in the order of its own parameters."""
    # the two write the same law with another reference overlap: k xi (xi / 10 um)^d and k xi (xi / 50 um)^d
    stiffer = 5.0 ** effects.get("contact_exponent", {}).get("delta", 0.0)
    collision = Collision(18e-3, velocity_in, 230.0, 2.1e-4, 0.9e4 * stiffer, 0.45, *plate)
    acting = [
        general.ActiveEffect(row, tuple(values[p.name] for p in row.parameters))
        for row, values in ((effect_named(name), values) for name, values in effects.items())
    ]
    run = general.solve(collision, acting, TIME - touch_s)
    return run.displacement_m, run.velocity_m_per_s, run.plate_displacement_m


@pytest.mark.parametrize("name", FORCES)
def test_an_effect_moves_block_and_plate_as_the_analysis_solves_it(name):
    effects = {name: draw(name, np.random.default_rng(3))}
    run, plain = (simulate_collision(-SPEED, of, BODIES, DISTANCE_M, 0.06) for of in (effects, {}))
    # of an attraction over a distance the analysis counts from where the flight before it would have touched
    reached = name == "adhesion"
    touch_s, velocity_in = (DISTANCE_M / SPEED, -SPEED) if reached else (run.touch_time_s, run.velocity_in_m_per_s)
    x, v, plate = _solved(effects, touch_s, velocity_in)
    assert np.abs(run.block_m(TIME) - plain.block_m(TIME)).max() > 1e-8
    assert run.block_m(TIME) == pytest.approx(x, rel=0, abs=3e-12)
    assert run.block_velocity_m_per_s(TIME) == pytest.approx(v, rel=0, abs=1e-8)
    if name not in ("second_plate_mode", "support_compliance"):  # whose plates are measured from other places
        struck = run.release_time_s > TIME  # a plate that is free again matters no more to the analysis
        assert plate_m(run, TIME)[struck] == pytest.approx(plate[struck], rel=0, abs=1e-10)


def test_several_effects_act_at_once_and_on_a_plate_that_swings():
    effects = {
        name: draw(name, np.random.default_rng(seed))
        for seed, name in enumerate(("quadratic_drag", "block_mode", "cubic_stiffness", "nonlinear_contact_damping"))
    }
    plate = 3e-6, -4e-3
    run = simulate_collision(
        -SPEED, effects | {"plate_motion": {"displacement_m": plate[0], "velocity_m_per_s": plate[1]}}, BODIES,
        DISTANCE_M, 0.06,
    )  # fmt: skip
    at = np.searchsorted(run.time_s, run.touch_time_s)
    struck = run.states[at, 2], run.states[at, 3]
    assert struck == pytest.approx(plate, rel=0.1)
    x, _, _ = _solved(effects, run.touch_time_s, run.velocity_in_m_per_s, struck)
    assert run.block_m(TIME) == pytest.approx(x, rel=0, abs=1e-8)


def test_the_last_release_ends_the_force_of_the_contact():
    run = collide(-SPEED, bodies=BODIES, distance_m=DISTANCE_M)
    after = run.time_s > run.release_time_s
    assert np.all(run.acceleration_m_per_s2[after] == 0.0)
    assert run.states[after, 1] == pytest.approx(run.velocity_out_m_per_s, rel=1e-15)
    assert run.velocity_in_m_per_s == -SPEED and run.time_s[-1] == 0.06

"""Effects laid out for the solver, their fastest rates, and the parameters of a collision."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import KERNEL_ORDER, PAPER, Collision, Variant
from analysis.collision.solver import general, mechanical_effects
from analysis.collision.solver.mechanical_effects import (
    ActiveEffect,
    active_effects,
    build_system,
    chain_matrix,
    chain_rules,
    direction,
    fastest_rates,
)

LOCKED = replace(PAPER, plate_mass_kg=math.inf, plate_stiffness_n_per_m=0.0)


def test_a_collision_with_effects_is_laid_out_one_after_another() -> None:
    adhesion = ActiveEffect(effect_named("adhesion"), (2.0, 3.0))
    mode = ActiveEffect(effect_named("block_mode"), (4.0, 5.0, 6.0))
    arm = ActiveEffect(effect_named("viscoelastic_arm"), (7.0, 8.0))
    clocked = ActiveEffect(effect_named("frame_vibration_with_plate"), (9.0, 10.0, 11.0))
    drag = ActiveEffect(effect_named("viscous_drag"), (12.0,))
    which = [3, -1, direction(1, 2), direction(4, 0), direction(0, 1)]
    system = build_system(PAPER, [adhesion, mode, arm, clocked, drag], which)
    assert system.p.tolist() == [*PAPER.vector, *range(2, 13)] and system.p_complex.tolist() == system.p.tolist()
    assert system.which.tolist() == [3, -1, 8 + 2 + 2, 8 + 10, 8 + 1]
    # between the bodies, hidden states, shift, on the plate, rides, range, first parameter, rate
    assert system.slots.tolist() == [
        [1, 0, 0, 0, 0, 9, 8, -1],
        [0, 2, 0, 0, 1, -1, 10, -1],
        [0, 1, 0, 1, 0, -1, 13, -1],
        [0, 2, 1, 1, 0, -1, 15, 16],
        [0, 0, 0, 0, 0, -1, 18, -1],
    ]
    assert system.numbers == 4 + 2 * 4 and system.variant == 0
    assert build_system(replace(PAPER, variant=Variant.NO_TENSION), [drag], ()).numbers == 4
    assert build_system(replace(PAPER, variant=Variant.NO_TENSION), [drag], ()).variant == 2
    with pytest.raises(ValueError, match="sensor_drift does not act on the motion"):
        build_system(PAPER, [ActiveEffect(effect_named("sensor_drift"), (1.0,))], ())
    spring = effect_named("cubic_stiffness")
    assert mechanical_effects.function_of(spring, LOCKED) == (spring.locked, mechanical_effects.Acts.IN_CONTACT)
    assert mechanical_effects.function_of(spring, PAPER) == (spring.kernel, mechanical_effects.Acts.ON_PLATE)


def test_the_fastest_rates_are_those_of_block_contact_and_plate() -> None:
    c = PAPER
    mass = np.diag([c.block_mass_kg, c.plate_mass_kg])
    stiff = c.contact_stiffness_n_per_m * np.array([[1, -1], [-1, 1]]) + np.diag([0, c.plate_stiffness_n_per_m])
    exact = math.sqrt(np.linalg.eigvals(np.linalg.inv(mass) @ stiff).real.max())
    found = fastest_rates(c, [])
    assert exact <= found.contact < 1.02 * exact
    assert found.plate == pytest.approx(math.sqrt(c.plate_stiffness_n_per_m / c.plate_mass_kg))
    assert (found.effects, found.on_block) == (0.0, 0.0)
    damped = replace(c, contact_damping_n_s_per_m=100.0)
    assert fastest_rates(damped, []).contact == pytest.approx(100.0 * (1 / c.block_mass_kg + 1 / c.plate_mass_kg))
    arm, mode = (
        ActiveEffect(effect_named("viscoelastic_arm"), (1.0, 1e-4)),
        ActiveEffect(effect_named("block_mode"), (1e-3, 300.0, 0.01)),
    )
    both = fastest_rates(c, [arm, mode])
    assert (both.effects, both.on_block) == pytest.approx((1e4, 600 * math.pi))
    assert both.of_modes == pytest.approx(
        (math.hypot(both.contact, 1e4), math.hypot(both.plate, 1e4), both.on_block, 0.0)
    )
    stiffer = fastest_rates(c, [ActiveEffect(effect_named("contact_exponent"), (0.5,))]).contact
    assert stiffer == pytest.approx(math.sqrt(3.0 * found.contact**2 - 2.0 * found.plate**2))
    assert fastest_rates(LOCKED, []).plate == 0.0


def test_a_clocked_effect_is_given_what_its_clock_says_at_the_meeting() -> None:
    row, reach = effect_named("frame_vibration_with_plate"), effect_named("adhesion")
    given = {"amplitude_m_per_s": 1e-5, "frequency_hz": 80.0, "phase_rad": 0.4, "plate_factor": 0.6}
    values: Any = {row: given, reach: {"force_n": 1e-3, "range_m": 2e-3}, effect_named("tilt"): {"angle_rad": 1e-4}}

    def kernel(collision: Collision = PAPER, touch_s: float = 0.3, **changed: float) -> np.ndarray:
        distance = changed.pop("range_m", 2e-3)
        moved = {**values, row: given | changed, reach: {"force_n": 1e-3, "range_m": distance}}
        return np.array(active_effects([effect_named("tilt"), reach, row], moved, collision, touch_s)[2].values)

    early_s = 2e-3 / PAPER.velocity_in_m_per_s  # the bodies meet when the gap is the range
    alone = row.clocked(tuple(given.values()), *PAPER.vector[:2], 0.3 + early_s)  # type: ignore[misc]
    np.testing.assert_allclose(kernel(), alone)
    (chain,) = chain_rules([effect_named("tilt"), reach, row], values, PAPER, 0.3)
    assert chain.slot == 2
    changes = {
        "touch_time_s": lambda h: kernel(touch_s=0.3 + h),
        "plate_stiffness_n_per_m": lambda h: kernel(replace(PAPER, plate_stiffness_n_per_m=221.4 + h)),
        "plate_mass_kg": lambda h: kernel(replace(PAPER, plate_mass_kg=1.984e-4 + h)),
        "velocity_in_m_per_s": lambda h: kernel(PAPER.at_speed(PAPER.velocity_in_m_per_s + h)),
        "adhesion.range_m": lambda h: kernel(range_m=2e-3 + h),
    } | {f"{row.key}.{name}": lambda h, n=name: kernel(**{n: given[n] + h}) for name in given}
    assert set(chain.names) == set(changes)
    sizes = {"plate_mass_kg": 1e-4, "adhesion.range_m": 1e-3, f"{row.key}.amplitude_m_per_s": 1e-5}
    for name, slope in zip(chain.names, chain.slopes.T, strict=True):
        h = 1e-5 * sizes.get(name, 1.0)
        numeric = (changes[name](h) - changes[name](-h)) / (2 * h)
        rounding = 1e-14 * np.abs(kernel()) / h  # each of the three in a unit of its own
        assert np.all(np.abs(slope - numeric) <= 1e-4 * np.abs(slope) + rounding), name
    # laid out for the names that a shot has: what it does not have is left out, a plate's second name is its own
    names = ["plate_mass_kg.2", "touch_time_s", "other"]
    matrix = chain_matrix([chain], names, {"plate_mass_kg.2": 1})
    by = dict(zip(chain.names, chain.slopes.T, strict=True))
    expected = np.stack([by["plate_mass_kg"], by["touch_time_s"], np.zeros(3)], axis=1)
    np.testing.assert_array_equal(matrix, np.concatenate([np.eye(3), expected]))
    two = chain_matrix([chain, chain], ["other", "touch_time_s"], {})
    column = np.stack([np.zeros(3), by["touch_time_s"]], axis=1)
    np.testing.assert_array_equal(two, np.concatenate([np.eye(2), column, column]))


def test_of_two_ranges_the_longer_tells_when_the_bodies_begin_to_act() -> None:
    near, far = effect_named("adhesion"), replace(effect_named("adhesion"), name="other")
    values: Any = {
        near: {"range_m": 1e-3, "force_n": 9.0},
        far: {"range_m": 2e-3, "force_n": 1.0},
        effect_named("tilt"): {},
    }
    for rows in ([near, far], [far, effect_named("tilt"), near]):
        assert mechanical_effects._begin_of_interaction(rows, values, PAPER) == (
            2e-3 / PAPER.velocity_in_m_per_s,
            "other.range_m",
        )
    values[far]["range_m"] = 1e-3  # of two alike either
    assert mechanical_effects._begin_of_interaction([near, far], values, PAPER)[0] == 1e-3 / PAPER.velocity_in_m_per_s
    assert mechanical_effects._begin_of_interaction([effect_named("tilt")], values, PAPER) == (0.0, "")


def test_the_parameters_of_a_collision_have_their_limits() -> None:
    given = {name: getattr(PAPER, name) for name in KERNEL_ORDER}
    for name in ("block_mass_kg", "plate_mass_kg", "contact_stiffness_n_per_m"):
        with pytest.raises(ValueError, match=f"{name} must be positive, not 0"):
            Collision(**given | {name: 0.0})
    for name in ("plate_stiffness_n_per_m", "contact_damping_n_s_per_m"):
        assert getattr(Collision(**given | {name: 0.0}), name) == 0.0
        with pytest.raises(ValueError, match=f"{name} must not be negative, it is -1"):
            Collision(**given | {name: -1.0})
    with pytest.raises(ValueError, match="towards the plate"):
        replace(PAPER, velocity_in_m_per_s=-0.1, plate_velocity_m_per_s=-0.1)
    assert replace(PAPER, velocity_in_m_per_s=0.1, plate_velocity_m_per_s=0.2).vector[4] == 0.1
    assert LOCKED.contact_time_estimate_s == pytest.approx(math.pi * math.sqrt(17.85e-3 / 1e4))
    series = 1 / (1 / 221.4 + 1 / 1e4)
    assert PAPER.contact_time_estimate_s == pytest.approx(math.pi * math.sqrt((17.85e-3 + 1.984e-4) / series))


def test_means_over_blocks_leave_an_incomplete_one_out() -> None:
    columns = np.random.default_rng(1).standard_normal((17, 2))
    for some in (columns, columns[:, 0]):
        expected = [some[5 * k : 5 * k + 5].mean(axis=0) for k in range(3)]
        np.testing.assert_allclose(general.averaged(some, 5), expected)
    assert general.averaged(columns, 1) is columns


@pytest.mark.parametrize("variant", list(Variant))
def test_the_force_of_a_trajectory_is_what_moves_the_block(variant: Variant) -> None:
    time_s = np.arange(-200, 40000) * 1e-6
    run = general.solve(replace(PAPER, variant=variant), (), time_s)
    pushed = PAPER.block_mass_kg * np.gradient(run.velocity_m_per_s, time_s)
    near = np.abs(time_s[:, None] - [event.time_s for event in run.events]).min(axis=1) < 3e-6
    np.testing.assert_allclose(run.force_n[~near], pushed[~near], atol=1e-5 * run.force_n.max())
    released = [event.time_s for event in run.events if event.kind == "release"]
    assert run.released is not None and run.released.time_s == released[-1]
    last = general.solve(PAPER, (), time_s[time_s < 0.012])
    ends = [event.kind for event in last.events if event.kind in ("touch", "release")]
    assert (last.released is None) is (ends[-1] == "touch")
    assert general.solve(PAPER, (), np.array([-0.1, -0.05])).released is None


@pytest.mark.parametrize("times", [[[0.0, 1.0]], [], [0.0, 1.0], [1.0, 0.5, 2.0]])
def test_times_must_be_ascending_and_fill_a_block(times: Any) -> None:
    with pytest.raises(ValueError, match="one-dimensional, not empty and ascending"):
        general.solve(PAPER, (), np.array(times), block=3)


def test_the_only_release_is_the_last() -> None:
    run = general.solve(replace(LOCKED, contact_stiffness_n_per_m=200.0), (), np.array([0.0, 0.1]))
    assert [event.kind for event in run.events] == ["touch", "release"]
    assert run.released is not None and run.released.time_s == run.events[1].time_s

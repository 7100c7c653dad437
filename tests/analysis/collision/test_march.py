"""The solver, from mode to mode, against scipy's integration of the same bodies; in plain Python its limits as well."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import KERNEL_ORDER, Collision, Infeasible, Variant
from analysis.collision.solver import general, march, mechanical_effects, propagator, runge_kutta
from analysis.collision.solver.general import ActiveEffect, direction
from tests.analysis.collision.hybrid import Beside, Hybrid, moved
from tests.analysis.collision.plain import LINES_FOLLOWED, solver_in_python

RIG = Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3)
TIME_S = np.arange(-8, 150) * 2.5e-4 + 1.1e-4
PULL = (2e-3, 8e-5)


@pytest.fixture(autouse=LINES_FOLLOWED)
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Let the solver and the effects be called in plain Python."""
    solver_in_python(monkeypatch)
    return monkeypatch


def effects_of(beside: Beside) -> tuple[list[ActiveEffect], dict[str, int]]:
    """Return the catalogue's effects that are these, and the directions of their numbers."""
    out, at = [], {}
    if beside.mode:
        mass, omega, damping = beside.mode
        at |= {"mode.0": direction(0, 0), "mode.2": direction(0, 2)}
        out.append(ActiveEffect(effect_named("block_mode"), (mass, omega / (2 * np.pi), damping)))
    if beside.adhesion:
        at |= {f"adhesion.{k}": direction(len(out), k) for k in (0, 1)}
        out.append(ActiveEffect(effect_named("adhesion"), beside.adhesion))
    if beside.friction_n:
        at["friction_n"] = direction(len(out), 0)
        out.append(ActiveEffect(effect_named("coulomb_friction"), (beside.friction_n,)))
    if beside.cubic_n_per_m3:
        at["cubic_n_per_m3"] = direction(len(out), 0)
        out.append(ActiveEffect(effect_named("cubic_stiffness"), (beside.cubic_n_per_m3,)))
    return out, at


CASES = [
    (RIG, Beside()),
    (replace(RIG, variant=Variant.CLAMPED), Beside()),
    (replace(RIG, variant=Variant.NO_TENSION, contact_damping_n_s_per_m=2.5), Beside()),
    (replace(RIG, plate_displacement_m=2e-5, plate_velocity_m_per_s=0.02), Beside(friction_n=0.02)),
    (replace(RIG, variant=Variant.CLAMPED), Beside(adhesion=PULL, friction_n=0.02)),
    (RIG, Beside(mode=(2e-3, 900.0, 0.1))),
]
STEPPED = [*CASES, (RIG, Beside(cubic_n_per_m3=4e6))]


@pytest.mark.parametrize("place", range(len(CASES)))
def test_in_closed_form_it_is_scipys_solution_with_its_events_and_derivatives(place: int) -> None:
    check(*CASES[place], KERNEL_ORDER[:7])


@pytest.mark.parametrize("place", range(2, len(STEPPED)))
def test_step_by_step_it_is_scipys_solution_too(place: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    check(*STEPPED[place], ("contact_stiffness_n_per_m", "velocity_in_m_per_s"))


def check(collision: Collision, beside: Beside, by: Sequence[str], time_s: np.ndarray = TIME_S) -> None:
    """Compare states, events and derivatives with those of the same bodies integrated by scipy."""
    effects, at = effects_of(beside)
    wanted = {name: KERNEL_ORDER.index(name) for name in by} | at
    run = general.solve(collision, effects, time_s, directions=list(wanted.values()))
    exact = Hybrid(collision, beside)
    states = exact.solved(time_s)
    kinds = [kind for kind, *_ in exact.events if kind != "apart" and (effects or kind != "turn")]
    times = np.array([t for kind, t, _ in exact.events if kind in kinds])
    assert [event.kind for event in run.events] == kinds
    np.testing.assert_allclose([event.time_s for event in run.events], times, atol=1e-11)
    assert np.abs(run.displacement_m - states[:, 0]).max() < 1e-12
    assert np.abs(run.velocity_m_per_s - states[:, 1]).max() < 1e-9
    met = np.isfinite(states[:, 2]) & ((times[-1] > time_s) | (beside.cubic_n_per_m3 == 0.0))  # then it rings by itself
    assert np.abs(run.plate_displacement_m - states[:, 2])[met].max() < 1e-11
    assert np.abs(run.plate_velocity_m_per_s - states[:, 3])[met].max() < 1e-7
    for column, name in enumerate(wanted):
        size = abs(value_of(collision, beside, name)) or {"plate_displacement_m": 1e-5}.get(name, 0.1)
        ahead, back = (Hybrid(*moved(collision, beside, name, sign * 1e-4 * size)) for sign in (1, -1))
        difference = (ahead.solved(time_s)[:, 0] - back.solved(time_s)[:, 0]) / 2e-4
        found = run.displacement_derivatives[:, column] * size
        assert np.abs(found - difference).max() < 2e-5 * np.abs(difference).max(), name
        both = [(a, b) for a, b in zip(ahead.events, back.events, strict=True) if a[0] in kinds]
        for event, (a, b) in zip(run.events, both, strict=True):
            np.testing.assert_allclose(event.state[:4], 0.5 * (a[2] + b[2]), rtol=1e-5, atol=1e-7, err_msg=event.kind)
            of_state = event.state_derivatives[column, :4] * size
            np.testing.assert_allclose(of_state, (a[2] - b[2]) / 2e-4, rtol=1e-3, atol=2e-6, err_msg=event.kind)


def value_of(collision: Collision, beside: Beside, name: str) -> float:
    """Return the number that ``moved`` would change."""
    plain, _, place = name.partition(".")
    value: Any = getattr(collision if hasattr(collision, plain) else beside, plain)
    return float(value[int(place)] if place else value)


@pytest.mark.parametrize("place", [0, 4])
def test_times_may_lie_on_one_side_of_the_touch_alone(place: int) -> None:
    collision, beside = CASES[place]
    check(collision, beside, KERNEL_ORDER[2:3], TIME_S[TIME_S > 0.0])
    for early in (TIME_S[TIME_S < -3e-4], TIME_S[:1]):
        run = general.solve(collision, effects_of(beside)[0], early, directions=[4])
        np.testing.assert_allclose(run.displacement_m, Hybrid(collision, beside).solved(early)[:, 0], atol=1e-12)
        ahead, back = (
            Hybrid(*moved(collision, beside, "velocity_in_m_per_s", sign * 1e-5)).solved(early)[:, 0]
            for sign in (1, -1)
        )
        np.testing.assert_allclose(run.displacement_derivatives[:, 0], (ahead - back) / 2e-5, rtol=1e-6)


def test_of_two_attractions_the_one_that_reaches_further_begins() -> None:
    """Each ends and begins at its own range, on the way in as on the way out."""
    pulls = [ActiveEffect(effect_named("adhesion"), (force, reach)) for force, reach in ((3e-3, 4e-5), (2e-3, 8e-5))]
    run, other = (general.solve(RIG, order, TIME_S, directions=[4]) for order in (pulls, pulls[::-1]))
    np.testing.assert_allclose(run.displacement_m, other.displacement_m, atol=1e-15)
    assert [event.kind for event in run.events] == [event.kind for event in other.events]
    assert [event.kind for event in run.events[:2]] == ["range", "touch"]
    inside, touch = run.events[0], run.events[1]
    assert inside.state[0] - inside.state[2] == pytest.approx(4e-5, rel=1e-9)
    # from the further range on the block is pulled by the further attraction alone, until the nearer joins
    begin = 8e-5 / RIG.velocity_in_m_per_s
    gone = inside.time_s - begin
    plate = 0.5 * 2e-3 / RIG.plate_mass_kg * gone**2
    assert inside.state[0] == pytest.approx(8e-5 - 0.3 * gone - 0.5 * 2e-3 / RIG.block_mass_kg * gone**2, abs=1e-12)
    assert inside.state[2] == pytest.approx(plate, rel=1e-3)
    assert touch.time_s < 0.0 and [event.kind for event in run.events[-2:]] == ["range", "range"]


@pytest.mark.parametrize("names", [(), ("block_mode", "adhesion", "tilt")])
@pytest.mark.parametrize("count", [0, 4])
def test_the_room_of_a_solution_is_what_its_arrays_take(
    count: int, names: tuple[str, ...], plain: pytest.MonkeyPatch
) -> None:
    """But for a row of a state, which either stepper may leave."""
    effects = [
        ActiveEffect(effect_named(name), tuple(p.scale for p in effect_named(name).parameters)) for name in names
    ]
    laid = mechanical_effects.build_system(RIG, effects, list(range(count)))
    record = general._record(TIME_S, 1, laid, 5)
    room, taken = march.room_for(laid, record), []
    plain.setattr(march, "march", lambda *_: 0)
    for module in (propagator, runge_kutta):
        made = module.stepper_of

        def noted(*given: Any, made: Any = made) -> Any:
            stepper, at = made(*given)
            taken.append(at)
            return stepper, at

        plain.setattr(module, "stepper_of", noted)
    assert march.in_closed_form(laid, record, np.zeros(5), np.zeros(room)) == 0
    limits = np.zeros(13)
    assert march.step_by_step(laid, record, limits, np.zeros(room)) == 0
    spare = 2 * record.event_state.shape[1] + 3
    assert room - spare - 8 <= taken[0] <= room


@pytest.mark.parametrize("stepper", ["in_closed_form", "step_by_step"])
def test_a_solution_that_does_not_end_says_why(stepper: str, plain: pytest.MonkeyPatch) -> None:
    if stepper == "step_by_step":
        plain.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    few = TIME_S[:60]
    plain.setattr(march, "MAX_STEPS", 10.0)
    plain.setattr(march, "MAX_STEPS_PER_SAMPLE", 0.0)
    with pytest.raises(Infeasible, match="more steps"):
        general.solve(RIG, [], few, directions=[0])
    plain.setattr(march, "MAX_STEPS_PER_SAMPLE", 1e4)
    plain.setattr(march, "MAX_EVENTS", 1)
    with pytest.raises(Infeasible, match="contact events"):
        general.solve(RIG, [], TIME_S[:100])
    heavy = ActiveEffect(effect_named("block_mode"), (1.5 * RIG.block_mass_kg, 100.0, 0.1))
    with pytest.raises(Infeasible):
        general.solve(RIG, [heavy], few)


@pytest.mark.parametrize("place", [0, 5])
@pytest.mark.parametrize("block", [2, 4])  # of four a mode may swing within the mean
def test_means_are_those_of_scipys_solution(block: int, place: int) -> None:
    collision, beside = CASES[place]
    effects, _ = effects_of(beside)
    time_s = TIME_S[:-3]  # the last is left out
    states = general.averaged(Hybrid(collision, beside).solved(time_s), block)
    sizes = np.array([3e3, 0.3])
    ahead, back = (
        [Hybrid(*moved(collision, beside, name, sign * 1e-4 * size)).solved(time_s)[:, 0] for name, size in by]
        for sign in (1, -1)
        for by in [zip(("contact_stiffness_n_per_m", "velocity_in_m_per_s"), sizes, strict=True)]
    )
    slopes = general.averaged(np.stack([(a - b) / 2e-4 for a, b in zip(ahead, back, strict=True)], axis=1), block)
    for directions in ((), (2, 4)):
        run = general.solve(collision, effects, time_s, directions=directions, block=block)
        assert run.time_s.size == time_s.size // block
        np.testing.assert_allclose(run.time_s, general.averaged(time_s, block), atol=1e-15)
        assert np.abs(run.displacement_m - states[:, 0]).max() < 1e-12
        assert np.abs(run.velocity_m_per_s - states[:, 1]).max() < 1e-9
        met = np.isfinite(states[:, 2])
        assert np.abs(run.plate_displacement_m - states[:, 2])[met].max() < 1e-11
        if directions:
            found = run.displacement_derivatives * sizes
            assert np.all(np.abs(found - slopes).max(axis=0) < 2e-5 * np.abs(slopes).max(axis=0))


def test_times_may_be_far_apart_or_anywhere() -> None:
    """Several steps to a sample, and steps of any length."""
    check(*CASES[5], KERNEL_ORDER[2:3], np.arange(-2, 48) * 8e-4 + 1e-4)
    anywhere = np.sort(np.random.default_rng(5).uniform(-2e-3, 0.036, 60))
    check(*CASES[2], KERNEL_ORDER[4:5], anywhere)

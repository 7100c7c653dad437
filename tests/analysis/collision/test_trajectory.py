"""A solved collision as it is given to others: its forces, events and means; what bounds the stepper's steps."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.effects.row import Effect
from analysis.collision.parameters import PAPER, Collision, Infeasible, Variant
from analysis.collision.solver import general, march
from analysis.collision.solver.general import Event, EventLog, Trajectory
from analysis.collision.solver.mechanical_effects import ActiveEffect, FastestRates
from analysis.collision.solver.runge_kutta import ALLOWED, EFFECTS, GROWTH, NEARING, SAFE, SHORTEST, SWINGS

RIG = Collision(1.0, -1.0, 1.0, 1.0, 10.0, 3.0)


def log_of(*events: tuple[str, float]) -> EventLog:
    kinds = tuple(kind for kind, _ in events)
    count = len(events)
    record: Any = SimpleNamespace(
        event_time=np.array([time for _, time in events]), event_state=np.arange(6.0 * count).reshape(count, 6),
        event_d_state=np.arange(12.0 * count).reshape(count, 2, 6),
    )  # fmt: skip
    return EventLog(kinds, record)


def trajectory(log: EventLog, collision: Collision = RIG) -> Trajectory:
    time_s = np.array([-0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.5])
    x, y = np.full(8, -0.2), np.full(8, 0.1)
    v, u = np.full(8, 0.5), np.full(8, 0.7)
    return Trajectory(collision, x, v, y, u, y + 0.05, np.zeros((8, 0)), log, time_s)


def test_the_force_is_that_of_spring_and_dashpot_while_they_act() -> None:
    spring, dash = 10.0 * 0.35, 3.0 * 0.2
    both = trajectory(log_of(("touch", 0.0), ("release", 1.0), ("touch", 2.0), ("release", 3.0)))
    np.testing.assert_allclose(both.gap_m, -0.35)
    np.testing.assert_allclose(both.force_n, np.array([0, 1, 1, 0, 0, 1, 1, 0]) * (spring + dash))
    clamped = trajectory(log_of(("touch", 0.0), ("damping_off", 0.5), ("damping_on", 1.5), ("release", 2.5)))
    forces = [0.0, spring + dash, spring, spring, spring + dash, spring + dash, 0.0, 0.0]
    np.testing.assert_allclose(clamped.force_n, forces)


def test_events_are_those_that_change_the_motion_with_their_derivatives() -> None:
    log = log_of(("touch", 0.0), ("release", 1.0), ("apart", 1.2), ("touch", 2.0), ("turn", 2.2), ("release", 3.0))
    run = trajectory(log)
    assert [(event.kind, event.time_s) for event in run.events] == [
        ("touch", 0.0), ("release", 1.0), ("touch", 2.0), ("turn", 2.2), ("release", 3.0),
    ]  # fmt: skip
    third = run.events[2]
    np.testing.assert_array_equal(third.state, 18.0 + np.arange(6))
    np.testing.assert_array_equal(third.state_derivatives, [36.0 + np.arange(6), 42.0 + np.arange(6)])
    last = run.released
    assert isinstance(last, Event) and last.time_s == 3.0
    assert trajectory(log_of(("touch", 0.0), ("release", 1.0), ("touch", 2.0), ("turn", 2.5))).released is None
    assert trajectory(log_of(("turn", 0.0))).released is None
    ranged = trajectory(log_of(("touch", 0.0), ("release", 1.0), ("range", 2.0))).released
    assert ranged is not None and ranged.time_s == 1.0


def test_kinds_of_events_have_their_names() -> None:
    names = {1: "touch", 31: "touch", 10: "release", 13: "release", 20: "release", 12: "damping_off", 21: "damping_on"}
    names |= {30: "apart", march.TURN: "turn", march.RANGE: "range", march.RANGE + 3: "range"}
    assert {code: general._kind(code) for code in names} == names


def test_means_are_over_whole_blocks() -> None:
    values = np.arange(7.0)
    assert general.averaged(values, 1) is values
    np.testing.assert_allclose(general.averaged(values, 3), [1.0, 4.0])
    np.testing.assert_allclose(
        general.averaged(np.stack([values, -values], axis=1), 2), [[0.5, -0.5], [2.5, -2.5], [4.5, -4.5]]
    )


@pytest.mark.parametrize("stride", [1.0, 2.0])
def test_steps_are_bounded_by_the_fastest_oscillation_of_each_mode(stride: float) -> None:
    """A seventh of a radian of the bodies, a fifth of an effect's own, a millisecond at most."""
    rates = FastestRates(bodies=2000.0, contact=2000.0, plate=1000.0, effects=5000.0, on_block=500.0)
    smooth = ActiveEffect(effect_named("viscous_drag"), (1.0,))
    limits = general._limits(rates, [smooth], stride)
    own = 0.22 / 5000.0
    safe = [stride * min(0.14 / 2000.0, own), stride * min(0.14 / 1000.0, own), stride * 0.22 / 500.0, 1e-3]
    np.testing.assert_allclose(limits[SAFE : SAFE + 4], safe)
    np.testing.assert_allclose(limits[SWINGS : SWINGS + 4], rates.of_modes)
    assert limits[EFFECTS] == pytest.approx(stride * own) and limits[ALLOWED] == pytest.approx(1e-18 * stride**12)
    assert (limits[GROWTH], limits[NEARING], limits[SHORTEST]) == (3.0, 0.0, 1e-4)
    fast = general._limits(FastestRates(9000.0, 9000.0, 1.0, 0.0, 0.0), [], stride)
    np.testing.assert_allclose(fast[SAFE : SAFE + 4], [stride * 0.14 / 9000.0, 1e-3, 1e-3, 1e-3])
    rough = general._limits(rates, [smooth, ActiveEffect(effect_named("contact_exponent"), (0.1,))], stride)
    assert (rough[GROWTH], rough[NEARING], rough[SHORTEST]) == (1.6, 0.4, 1e-8)
    corner: Any = replace(effect_named("viscous_drag"), kinked=True)
    assert isinstance(corner, Effect)
    kinked = general._limits(rates, [ActiveEffect(corner, (1.0,))], stride)
    np.testing.assert_allclose(kinked, general._limits(rates, [smooth], 1.0))
    np.testing.assert_allclose(general._limits(rates, [ActiveEffect(corner, (1.0,))], 0.5)[SAFE], 0.5 * own)


def test_times_are_one_row_that_rises(monkeypatch: pytest.MonkeyPatch) -> None:
    for times in (np.zeros((2, 2)), np.array([]), np.array([0.0, 0.2, 0.1])):
        with pytest.raises(ValueError, match="ascending"):
            general.solve(PAPER, (), times)
    with pytest.raises(ValueError, match="not empty"):
        general.solve(PAPER, (), np.array([0.0, 0.1]), block=3)
    exact = general.solve(PAPER, (), np.array([0.03])).displacement_m[0]
    for times in ([0.0, 0.0, 0.03], [0.03, 0.03], [0.02, 0.02 + 1e-9, 0.03], [0.03 - 1e-10, 0.03]):
        assert general.solve(PAPER, (), np.array(times)).displacement_m[-1] == pytest.approx(exact, abs=1e-12)
    for code, words in (
        (march.TOO_MANY_EVENTS, "more than 400 contact events$"),
        (march.TOO_MANY_STEPS, "more steps than a solution may take$"),
        (march.UNBOUNDED, "grows without bound$"),
    ):
        monkeypatch.setattr(march, "in_closed_form", lambda *_, code=code: code)
        with pytest.raises(Infeasible, match=words):
            general.solve(PAPER, (), np.array([0.0]))


def test_what_is_known_to_be_nonlinear_is_not_tried_in_closed_form(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(march, "in_closed_form", lambda *_: asked.append("closed") or march.NOT_LINEAR)
    monkeypatch.setattr(march, "step_by_step", lambda *given: asked.append("steps") or 0)
    plain, known = effect_named("viscous_drag"), replace(effect_named("viscous_drag"), nonlinear=True)
    for effect, order in ((plain, ["closed", "steps"]), (known, ["steps"])):
        asked.clear()
        general.solve(PAPER, [ActiveEffect(effect, (1.0,))], np.array([0.0]))
        assert asked == order


@pytest.mark.parametrize("name", [None, "block_mode"])
def test_whole_states_are_recorded_with_modes(name: str | None) -> None:
    """The same motion as solved for its means, and every number of the hidden state."""
    effects = [] if name is None else [ActiveEffect(effect_named(name), (1e-3, 200.0, 0.05))]
    time_s = np.arange(-100, 3000) * 1e-5
    kept = general.solve_with_modes(replace(PAPER, variant=Variant.CLAMPED), effects, time_s, 1e-5)
    run = general.solve(replace(PAPER, variant=Variant.CLAMPED), effects, time_s)
    columns = [run.displacement_m, run.velocity_m_per_s, run.plate_displacement_m, run.plate_velocity_m_per_s]
    columns.append(run.contact_point_m)
    np.testing.assert_allclose(kept.states[:, :5], np.stack(columns, axis=1), atol=1e-13)
    assert kept.states.shape == (time_s.size, 5 if name is None else 7)
    assert [general._kind(int(kind)) for kind in kept.event_kind] == list(run.log.kinds)
    np.testing.assert_allclose(kept.event_time, [event.time_s for event in run.events], atol=1e-15)
    assert kept.event_mode.shape[0] == kept.event_kind.size and kept.event_state.shape[1] == kept.states.shape[1] - 1
    if name is not None:
        q, w = kept.states[:, 5], kept.states[:, 6]
        np.testing.assert_allclose(np.gradient(q, time_s)[200:-2], w[200:-2], atol=2e-3 * np.abs(w).max())

"""Small changes along a path, in plain Python: those of the starting speed and those that effects make."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from analysis.collision import (
    acting,
    crossings,
    exponentials,
    first_order,
    general,
    linear_coefficients,
    linearisation,
    march,
    matrices,
    modes,
    on_moving_frame,
    path_matrices,
    propagator,
    rates,
    runge_kutta,
    system,
    two_bodies,
)
from analysis.collision.effects import named
from analysis.collision.effects.kernel import STATES
from analysis.collision.general import Active
from analysis.collision.linearisation import LinearPath, linear_path
from analysis.collision.parameters import Collision, Infeasible, Variant
from tests.analysis.collision.hybrid import Beside, Hybrid
from tests.analysis.collision.plain import made_plain

RIG = Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3)
TIME_S = np.arange(-6, 120) * 2.5e-4 + 1.1e-4


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Let path and effects be called in plain Python."""
    made_plain(
        monkeypatch, crossings, exponentials, first_order, linear_coefficients, linearisation, march, matrices, modes,
        on_moving_frame, path_matrices, propagator, rates, runge_kutta, system, two_bodies,
    )  # fmt: skip
    functions: list[Any] = []

    def numbered(function: Any) -> int:
        functions.append(function)
        return len(functions) - 1

    def within(number: int, s: Any, p: Any, first: int) -> None:
        functions[int(number)](s, p[first:], s[STATES:])

    monkeypatch.setattr(acting, "address", numbered)
    monkeypatch.setattr(acting, "complex_address", numbered)
    monkeypatch.setattr(first_order, "address", numbered)
    monkeypatch.setattr(rates, "call_within", within)
    monkeypatch.setattr(linear_coefficients, "call", lambda number, s, p, out: functions[int(number)](s, p, out))
    yield monkeypatch


def carried(path: LinearPath, begin: np.ndarray, samples: int) -> np.ndarray:
    """Return the change of the block's place that a change of the state at the first touch leads to."""
    out, d = np.full(samples, np.nan), begin.copy()
    for r in range(path.size):
        if path.early[r]:
            continue
        if not path.linked[r]:
            d = d + path.kick[r] * (path.watch[r, :-1] @ d)
        d = path.propagator[r] @ d
        if path.sample[r] >= 0:
            out[path.sample[r]] = d[0]
    return out


CASES: list[tuple[Collision, list[Active]]] = [
    (RIG, []),
    (Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3, variant=Variant.CLAMPED), []),
    (Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 2.5, variant=Variant.NO_TENSION), []),
    (RIG, [Active(named("support_compliance"), (2e-4, 150.0)), Active(named("coulomb_friction"), (0.02,))]),
    (RIG, [Active(named("quadratic_drag"), (0.05,))]),
]


@pytest.mark.parametrize("place", range(len(CASES)))
def test_a_change_of_the_speed_is_carried_as_the_solver_differentiates_it(place: int) -> None:
    collision, active = CASES[place]
    path = linear_path(collision, active, TIME_S)
    exact = general.solve(collision, active, TIME_S, directions=[4]).displacement_derivatives[:, 0]
    begin = np.zeros(path.propagator.shape[1])
    begin[1] = 1.0
    found = carried(path, begin, TIME_S.size)
    after = TIME_S > 0.0
    assert np.isnan(found[~after]).all()
    assert np.abs(found - exact)[after].max() < 3e-6 * np.abs(exact).max()


SMALL = {
    "coulomb_friction": (1e-6,), "quadratic_drag": (1e-6,), "bearing_gradient": (1e-5,), "plate_damping": (1e-7,),
    "nonlinear_contact_damping": (1e-3,), "block_mode": (1e-9, 120.0, 0.1), "viscoelastic_arm": (1e-6, 4e-3),
    "support_compliance": (1e-11, 150.0), "second_plate_mode": (1e6, 120.0, 0.1),
}  # fmt: skip


@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize("name", list(SMALL))
def test_a_small_effect_does_what_the_solver_differentiates(name: str, place: int) -> None:
    """At two starts at once, of which one is twice the other."""
    collision, active = CASES[place]
    if any(one.effect.name == name for one in active):
        return
    row, values = named(name), SMALL[name]
    steps = first_order.steps_for(row, values, collision, 2.5e-4)
    path = linear_path(collision, active, TIME_S, steps)
    parameters = np.zeros((2, 3))
    parameters[:, : len(values)] = values
    parameters[1, 0] *= 2.0
    found = first_order.along(path, row, collision, parameters, TIME_S.size)
    assert found is not None
    none = values[0] / 1e-3 if row.inverse else 1e-13 * values[0]  # a heavy mode does little
    beside = sorted([*active, Active(row, (none, *values[1:]))], key=lambda one: one.effect.hidden == 0)
    slot = [one.effect.name for one in beside].index(name)
    run = general.solve(collision, beside, TIME_S, directions=[general.direction(slot, 0)])
    exact = run.displacement_derivatives[:, 0] * (-(none**2) / values[0] if row.inverse else values[0])
    scale = np.abs(exact).max()
    assert np.abs(found[:, 0] - exact).max() < 2e-4 * scale
    np.testing.assert_allclose(found[:, 1], (0.5 if row.inverse else 2.0) * found[:, 0], atol=1e-7 * scale)


def test_what_cannot_be_followed_to_first_order_has_no_answer() -> None:
    path = linear_path(RIG, [], TIME_S)
    assert first_order.along(path, named("adhesion"), RIG, np.ones((1, 3)), TIME_S.size) is None
    assert first_order.along(path, named("sensor_drift"), RIG, np.ones((1, 3)), TIME_S.size) is None
    with pytest.raises(Infeasible, match="too fast"):
        linear_path(Collision(0.02, -0.3, 300.0, 2e-3, 3e7, 0.3), [], TIME_S)


@pytest.mark.parametrize(("turns", "steps"), [(0.49, 1), (0.51, 2), (0.99, 2), (1.01, 4), (4.1, 16)])
def test_a_sample_is_divided_into_a_power_of_two_steps_of_half_a_radian(turns: float, steps: int) -> None:
    row = named("block_mode")
    rate = row.fastest(np.array([1e-5, 100.0, 0.01]), RIG)
    assert first_order.steps_for(row, (1e-5, 100.0, 0.01), RIG, turns / rate) == steps


@pytest.mark.parametrize("hidden", [0, 2])
def test_the_rooms_of_path_and_march_are_what_their_arrays_take(hidden: int, plain: pytest.MonkeyPatch) -> None:
    taken: list[int] = []

    def noting(cut: Any) -> Any:
        def noted(room: Any, at: int, shape: Any) -> Any:
            array, end = cut(room, at, shape)
            taken.append(end)
            return array, end

        return noted

    plain.setattr(path_matrices, "cut", noting(path_matrices.cut))
    plain.setattr(first_order, "cut", noting(first_order.cut))
    plain.setattr(first_order, "cut_integers", noting(first_order.cut_integers))
    active = CASES[3][1][:1] if hidden else []
    path = linear_path(RIG, active, TIME_S)
    n = path.propagator.shape[1]
    room = path_matrices.room_for(n)
    # a state is padded to a multiple of four numbers
    assert room - 2 * 4 * (n + 8) <= max(taken) <= room
    taken.clear()
    for count in (1, 5):
        parameters = np.tile([1e-9, 120.0, 0.1], (count, 1))
        first_order.along(path, named("block_mode"), RIG, parameters, TIME_S.size)
        room = first_order._room_for(n, count)
        assert room - 20 - 4 * count <= max(taken) <= room


@pytest.mark.parametrize("place", [0, 1])
def test_what_a_moving_frame_adds_is_what_scipys_solution_differs_by(place: int) -> None:
    """At two frequencies, as cosine and as sine; before the touch the block alone flies on in space."""
    collision, _ = CASES[place]
    omega = np.array([150.0, 700.0])
    path = linear_path(collision, [], TIME_S)
    shown, after = on_moving_frame.moved_by_frame(path, collision, omega, TIME_S.size)
    assert shown.shape == (TIME_S.size, 4) and after.shape == (4,)
    touched = TIME_S > 0.0
    for column, (rate, turn) in enumerate([(rate, turn) for turn in (0.0, -np.pi / 2) for rate in omega]):
        size = 1e-9
        ahead, back = (Hybrid(collision, Beside(frame=(sign * size, rate, turn))) for sign in (1, -1))
        exact = (ahead.solved(TIME_S) - back.solved(TIME_S)) / (2 * size)
        scale = np.abs(exact[touched, 0]).max()
        assert np.abs(shown[:, column] - exact[:, 0])[touched].max() < 2e-4 * scale
        alone = np.cos(turn) - rate * TIME_S * np.sin(turn) - np.cos(rate * TIME_S + turn)
        np.testing.assert_allclose(shown[~touched, column], alone[~touched], atol=1e-6)
        when = ahead.events[-1][1]
        at = np.array([when + 1e-5, when + 5e-4])  # free, in the frame's coordinates: faster as the frame is slower
        (begin, end) = (Hybrid(collision, one.beside).solved(at)[:, 1] for one in (ahead, back))
        in_space = (begin - end) / (2 * size) - rate * np.sin(rate * at + turn)
        np.testing.assert_allclose(in_space, after[column], atol=3e-4 * np.abs(after).max())

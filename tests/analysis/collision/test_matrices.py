"""The matrices of a linear mode, written out; and whatever is not linear in the state, or in a derivative, is seen."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects.kernel import ON_BLOCK, ON_PLATE, OUTPUTS, STATES, V, X
from analysis.collision.solver import matrices, modes, rates, system
from analysis.collision.solver.matrices import ModeMatrices
from analysis.collision.solver.modes import CONTACT, FREE, NEAR_0, PLATE, RANGE_0
from analysis.collision.solver.system import FIRST, RANGE_AT, RATE_AT, SLOT_COLUMNS, System
from tests.analysis.collision.plain import made_plain

K_P, M_P, K_N, GAMMA, M_B, REACH = 7.0, 0.5, 11.0, 2.5, 4.0, 0.25
OWN = (0.8, REACH)


def laid_out(function: Callable[..., None] | None, which: list[int], first: float = OWN[0]) -> System:
    p = np.array([K_P, M_P, K_N, GAMMA, -1.0, 0.0, 0.0, M_B, first, REACH])
    slots = np.zeros((0 if function is None else 1, SLOT_COLUMNS))
    slots[:, FIRST], slots[:, RATE_AT], slots[:, RANGE_AT] = 8, -1, 9
    inputs, functions = np.zeros(STATES + OUTPUTS), np.array([[function], [function]])
    return System(p, slots, functions, np.array(which), 0, 4, inputs, p.astype(complex), inputs.astype(complex))


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    made_plain(monkeypatch, matrices, rates, modes, system)

    def called(function: Callable[..., None], s: Any, p: Any, first: int) -> None:
        function(s, p[first:], s[STATES:])

    monkeypatch.setattr(rates, "call_within", called)


def learned(made: System, phase: int = CONTACT, plate: float = 1.0) -> ModeMatrices | None:
    """Return the matrices of a mode, or None where it is not linear."""
    count, guards = made.which.size, RANGE_0 + made.slots.shape[0]
    room = np.full(100_000, np.nan)
    stored, at = matrices.forms_of(2, 4, count, guards, 5, room, 0)
    every = np.array([-1] * 4 + list(made.which))
    plain, _ = system.state_of(5 + count, 4, room, at)
    form = matrices.form_at(stored, 1)
    mode = np.zeros(NEAR_0 + made.slots.shape[0])
    mode[PLATE] = plate
    modes.set_phase(phase, mode)
    return form if matrices.linearise(form, plain, every, made, mode) else None


def drag(s: Any, p: Any, out: Any) -> None:
    """Push the block as its speed says, and the plate evenly."""
    out[ON_BLOCK] -= p[0] * s[V]
    out[ON_PLATE] += 3.0


def test_a_mode_is_the_equations_of_two_bodies_and_what_acts_beside_them() -> None:
    form = learned(laid_out(drag, [0, 1, 2, 3, 8, 5]))
    assert form is not None
    xi, rate = np.array([-1.0, 0, 1, 0, 0]), np.array([0.0, -1, 0, 1, 0])
    force = K_N * xi + GAMMA * rate
    unit = np.eye(5)
    block, plate = force - OWN[0] * unit[1], 3.0 * unit[4] - force - K_P * unit[2]
    np.testing.assert_allclose(form.a, [unit[1], block / M_B, unit[3], plate / M_P, np.zeros(5)], atol=1e-15)
    nothing = np.zeros(5)
    for k, (of_block, of_plate) in enumerate(
        (
            (nothing, -unit[2]), (nothing, -plate / M_P), (xi, -xi), (rate, -rate), (-unit[1], nothing),
            (nothing, nothing),
        )
    ):  # fmt: skip
        expected = [nothing, of_block / M_B, nothing, of_plate / M_P, nothing]
        np.testing.assert_allclose(form.by[:, :, 1 + k], expected, atol=1e-14, err_msg=str(k))
    guards = np.array([xi, rate, force, unit[1], xi + REACH * unit[4]])
    np.testing.assert_allclose(form.guard, guards, atol=1e-15)
    np.testing.assert_allclose(form.guard_rate, guards @ form.a, atol=1e-13)


@pytest.mark.parametrize("plate", [1.0, 0.0])
def test_apart_the_plate_swings_by_itself_whether_it_takes_part_or_has_been_left(plate: float) -> None:
    form = learned(laid_out(None, [0]), FREE, plate)
    assert form is not None
    swing = np.zeros((5, 5))
    swing[0, 1], swing[2, 3], swing[3, 2] = 1.0, 1.0, -K_P / M_P
    np.testing.assert_allclose(form.a, swing, atol=1e-15)
    assert form.guard.shape == (4, 5)


def kinked(place: int, low: float, high: float) -> Callable[..., None]:
    """Return a force that is one between two values of an input, and nothing elsewhere: its slopes are none."""

    def function(s: Any, p: Any, out: Any) -> None:
        out[ON_BLOCK] += 1.0 if low < s[place].real < high else 0.0

    return function


@pytest.mark.parametrize(
    ("function", "linear"),
    [
        (drag, True),
        (kinked(X, 1e-4, 1.0), False),  # where the bodies overlap
        (kinked(X, -1.0, -1e-4), False),  # where they are apart
        (kinked(V, -0.4, -0.2), False),
        (kinked(X, 10.0, 20.0), True),  # where no state is looked at
        (lambda s, p, out: out.__setitem__(ON_PLATE, out[ON_PLATE] + s[X] * s[V]), False),
        (lambda s, p, out: out.__setitem__(ON_BLOCK, out[ON_BLOCK] + s[X] ** 3), False),
    ],
)
def test_what_is_not_linear_in_the_state_is_refused(function: Callable[..., None], linear: bool) -> None:
    for which in ([], [2]):
        assert (learned(laid_out(function, which)) is not None) is linear


@pytest.mark.parametrize("of_slope", [True, False])
def test_what_is_linear_only_as_its_coefficient_is_nothing_is_refused_where_it_is_differentiated(
    of_slope: bool,
) -> None:
    def square(s: Any, p: Any, out: Any) -> None:
        out[ON_BLOCK] += p[0] * (s[X] ** 2 if of_slope else (1.0 if s[X].real > 1e-4 else 0.0))

    assert learned(laid_out(square, [2], first=0.0)) is not None
    assert learned(laid_out(square, [2, 8], first=0.0)) is None


@pytest.mark.parametrize(("rows", "wide"), [(1, 1), (2, 4), (4, 4), (5, 8), (8, 8), (9, 12)])
def test_columns_are_padded_to_a_multiple_of_four(rows: int, wide: int) -> None:
    assert matrices.columns(rows) == wide


def test_forms_and_work_arrays_lie_one_after_another() -> None:
    room = np.arange(5000.0)
    stored, end = matrices.forms_of(3, 4, 2, 5, 7, room, 10)
    assert [getattr(stored, name).shape for name in stored._fields] == [
        (3, 5, 5), (3, 5, 5, 4), (3, 5, 5), (3, 5, 5), (3, 5, 5), (3, 5, 5, 4), (3, 5, 5), (3, 5, 5, 4), (3, 7, 5),
        (3, 7, 5), (3, 5, 4), (3, 4),
    ]  # fmt: skip
    sizes = [getattr(stored, name).size for name in stored._fields]
    begins = [getattr(stored, name).ravel()[0] for name in stored._fields]
    assert begins == [10.0 + sum(sizes[:k]) for k in range(12)] and end == 10 + sum(sizes)
    form = matrices.form_at(stored, 1)
    assert form.a.shape == form.e.shape == form.whole.shape == (5, 5) and form.shown.shape == form.mean.shape == (7, 5)
    for one, all_modes in zip(form, stored, strict=True):
        np.testing.assert_array_equal(one, all_modes[1])
    work, end = matrices.room_of(4, 2, room, 0)
    assert [getattr(work, name).shape for name in work._fields] == [
        (3, 5, 4), (2, 5, 1), (3, 5, 5), (5, 5, 4), (5, 5, 4),
    ]  # fmt: skip
    assert end == sum(getattr(work, name).size for name in work._fields)

"""The modes of a collision: their flags, what is watched in each, and when a block has gone for good."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.solver import modes
from analysis.collision.solver.modes import (
    CLAMPED,
    CONTACT,
    DASHPOT,
    FORCE,
    FREE,
    INNER_MASS,
    NEAR_0,
    NO_TENSION,
    OVERLAP,
    OVERLAP_RATE,
    OVERLAPPED,
    PARTED,
    PARTING,
    PHASE,
    PLATE,
    RANGE_0,
    SIGN,
    SPRING,
    VELOCITY,
)
from analysis.collision.solver.system import MOVES, RANGE_AT, SLOT_COLUMNS


def flags(phase: int, *, plate: float = 1.0, sign: float = -1.0, near: tuple[float, ...] = ()) -> np.ndarray:
    mode = np.zeros(NEAR_0 + len(near))
    mode[[PLATE, SIGN]] = plate, sign
    mode[NEAR_0:] = near
    modes.set_phase.py_func(phase, mode)
    return mode


@pytest.mark.parametrize(
    ("phase", "spring", "dash", "parted"),
    [(FREE, 0, 0, 0), (CONTACT, 1, 1, 0), (PARTING, 1, 0, 0), (OVERLAPPED, 0, 0, 1)],
)
def test_the_flags_of_a_phase(phase: int, spring: float, dash: float, parted: float) -> None:
    mode = flags(phase)
    assert (mode[PHASE], mode[SPRING], mode[DASHPOT], mode[PARTED], mode[INNER_MASS]) == (
        phase,
        spring,
        dash,
        parted,
        0.0,
    )


def slots_of(*ranges: float, moves: float | tuple[float, ...] = 0.0) -> np.ndarray:
    slots = np.zeros((len(ranges), SLOT_COLUMNS))
    slots[:, RANGE_AT], slots[:, MOVES] = ranges, moves
    return slots


@pytest.mark.parametrize(
    ("phase", "variant", "watched"),
    [
        (FREE, 0, {OVERLAP: -1.0}),
        (CONTACT, 0, {OVERLAP: 1.0}),
        (CONTACT, CLAMPED, {OVERLAP: 1.0, OVERLAP_RATE: 1.0}),
        (PARTING, CLAMPED, {OVERLAP: 1.0, OVERLAP_RATE: -1.0}),
        (CONTACT, NO_TENSION, {FORCE: 1.0}),
        (OVERLAPPED, NO_TENSION, {OVERLAP: 1.0, FORCE: -1.0}),
    ],
)
def test_what_is_watched_in_a_mode(phase: int, variant: int, watched: dict[int, float]) -> None:
    def signs(slots: np.ndarray, mode: np.ndarray, forward: bool = True) -> list[float]:
        out = np.full(RANGE_0 + len(slots), 9.0)
        modes.expected_signs.py_func(mode, variant, slots, forward, out)
        return out.tolist()

    expected = np.zeros(RANGE_0)
    for item, sign in watched.items():
        expected[item] = sign
    assert signs(slots_of(), flags(phase)) == expected.tolist()
    assert not any(signs(slots_of(), flags(phase), forward=False))
    assert not any(signs(slots_of(), flags(phase, plate=0.0)))
    slots = slots_of(-1.0, 9.0, 10.0)
    ranges = [0.0, -1.0, 1.0] if phase == FREE else [0.0] * 3
    expected[VELOCITY] = 1.0
    assert signs(slots, flags(phase, sign=1.0, near=(0.0, 0.0, 1.0))) == [*expected.tolist(), *ranges]


@pytest.mark.parametrize(
    ("z", "omega", "slots", "near", "gone"),
    [
        # beyond 20 um and one and a half times as far as the plate swings: 1.5 sqrt(3^2 + (8 / 2)^2) um
        ((2.76e-5, 0.1, 3e-6, 8e-6), 2.0, slots_of(), (), True),
        ((2.74e-5, 0.1, 3e-6, 8e-6), 2.0, slots_of(), (), False),
        ((1.0, 0.0, 0.0, 0.0), 2.0, slots_of(), (), False),
        ((2.46e-5, 0.1, -3e-6, 0.0), 0.0, slots_of(), (), True),
        ((2.44e-5, 0.1, -3e-6, 0.0), 0.0, slots_of(), (), False),
        ((1.0, 0.1, -3e-6, 1e-9), 0.0, slots_of(), (), False),  # a plate without a spring that follows
        ((1.0, 0.1, 0.0, 0.0), 2.0, slots_of(-1.0), (1.0,), False),  # still within an effect's range
        ((5.01e-3, 0.1, 0.0, 0.0), 2.0, slots_of(0.0), (0.0,), False),
        ((5.03e-3, 0.1, 0.0, 0.0), 2.0, slots_of(0.0), (0.0,), True),
        # what moves the contact point: three times as far as it is off, and a sixtieth of a second of its speed
        ((4.21e-4, 0.1, 0.0, 0.0, -1e-4, 6e-3), 2.0, slots_of(-1.0, moves=1.0), (0.0,), True),
        ((4.19e-4, 0.1, 0.0, 0.0, -1e-4, 6e-3), 2.0, slots_of(-1.0, moves=1.0), (0.0,), False),
        (
            (4.21e-4, 0.1, 0.0, 0.0, 9.0, 9.0, -1e-4, 6e-3),
            2.0,
            slots_of(-1.0, -1.0, moves=(0.0, 1.0)),
            (0.0, 0.0),
            True,
        ),
        (
            (4.19e-4, 0.1, 0.0, 0.0, 0.0, 0.0, -1e-4, 6e-3),
            2.0,
            slots_of(-1.0, -1.0, moves=(0.0, 1.0)),
            (0.0, 0.0),
            False,
        ),
    ],
)
def test_a_block_has_gone_where_nothing_can_meet_it_again(
    z: tuple[float, ...], omega: float, slots: np.ndarray, near: tuple[float, ...], gone: bool
) -> None:
    system = SimpleNamespace(slots=slots, p=np.array([5e-3]))
    assert bool(modes.has_left_for_good.py_func(np.array(z), flags(FREE, near=near), system, omega)) is gone


def test_a_block_need_only_be_asked_for_where_it_is_free_and_far() -> None:
    def asked(x: float, y: float, mode: np.ndarray) -> bool:
        return bool(modes.may_have_left_for_good.py_func(x, y, mode))

    assert asked(2.31e-5, -2e-6, flags(FREE)) and not asked(2.29e-5, -2e-6, flags(FREE))
    assert not asked(1.0, 0.0, flags(CONTACT)) and not asked(1.0, 0.0, flags(FREE, plate=0.0))


@pytest.mark.parametrize(("value", "may"), [(0.99, True), (1.01, False)])
def test_a_guard_may_have_dipped_below_zero_within_twice_the_depth_of_a_parabola(value: float, may: bool) -> None:
    # falls by 2 h, rises by 6 h: a parabola dips by 2^2 h / (2 (6 + 2))
    h = 0.5
    depth = (2.0 * h) ** 2 / ((6.0 + 2.0) * h)
    assert bool(modes.may_touch.py_func(value * depth, -2.0, 6.0, h)) is may
    assert not modes.may_touch.py_func(value * depth, 2.0, 6.0, h) and not modes.may_touch.py_func(0.0, -2.0, -6.0, h)


def test_guards_and_their_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modes, "range_at", modes.range_at.py_func)
    slots = slots_of(-1.0, 4.0)
    slots[:, MOVES] = 2.0, -1.0
    system: Any = SimpleNamespace(slots=slots, p=np.array([0.0, 0.0, 10.0, 3.0, 0.25]))
    z = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0, 0.0], [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 0.0, 0.0]])
    f = np.array([[2.0, 20.0, 4.0, 50.0, 6.0, 7.0, 8.0, 0.5]])
    contact = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    state: Any = SimpleNamespace(z=z, f=f, contact=contact)
    guards = [modes.guard.py_func(item, state, system) for item in (0, 1, 2, VELOCITY, RANGE_0 + 1)]
    assert guards == [0.1, 0.2, 0.3, 2.0, pytest.approx(0.35)]
    second = 50.0 - 20.0 + 2.0 * 7.0 - 0.5
    found = [modes.guard_rate.py_func(item, state, system) for item in (0, 1, 2, VELOCITY, RANGE_0 + 1)]
    assert found == [0.2, second, pytest.approx(10.0 * 0.2 + 3.0 * second), 20.0, 0.2]
    slopes = [modes.guard_derivative.py_func(item, 1, 4, state, system) for item in (0, 1, 2, VELOCITY, RANGE_0 + 1)]
    assert slopes == [0.4, 0.5, 0.6, 0.6, 1.4]
    assert modes.guard_derivative.py_func(RANGE_0 + 1, 1, 3, state, system) == 0.4

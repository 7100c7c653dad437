"""The first zero of a guard function within a step, of functions whose zeros are known."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.solver import crossings, path_matrices
from analysis.collision.solver.modes import VELOCITY, may_touch

Guard = tuple[Callable[[float], float], Callable[[float], float]]  # value and rate in time


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the search in plain Python for guards that are functions of the time."""
    monkeypatch.setattr(crossings, "may_touch", may_touch.py_func)
    monkeypatch.setattr(crossings, "rates", lambda *_: None)
    monkeypatch.setattr(crossings, "_root", crossings._root.py_func)
    monkeypatch.setattr(crossings, "_lowest", crossings._lowest.py_func)

    def found(guards: dict[int, Guard], signs: dict[int, float], h: float) -> tuple[int, float]:
        monkeypatch.setattr(crossings, "guard", lambda item, state, _: guards[item][0](state.at))
        monkeypatch.setattr(crossings, "guard_rate", lambda item, state, _: guards[item][1](state.at))
        of = np.array([signs.get(item, 0.0) for item in range(5)])
        motion = SimpleNamespace(
            signs=of,
            ends=np.zeros((5, 2)),
            here=SimpleNamespace(at=0.0),
            there=SimpleNamespace(at=0.0),
            mode=None,
            nothing=np.array([-1]),
        )

        def reach(stepper: Any, of: Any, motion: Any, at: float, rows: int) -> None:
            assert (stepper, of, rows) == ("stepper", system, 1)  # of no derivative
            asked.append(at)
            motion.there.at = at

        asked.clear()
        system = SimpleNamespace(which=None)
        item, when = crossings.first_crossing.py_func(reach, "stepper", system, motion, h)
        assert motion.there.at == (asked[-1] if asked else 0.0)
        return int(item), float(when)

    asked: list[float] = []
    found.asked = asked  # type: ignore[attr-defined]

    return found


def falling(zero: float) -> Guard:
    return lambda t: math.expm1(zero - t), lambda t: -math.exp(zero - t)


def dip(place: float, depth: float) -> Guard:
    """Return a parabola that is lowest at ``place``, where it is ``-depth``."""
    return lambda t: (t - place) ** 2 - depth, lambda t: 2 * (t - place)


def test_the_first_of_all_zeros_is_found_to_the_last_bit(search: Any) -> None:
    guards = {0: falling(0.7), 1: falling(0.3), 2: falling(2.0), 3: falling(0.31), 4: falling(0.1)}
    signs = {0: 1.0, 1: 1.0, 2: 1.0, 3: 1.0}
    assert search(guards, signs, 1.0) == (1, pytest.approx(0.3, abs=1e-15))  # the last is not watched
    assert search({0: falling(0.3), 1: falling(0.7)}, {0: 1.0, 1: 1.0}, 1.0) == (0, pytest.approx(0.3, abs=1e-15))
    assert len(search.asked) < 2 * 9 + 1  # by Newton's steps, not by halves
    assert search(guards, {0: 1.0, 2: 1.0}, 1.0) == (0, pytest.approx(0.7, abs=1e-15))
    assert search(guards, {2: 1.0}, 1.0) == (-1, 1.0)
    rising = {0: (lambda t: -falling(0.4)[0](t), lambda t: -falling(0.4)[1](t))}
    assert search(rising, {0: -1.0}, 1.0) == (0, pytest.approx(0.4, abs=1e-15))


def test_a_guard_that_dips_below_zero_within_a_step_is_found_where_it_enters(search: Any) -> None:
    depth = 0.01
    assert search({0: dip(0.6, depth)}, {0: 1.0}, 1.0) == (0, pytest.approx(0.5, abs=1e-12))
    assert search({0: dip(0.6, 1e-14)}, {0: 1.0}, 1.0) == (0, pytest.approx(0.6 - 1e-7, abs=1e-9))
    assert search({0: dip(0.6, -1e-6)}, {0: 1.0}, 1.0) == (-1, 1.0)
    value, rate = dip(0.6, depth)
    below = {0: (lambda t: -value(t), lambda t: -rate(t))}
    assert search(below, {0: -1.0}, 1.0) == (0, pytest.approx(0.5, abs=1e-12))
    # of the velocity two zeros within one step are not looked for
    assert search({VELOCITY: dip(0.6, depth)}, {VELOCITY: 1.0}, 1.0) == (-1, 1.0)
    quartic = {0: (lambda t: (t - 0.8) ** 4 - 1e-6, lambda t: 4 * (t - 0.8) ** 3)}
    assert search(quartic, {0: 1.0}, 1.0) == (0, pytest.approx(0.8 - 1e-6**0.25, abs=1e-9))


@pytest.mark.parametrize("zero", [0.0371, 0.31, 0.988])
@pytest.mark.parametrize("steep", [30.0, 1e3, 1e5])
def test_a_zero_from_which_newtons_steps_lead_away_is_found_by_halves(search: Any, zero: float, steep: float) -> None:
    def rate(t: float) -> float:
        return -steep / (1.0 + (steep * (t - zero)) ** 2)

    step = {0: (lambda t: math.atan(steep * (zero - t)), rate)}
    assert search(step, {0: 1.0}, 1.0) == (0, pytest.approx(zero, abs=1e-15))
    assert len(search.asked) <= 2 + math.log2(steep) + 9


@pytest.mark.parametrize("place", [0.3, 0.37, 0.45])
def test_the_lowest_point_of_a_sharp_dip_is_found_by_secants_and_halves(search: Any, place: float) -> None:
    """A hyperbola that dips below zero by next to nothing, and by nothing."""

    def dips(depth: float) -> Guard:
        def value(t: float) -> float:
            return math.hypot(t - place, 1e-2) - 1e-2 - depth

        return value, lambda t: (t - place) / math.hypot(t - place, 1e-2)

    # x^2 + 1e-4 = (1e-2 + depth)^2 where it enters
    width = math.sqrt((1e-2 + 1e-9) ** 2 - 1e-4)
    assert search({0: dips(1e-9)}, {0: 1.0}, 1.0) == (0, pytest.approx(place - width, abs=1e-9))
    assert len(search.asked) < 40
    assert search({0: dips(-1e-12)}, {0: 1.0}, 1.0) == (-1, 1.0)


def test_a_propagator_is_that_of_the_classical_method() -> None:
    random = np.random.default_rng(1)
    a = [random.standard_normal((3, 3)) for _ in range(3)]
    h = 0.3
    exact = np.empty((3, 3))
    for k, y in enumerate(np.eye(3)):
        k1 = a[0] @ y
        k2 = a[1] @ (y + 0.5 * h * k1)
        k3 = a[1] @ (y + 0.5 * h * k2)
        k4 = a[2] @ (y + h * k3)
        exact[:, k] = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    out = np.full((3, 3), np.nan)
    path_matrices._propagate.py_func(*a, h, out, np.full((3, 3), np.nan), np.full((3, 3), np.nan))
    np.testing.assert_allclose(out, exact, rtol=1e-12)


def test_matrices_are_alike_to_the_change_that_is_allowed() -> None:
    one = np.array([[1.0, -200.0], [3.0, 0.0]])
    alike = path_matrices._nearly_equal.py_func
    still, rounding = path_matrices._CONSTANT_SHARE, path_matrices._ROUNDING
    for place, size in (((0, 0), 200.0), ((0, 1), 200.0), ((1, 1), 3.0)):
        allowed = still * abs(one[place]) + rounding * size
        for share, same in ((0.99, True), (1.01, False)):
            for sign in (1.0, -1.0):
                other = one.copy()
                other[place] += sign * share * allowed
                assert bool(alike(one, other)) is same
    wide = np.ones((1, path_matrices.INPUTS))
    other = wide.copy()
    other[0, path_matrices._INERTIA] = 9.0
    assert alike(wide, other)
    other[0, path_matrices._INERTIA - 1] = 9.0
    assert not alike(wide, other)

"""The stepper's method and interpolation: the order it claims, polynomials exactly, the length of the next step."""

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import runge_kutta as module
from analysis.collision.modes import CONTACT, FREE, NEAR_0, PHASE, PLATE
from analysis.collision.runge_kutta import ALLOWED, EVER, LONGEST, SIXTH


def tableau() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stages (11, 11), weights (11,) and nodes (11,) of the method."""
    table, begins, weights = module._cooper_verner()
    a = np.zeros((12, 11))
    for row, (begin, end) in enumerate(itertools.pairwise(begins), start=1):
        a[row, table[begin:end]] = weights[begin:end]
    return a[:11], a[11], a[:11].sum(axis=1)


def test_the_method_is_of_order_eight() -> None:
    a, b, c = tableau()
    for power in range(8):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-12)
    for power, stages in itertools.product(range(4), range(1, 5)):  # tall trees
        value = c**power
        for _ in range(stages):
            value = a @ value
        if power + stages < 8:
            assert b @ value == pytest.approx(math.factorial(power) / math.factorial(power + stages + 1), abs=1e-12)
    # two branches: c^3 beside one that was grown over a stage, 1 / (8 * 4)
    assert b @ (c**3 * (a @ c**3)) == pytest.approx(1 / 32, abs=1e-12)
    assert b @ ((a @ c**2) * (a @ c**3)) == pytest.approx(1 / (8 * 3 * 4), abs=1e-12)
    errors = []
    for steps in (4, 8):
        y, h = np.array([1.0, 0.0]), 2.0 / steps
        for _ in range(steps):
            k = np.zeros((11, 2))
            for stage in range(11):
                at = y + h * a[stage] @ k
                k[stage] = at[1], -math.sin(at[0])
            y = y + h * b @ k
        errors.append(y)
    fine = np.array([1.0, 0.0])
    for _ in range(64):
        k = np.zeros((11, 2))
        for stage in range(11):
            at = fine + 2.0 / 64 * a[stage] @ k
            k[stage] = at[1], -math.sin(at[0])
        fine = fine + 2.0 / 64 * b @ k
    ratio = np.abs(errors[0] - fine).max() / np.abs(errors[1] - fine).max()
    assert 2**7 < ratio < 2**10


def ends(polynomial: np.polynomial.Polynomial, h: float) -> tuple[Any, Any]:
    """Return the states at 0 and ``h`` of a motion, in the second pair of the second row."""
    out = []
    for at in (0.0, h):
        z, f = np.full((2, 4), np.nan), np.full((2, 4), np.nan)
        z[1, 2:] = polynomial(at), polynomial.deriv()(at)
        f[1, 3] = polynomial.deriv(2)(at)
        z[0, 0], f[0, 0] = polynomial(at), polynomial.deriv()(at)
        out.append(SimpleNamespace(z=z, f=f))
    return out[0], out[1]


@pytest.mark.parametrize("h", [0.7, -0.4])
def test_between_steps_a_quintic_is_followed_exactly(h: float) -> None:
    quintic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -3.0, 1.7])
    one, other = ends(quintic, h)
    for share in (0.0, 0.3, 0.8, 1.0):
        x, v = module._quintic.py_func(one, other, 2, 1, h, share * h)
        assert (x, v) == pytest.approx((quintic(share * h), quintic.deriv()(share * h)), rel=1e-12)
    assert module._fifth.py_func(one, other, 2, 1, h) == pytest.approx(1.7, rel=1e-10)
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5])
    one, other = ends(cubic, h)
    for share in (0.0, 0.3, 1.0):
        assert module._cubic.py_func(one, other, 0, h, share * h) == pytest.approx(cubic(share * h), rel=1e-12)


def test_the_next_step_is_as_long_as_its_error_is_allowed() -> None:
    limits, memory = np.zeros(13), np.zeros(5)
    limits[ALLOWED], memory[LONGEST], memory[EVER] = 1e-16, 1e-6, 1e-2
    stepper: Any = SimpleNamespace(limits=limits, memory=memory)

    def longest(sixth: float, swing: float) -> float:
        memory[SIXTH] = sixth
        return float(module._next.py_func(stepper, swing))

    assert longest(-1.0, 1.0) == 1e-6 and longest(0.0, 1.0) == 1e-2
    slow = (1e-16 * 64 / 5.0) ** (1 / 6)
    assert longest(5.0, 0.9 / slow) == pytest.approx(slow)
    # beyond a radian the error goes with the ninth power
    swing = 2.0 / slow
    long = longest(5.0, swing)
    assert 5.0 / 64 * long**6 * (swing * long) ** 3 == pytest.approx(1e-16)
    assert longest(1e40, 1.0) == 1e-6 and longest(1e-40, 1.0) == 1e-2


def test_the_limits_of_a_step_are_those_of_its_mode() -> None:
    def place(phase: int, plate: float, forward: bool) -> int:
        mode = np.zeros(NEAR_0)
        mode[[PHASE, PLATE]] = phase, plate
        return int(module._mode_at.py_func(mode, forward))

    assert [place(CONTACT, 1.0, True), place(FREE, 1.0, True), place(FREE, 0.0, True)] == [0, 1, 2]
    assert place(CONTACT, 1.0, False) == 3 == place(FREE, 0.0, False)

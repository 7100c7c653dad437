"""Every function of a formula: compiled and on arrays it is the same, and compiled it carries a derivative along."""

from typing import Any

import numpy as np
import pytest
from numba import njit

from analysis.collision.laws.functions import FUNCTIONS, OPERATIONS

AT = (-2.3, -0.4, 0.6, 1.9)
OTHER = 0.9  # the second value of a function that takes two
POSITIVE = ("log",)
STEP = 1e-20  # of a complex step


def _compiled(name: str) -> Any:
    kernel = FUNCTIONS[name].kernel
    return njit(lambda x: kernel(x)) if FUNCTIONS[name].takes == 1 else njit(lambda x: kernel(x, x * 0.0 + OTHER))


def _on_arrays(name: str, x: float | complex) -> Any:
    function = FUNCTIONS[name]
    values = (np.array([x]),) if function.takes == 1 else (np.array([x]), np.array([OTHER + 0.0 * x]))
    return function.arrays(*values)[0]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_compiled_and_on_arrays_a_function_is_the_same_and_its_slope_is_true(name: str) -> None:
    compiled = _compiled(name)
    for x in AT:
        if x < 0.0 and name in POSITIVE:
            assert np.isnan(compiled(x)) and np.isnan(compiled(complex(x, 1.0)).real)
            continue
        assert compiled(x) == pytest.approx(_on_arrays(name, x), rel=1e-15)
        carried = compiled(complex(x, 3.0))  # a value, and three times its slope
        assert carried.real == pytest.approx(compiled(x), rel=1e-15)
        slope = (compiled(x + 1e-6) - compiled(x - 1e-6)) / 2e-6
        assert carried.imag == pytest.approx(3.0 * slope, rel=1e-6, abs=1e-9)


def test_where_a_function_has_no_value_a_formula_has_none() -> None:
    logarithm, root = _compiled("log"), _compiled("sqrt")
    assert np.isnan(logarithm(0.0)) and logarithm(1.0) == 0.0
    assert root(0.0) == root(-1.0) == 0.0 and root(complex(-1.0, 1.0)) == 0.0


def test_at_nothing_and_where_two_are_equal_functions_have_their_values() -> None:
    nothing = np.zeros(1)
    at_zero = {"abs": 0.0, "sign": 0.0, "step": 0.0, "sin": 0.0, "cos": 1.0, "exp": 1.0, "sqrt": 0.0, "tanh": 0.0}
    for name, value in at_zero.items():
        assert FUNCTIONS[name].arrays(nothing)[0] == value
    assert [FUNCTIONS[name].takes for name in ("min", "max", "abs")] == [2, 2, 1]
    low, high = np.array([-2.0, 1.0]), np.array([0.5, 1.0])
    for order in ((low, high), (high, low)):
        assert FUNCTIONS["min"].arrays(*order).tolist() == [-2.0, 1.0]
        assert FUNCTIONS["max"].arrays(*order).tolist() == [0.5, 1.0]
    assert OPERATIONS["positive_power"].arrays(np.array([-4.0, 0.0, 4.0]), 1.5).tolist() == [0.0, 0.0, 8.0]
    positive_power, whole_power, quotient = (one.kernel for one in OPERATIONS.values() if one.arrays is not one.kernel)
    reached = njit(lambda x, y: (positive_power(x, y), whole_power(x, 3), quotient(x, y)))
    assert reached(4.0, 0.5) == pytest.approx((2.0, 64.0, 8.0))
    assert reached(-4.0, 0.5)[:2] == (0.0, -64.0) and np.isnan(reached(4.0, 0.0)[2])
    power, cube, ratio = reached(complex(4.0, STEP), complex(0.5, 0.0))
    assert (power.imag / STEP, cube.imag / STEP, ratio.imag / STEP) == pytest.approx((0.25, 48.0, 2.0))
    power, _, ratio = reached(complex(4.0, 0.0), complex(0.5, STEP))
    assert (power.imag / STEP, ratio.imag / STEP) == pytest.approx((2.0 * np.log(4.0), -16.0))
    assert np.isnan(reached(complex(4.0, 0.0), complex(0.0, 1.0))[2].real)

"""What kernels call of an effect: its functions with their derivatives, and the places of inputs and outputs."""

import ctypes
import math
from typing import Any

import numpy as np
import pytest
from numba import njit

from analysis.collision.effects import kernel
from analysis.collision.effects.kernel import (
    OUTPUTS,
    STATES,
    address,
    call_within,
    complex_address,
    kernel_function,
    power,
    sine,
)

plain = kernel_function("plain", lambda x: 2.0 * x)


def made_up(s: Any, p: Any, out: Any) -> None:
    """Add one function of the state to each output."""
    out[0] += sine(s[0] * p[0])
    out[1] += power(s[1], p[1])
    out[5] += plain(s[14]) * p[2]


def added(number: type, s: list[Any], p: list[Any]) -> np.ndarray:
    """Return what the compiled effect adds to outputs of one each."""
    arrays = [np.array(values, dtype=number) for values in (s, p, [1.0] * OUTPUTS)]
    where = complex_address(made_up) if number is np.complex128 else address(made_up)
    ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)(where)(*(array.ctypes.data for array in arrays))
    return arrays[2] - 1.0


def exact(s: list[float], p: list[float]) -> np.ndarray:
    return np.array([math.sin(s[0] * p[0]), s[1] ** p[1], 0.0, 0.0, 0.0, 2.0 * s[14] * p[2]])


S, P = [0.3 + 0.1 * k for k in range(STATES)], [1.7, 2.3, 0.6]


def test_an_effect_is_compiled_for_numbers_and_for_numbers_with_a_derivative() -> None:
    np.testing.assert_allclose(added(np.float64, S, P), exact(S, P), rtol=1e-14)
    random = np.random.default_rng(2)
    s_way, p_way = random.standard_normal(STATES), random.standard_normal(3)
    found = added(np.complex128, list(S + 1e-30j * s_way), list(P + 1e-30j * p_way))
    np.testing.assert_allclose(found.real, exact(S, P), rtol=1e-14)
    ahead, back = (exact(list(S + h * s_way), list(P + h * p_way)) for h in (1e-6, -1e-6))
    np.testing.assert_allclose(found.imag / 1e-30, (ahead - back) / 2e-6, rtol=1e-8, atol=1e-9)


def test_a_kernel_calls_it_within_one_array() -> None:
    @njit
    def within(where, s, p, first):  # type: ignore[no-untyped-def]
        call_within(where, s, p, first)

    both = np.array([*S, *[1.0] * OUTPUTS])
    within(address(made_up), both, np.array([9.0, 9.0, *P]), 2)
    np.testing.assert_allclose(both, [*S, *(1.0 + exact(S, P))], rtol=1e-14)


def test_every_input_and_output_has_a_place_of_its_own() -> None:
    inputs = "X V Y U XI XI_RATE FORCE Q W SIGN_V NEAR TOUCHING PLATE_STIFFNESS CONTACT_STIFFNESS BLOCK_MASS"
    outputs = "ON_BLOCK ON_PLATE PAIR Q_RATE W_RATE MASS"
    for names, count in ((inputs, STATES), (outputs, OUTPUTS)):
        assert [getattr(kernel, name) for name in names.split()] == list(range(count))


def test_what_is_for_kernels_says_so_to_python() -> None:
    with pytest.raises(NotImplementedError, match="sine is for compiled kernels only"):
        sine(1.0)
    assert power.__name__ == "power"

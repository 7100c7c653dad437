"""The functions of a formula, for kernels (real or complex numbers, ``kernel_function``) and for arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.collision.effects.kernel import kernel_function, power, sine
from analysis.collision.laws.curve import curve_at

Of = Callable[..., Any]


def _absolute(x: Any) -> Any:
    return -x if x.real < 0.0 else x


def _sign(x: Any) -> Any:
    if x.real > 0.0:
        return 1.0
    return -1.0 if x.real < 0.0 else 0.0


def _unit_step(x: Any) -> Any:
    return 1.0 if x.real > 0.0 else 0.0


def _smaller(a: Any, b: Any) -> Any:
    return a if a.real < b.real else b


def _larger(a: Any, b: Any) -> Any:
    return b if a.real < b.real else a


def _cosine_carrying(x: Any) -> Any:
    return complex(math.cos(x.real), -math.sin(x.real) * x.imag)


def _exponential_carrying(x: Any) -> Any:
    value = math.exp(x.real)
    return complex(value, value * x.imag)


def _logarithm(x: Any) -> Any:
    return math.log(x) if x > 0.0 else math.nan


def _logarithm_carrying(x: Any) -> Any:
    if x.real <= 0.0:
        return complex(math.nan, math.nan)
    return complex(math.log(x.real), x.imag / x.real)


def _root(x: Any) -> Any:
    return math.sqrt(x) if x > 0.0 else 0.0


def _root_carrying(x: Any) -> Any:
    if x.real <= 0.0:
        return complex(0.0, 0.0)
    value = math.sqrt(x.real)
    return complex(value, 0.5 * x.imag / value)


def _tangent_carrying(x: Any) -> Any:
    value = math.tanh(x.real)
    return complex(value, (1.0 - value * value) * x.imag)


def _positive_power(x: Any, y: Any) -> Any:
    return power(x, y) if x.real > 0.0 else 0.0 * x


def _whole_power(x: Any, times: Any) -> Any:
    product = x
    for _ in range(times - 1):
        product = product * x
    return product


def _quotient(x: Any, by: Any) -> Any:  # by zero NaN: the solver then finds no trajectory, and nothing raises
    return x / by if by != 0.0 else math.nan


def _quotient_carrying(x: Any, by: Any) -> Any:
    if by.real == 0.0:
        return complex(math.nan, math.nan)
    ratio = x.real / by.real
    return complex(ratio, (x.imag - ratio * by.imag) / by.real)


@dataclass(frozen=True, slots=True)
class Function:
    """A function of a formula: the number of its arguments, and its versions for kernels and arrays."""

    takes: int
    kernel: Of
    arrays: Of


def _by_sign(x: Any) -> Any:
    return np.where(np.real(x) < 0, -1.0, 1.0) * x


def _root_of_arrays(x: Any) -> Any:
    return np.where(np.real(x) > 0, np.sqrt(np.where(np.real(x) > 0, x, 1.0)), 0.0)


def _positive_power_of_arrays(x: Any, y: Any) -> Any:
    positive = np.real(x) > 0
    return np.where(positive, np.power(np.where(positive, x, 1.0), y), 0.0)


FUNCTIONS: dict[str, Function] = {  # those that a user may write
    "abs": Function(1, kernel_function("absolute", _absolute), _by_sign),
    "sign": Function(1, kernel_function("sign_of", _sign), lambda x: np.sign(np.real(x))),
    "step": Function(1, kernel_function("unit_step", _unit_step), lambda x: np.where(np.real(x) > 0, 1.0, 0.0)),
    "min": Function(2, kernel_function("smaller", _smaller), lambda a, b: np.where(np.real(a) < np.real(b), a, b)),
    "max": Function(2, kernel_function("larger", _larger), lambda a, b: np.where(np.real(a) < np.real(b), b, a)),
    "sin": Function(1, sine, np.sin),
    "cos": Function(1, kernel_function("cosine", lambda x: math.cos(x), _cosine_carrying), np.cos),
    "exp": Function(1, kernel_function("exponential", lambda x: math.exp(x), _exponential_carrying), np.exp),
    "log": Function(1, kernel_function("logarithm", _logarithm, _logarithm_carrying), np.log),
    "sqrt": Function(1, kernel_function("square_root", _root, _root_carrying), _root_of_arrays),
    "tanh": Function(1, kernel_function("hyperbolic_tangent", lambda x: math.tanh(x), _tangent_carrying), np.tanh),
}
OPERATIONS: dict[str, Function] = {  # those for which a formula has operators, and the curve of a force of unknown form
    "positive_power": Function(2, kernel_function("positive_power", _positive_power), _positive_power_of_arrays),
    "whole_power": Function(2, kernel_function("whole_power", _whole_power), lambda x, times: np.asarray(x) ** times),
    "quotient": Function(2, kernel_function("quotient", _quotient, _quotient_carrying), np.divide),
    "curve": Function(2, curve_at, curve_at),
}

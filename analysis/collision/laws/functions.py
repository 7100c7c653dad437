"""The functions that a formula may use, for kernels (real or complex numbers) and for numpy arrays.

In a kernel the imaginary part carries a derivative (the complex step); each function multiplies it by its slope, which
is faster than the library's complex functions and right where those are defined otherwise (``absolute``, ``smaller``).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from analysis.collision.effects.kernel import power, sine

Of = Callable[..., Any]


def absolute(x: Any) -> Any:
    """Return |x| (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def sign_of(x: Any) -> Any:
    """Return -1, 0 or 1, the sign of x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def unit_step(x: Any) -> Any:
    """Return 1 where x > 0, otherwise 0 (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def cosine(x: Any) -> Any:
    """Return cos x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def exponential(x: Any) -> Any:
    """Return e^x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def logarithm(x: Any) -> Any:
    """Return ln x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def square_root(x: Any) -> Any:
    """Return the square root of x, 0 where x is negative (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def hyperbolic_tangent(x: Any) -> Any:
    """Return tanh x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def positive_power(x: Any, y: Any) -> Any:
    """Return x^y, 0 where x is not positive (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def whole_power(x: Any, times: Any) -> Any:
    """Return x^times of a whole ``times`` above 0 (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def quotient(x: Any, by: Any) -> Any:
    """Return x / by, NaN if ``by`` is 0 (for kernels): the solver then finds no trajectory, and nothing raises."""
    raise NotImplementedError("for compiled kernels only")


@overload(quotient)
def _quotient(x: Any, by: Any) -> Any:
    def of_real(x: Any, by: Any) -> Any:
        return x / by if by != 0.0 else math.nan

    def carrying(x: Any, by: Any) -> Any:
        if by.real == 0.0:
            return complex(math.nan, math.nan)
        ratio = x.real / by.real
        return complex(ratio, (x.imag - ratio * by.imag) / by.real)

    return carrying if isinstance(x, types.Complex) or isinstance(by, types.Complex) else of_real


@overload(whole_power)
def _whole_power(x: Any, times: Any) -> Any:
    def of(x: Any, times: Any) -> Any:
        product = x
        for _ in range(times - 1):
            product = product * x
        return product

    return of


@overload(absolute)
def _absolute(x: Any) -> Any:
    def of(x: Any) -> Any:
        return -x if x.real < 0.0 else x

    return of


@overload(sign_of)
def _sign_of(x: Any) -> Any:
    def of(x: Any) -> Any:
        if x.real > 0.0:
            return 1.0
        return -1.0 if x.real < 0.0 else 0.0

    return of


@overload(unit_step)
def _unit_step(x: Any) -> Any:
    def of(x: Any) -> Any:
        return 1.0 if x.real > 0.0 else 0.0

    return of


@overload(smaller)
def _smaller(a: Any, b: Any) -> Any:
    def of(a: Any, b: Any) -> Any:
        return a if a.real < b.real else b

    return of


@overload(larger)
def _larger(a: Any, b: Any) -> Any:
    def of(a: Any, b: Any) -> Any:
        return b if a.real < b.real else a

    return of


@overload(cosine)
def _cosine(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.cos(x)

    def carrying(x: Any) -> Any:
        return complex(math.cos(x.real), -math.sin(x.real) * x.imag)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(exponential)
def _exponential(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.exp(x)

    def carrying(x: Any) -> Any:
        value = math.exp(x.real)
        return complex(value, value * x.imag)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(logarithm)
def _logarithm(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.log(x) if x > 0.0 else math.nan

    def carrying(x: Any) -> Any:
        if x.real <= 0.0:
            return complex(math.nan, math.nan)
        return complex(math.log(x.real), x.imag / x.real)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(square_root)
def _square_root(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.sqrt(x) if x > 0.0 else 0.0

    def carrying(x: Any) -> Any:
        if x.real <= 0.0:
            return complex(0.0, 0.0)
        value = math.sqrt(x.real)
        return complex(value, 0.5 * x.imag / value)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(hyperbolic_tangent)
def _hyperbolic_tangent(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.tanh(x)

    def carrying(x: Any) -> Any:
        value = math.tanh(x.real)
        return complex(value, (1.0 - value * value) * x.imag)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(positive_power)
def _positive_power(x: Any, y: Any) -> Any:
    def of(x: Any, y: Any) -> Any:
        return power(x, y) if x.real > 0.0 else 0.0 * x

    return of


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


def positive_power_of_arrays(x: Any, y: Any) -> Any:
    """Return x^y of arrays, 0 where x is not positive; shapes as numpy broadcasts them."""
    positive = np.real(x) > 0
    return np.where(positive, np.power(np.where(positive, x, 1.0), y), 0.0)


FUNCTIONS: dict[str, Function] = {
    "abs": Function(1, absolute, _by_sign),
    "sign": Function(1, sign_of, lambda x: np.sign(np.real(x))),
    "step": Function(1, unit_step, lambda x: np.where(np.real(x) > 0, 1.0, 0.0)),
    "min": Function(2, smaller, lambda a, b: np.where(np.real(a) < np.real(b), a, b)),
    "max": Function(2, larger, lambda a, b: np.where(np.real(a) < np.real(b), b, a)),
    "sin": Function(1, sine, np.sin),
    "cos": Function(1, cosine, np.cos),
    "exp": Function(1, exponential, np.exp),
    "log": Function(1, logarithm, np.log),
    "sqrt": Function(
        1, square_root, lambda x: np.where(np.real(x) > 0, np.sqrt(np.where(np.real(x) > 0, x, 1.0)), 0.0)
    ),
    "tanh": Function(1, hyperbolic_tangent, np.tanh),
}

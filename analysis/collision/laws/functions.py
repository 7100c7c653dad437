"""The functions that a formula may use, for kernels (real, or carrying a derivative) and for numpy arrays alike.

In a kernel a derivative travels in the imaginary part (the complex step); each function passes it on by its own slope,
which is quicker than the library's complex functions and right where those are not defined so (``size``, ``least``).
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


def size(x: Any) -> Any:
    """Return |x| (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def side(x: Any) -> Any:
    """Return -1, 0 or 1, the sign of x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def beyond(x: Any) -> Any:
    """Return 1 where x > 0, otherwise 0 (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def least(a: Any, b: Any) -> Any:
    """Return the smaller of two (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def most(a: Any, b: Any) -> Any:
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


def root(x: Any) -> Any:
    """Return the square root of x, 0 where x is negative (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def saturation(x: Any) -> Any:
    """Return tanh x (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def raised(x: Any, y: Any) -> Any:
    """Return x^y, 0 where x is not positive (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def multiplied(x: Any, times: Any) -> Any:
    """Return x^times of a whole ``times`` above 0 (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def divided(x: Any, by: Any) -> Any:
    """Return x / by, not a number where ``by`` is 0 (for kernels): the trajectory is then none, and nothing raises."""
    raise NotImplementedError("for compiled kernels only")


@overload(divided)
def _divided(x: Any, by: Any) -> Any:
    def of_real(x: Any, by: Any) -> Any:
        return x / by if by != 0.0 else math.nan

    def carrying(x: Any, by: Any) -> Any:
        if by.real == 0.0:
            return complex(math.nan, math.nan)
        ratio = x.real / by.real
        return complex(ratio, (x.imag - ratio * by.imag) / by.real)

    return carrying if isinstance(x, types.Complex) or isinstance(by, types.Complex) else of_real


@overload(multiplied)
def _multiplied(x: Any, times: Any) -> Any:
    def of(x: Any, times: Any) -> Any:
        product = x
        for _ in range(times - 1):
            product = product * x
        return product

    return of


@overload(size)
def _size(x: Any) -> Any:
    def of(x: Any) -> Any:
        return -x if x.real < 0.0 else x

    return of


@overload(side)
def _side(x: Any) -> Any:
    def of(x: Any) -> Any:
        if x.real > 0.0:
            return 1.0
        return -1.0 if x.real < 0.0 else 0.0

    return of


@overload(beyond)
def _beyond(x: Any) -> Any:
    def of(x: Any) -> Any:
        return 1.0 if x.real > 0.0 else 0.0

    return of


@overload(least)
def _least(a: Any, b: Any) -> Any:
    def of(a: Any, b: Any) -> Any:
        return a if a.real < b.real else b

    return of


@overload(most)
def _most(a: Any, b: Any) -> Any:
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


@overload(root)
def _root(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.sqrt(x) if x > 0.0 else 0.0

    def carrying(x: Any) -> Any:
        if x.real <= 0.0:
            return complex(0.0, 0.0)
        value = math.sqrt(x.real)
        return complex(value, 0.5 * x.imag / value)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(saturation)
def _saturation(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.tanh(x)

    def carrying(x: Any) -> Any:
        value = math.tanh(x.real)
        return complex(value, (1.0 - value * value) * x.imag)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(raised)
def _raised(x: Any, y: Any) -> Any:
    def of(x: Any, y: Any) -> Any:
        return power(x, y) if x.real > 0.0 else 0.0 * x

    return of


@dataclass(frozen=True, slots=True)
class Function:
    """A function of a formula: how many values it takes, what it is in a kernel, and on arrays (real or complex)."""

    takes: int
    kernel: Of
    arrays: Of


def _by_side(x: Any) -> Any:
    return np.where(np.real(x) < 0, -1.0, 1.0) * x


def raised_arrays(x: Any, y: Any) -> Any:
    """Return x^y of arrays, 0 where x is not positive; shapes as numpy broadcasts them."""
    positive = np.real(x) > 0
    return np.where(positive, np.power(np.where(positive, x, 1.0), y), 0.0)


FUNCTIONS: dict[str, Function] = {
    "abs": Function(1, size, _by_side),
    "sign": Function(1, side, lambda x: np.sign(np.real(x))),
    "step": Function(1, beyond, lambda x: np.where(np.real(x) > 0, 1.0, 0.0)),
    "min": Function(2, least, lambda a, b: np.where(np.real(a) < np.real(b), a, b)),
    "max": Function(2, most, lambda a, b: np.where(np.real(a) < np.real(b), b, a)),
    "sin": Function(1, sine, np.sin),
    "cos": Function(1, cosine, np.cos),
    "exp": Function(1, exponential, np.exp),
    "log": Function(1, logarithm, np.log),
    "sqrt": Function(1, root, lambda x: np.where(np.real(x) > 0, np.sqrt(np.where(np.real(x) > 0, x, 1.0)), 0.0)),
    "tanh": Function(1, saturation, np.tanh),
}

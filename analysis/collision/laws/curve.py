"""A force as a curve of one argument: a cubic spline, whose table is read by kernels through its address.

An effect's parameters are numbers, so one of them is the address of the table (addresses are below 2^53, which a float
represents exactly).  ``Curve`` owns the table and must outlive every solution that uses it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # loads its interpolate, 20 MB, when that is first used: a window without laws needs no splines
from numba import types
from numba.extending import intrinsic, overload

from analysis.collision.parameters import Floats

_GRADE = 1.6  # exponent of the knots' positions: denser near zero, where laws have kinks and cusps


@dataclass(frozen=True, eq=False)
class Curve:
    """A piecewise cubic in N over its argument, constant beyond its ends.

    ``breaks``, shape (m + 1,), ascending; ``pieces``, shape (m, 4), the powers of (argument - break), lowest first.
    """

    breaks: Floats
    pieces: Floats
    table: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = float(self.breaks.size - 1)
        table = np.concatenate([[count], self.breaks, self.pieces.ravel()]).astype(np.float64)
        object.__setattr__(self, "table", table)

    @property
    def address(self) -> float:
        """Get the address of the table."""
        return float(self.table.ctypes.data)

    def __call__(self, argument: Floats) -> Floats:
        """Return the force in N at ``argument``, any shape."""
        inside = np.clip(argument, self.breaks[0], self.breaks[-1])
        at = np.clip(np.searchsorted(self.breaks, inside, side="right") - 1, 0, self.breaks.size - 2)
        t, c = inside - self.breaks[at], self.pieces[at]
        return np.asarray(((c[..., 3] * t + c[..., 2]) * t + c[..., 1]) * t + c[..., 0])

    @cached_property
    def largest_slope(self) -> float:
        """Get the largest slope, in N per unit of the argument."""
        fine = np.linspace(self.breaks[0], self.breaks[-1], 40 * self.pieces.shape[0] + 1)
        return float(np.max(np.abs(np.diff(self(fine)) / np.diff(fine))))


@dataclass(frozen=True)
class Basis:
    """Cubic B-splines over a range; ``knots`` ascending, from its low end to its high end."""

    knots: tuple[float, ...]
    # Every basis function as a curve.  Kernels read them by address, so they are created with the basis.  If they were
    # created at first use, each of two threads could create its own (from Python 3.12), and free one while in use.
    members: tuple[Curve, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "members", tuple(self.curve(unit) for unit in np.eye(self.count)))

    @cached_property
    def _padded(self) -> Floats:
        return np.concatenate([[self.knots[0]] * 3, self.knots, [self.knots[-1]] * 3])

    @property
    def count(self) -> int:
        """Get the number of coefficients."""
        return len(self.knots) + 2

    def curve(self, coefficients: Floats) -> Curve:
        """Return the curve of ``coefficients``, shape (count,)."""
        pieces = scipy.interpolate.PPoly.from_spline(scipy.interpolate.BSpline(self._padded, coefficients, 3))
        inner = slice(3, 3 + len(self.knots) - 1)
        return Curve(np.array(self.knots), np.ascontiguousarray(pieces.c[::-1, inner].T))

    def design(self, argument: Floats) -> Floats:
        """Return the basis functions at ``argument``, shape (n,), inside the range: shape (n, count)."""
        inside = np.clip(argument, self.knots[0], self.knots[-1])
        return np.asarray(scipy.interpolate.BSpline.design_matrix(inside, self._padded, 3).toarray())

    @cached_property
    def roughness(self) -> Floats:
        """Get the matrix whose quadratic form is the integral of the squared second derivative, shape (count, count).

        The range is scaled to one, so that the matrix has no unit.
        """
        fine = np.concatenate(
            [np.linspace(a, b, 5)[:-1] + (b - a) / 8 for a, b in zip(self.knots, self.knots[1:], strict=False)]
        )
        span = self.knots[-1] - self.knots[0]
        splines = (scipy.interpolate.BSpline(self._padded, unit, 3) for unit in np.eye(self.count))
        second = np.stack([spline.derivative(2)(fine) for spline in splines], axis=1)
        widths = np.repeat(np.diff(self.knots) / 4, 4) / span
        return np.asarray((second * widths[:, None]).T @ second) * span**4


def graded_basis(low: float, high: float, pieces: int) -> Basis:
    """Return a basis of about ``pieces`` pieces over [low, high], finer near zero if zero is in or near the range."""
    if not low < high:
        raise ValueError("an argument that is constant has no law")
    if low < 0 < high:
        below = max(1, round(pieces * -low / (high - low)))
        above = max(1, pieces - below)
        left = [low * (k / below) ** _GRADE for k in range(below, 0, -1)]
        return Basis((*left, 0.0, *(high * (k / above) ** _GRADE for k in range(1, above + 1))))
    near, far = (low, high) if abs(low) < abs(high) else (high, low)
    steps = [
        near + (far - near) * (k / pieces) ** (_GRADE if abs(near) < 0.1 * abs(far) else 1.0) for k in range(pieces + 1)
    ]
    return Basis(tuple(sorted(steps)))


def _pointer(_context: Any, address: Any) -> Any:
    def generate(_target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from llvmlite import ir

        return builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(types.int64), generate  # type: ignore[no-untyped-call]


_doubles: Any = intrinsic(_pointer)


def curve_at(address: Any, argument: Any) -> Any:
    """Return the value of the curve whose table is at ``address`` (for kernels); about 10 ns."""
    raise NotImplementedError("for compiled kernels only")


@overload(curve_at)
def _curve_at(address: Any, argument: Any) -> Any:
    def of(address: Any, argument: Any) -> Any:
        table = _doubles(np.int64(address.real))
        count = int(table[0])
        here = argument.real
        if here <= table[1]:
            return 0.0 * argument + table[2 + count]
        if here >= table[1 + count]:
            last = 2 + count + 4 * (count - 1)
            t = table[1 + count] - table[count]
            return 0.0 * argument + (((table[last + 3] * t + table[last + 2]) * t + table[last + 1]) * t + table[last])
        low, high = 0, count
        while high - low > 1:
            middle = (low + high) // 2
            if table[1 + middle] <= here:
                low = middle
            else:
                high = middle
        t = argument - table[1 + low]
        at = 2 + count + 4 * low
        return ((table[at + 3] * t + table[at + 2]) * t + table[at + 1]) * t + table[at]

    return of


def visited_range(values: Sequence[Floats]) -> tuple[float, float]:
    """Return the range of the values, [low, high], widened by a hundredth so that every sample is inside."""
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    margin = 0.01 * (high - low) or math.ulp(1.0)
    return low - margin, high + margin

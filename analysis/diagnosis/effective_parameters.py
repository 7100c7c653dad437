"""Parameters as a record shows them, in which a search goes straight, and as they are.

The touch is seen late by the optics' delay.  A plate on a clamp that gives is seen softer, and the clamp's mode faster,
than each is by itself: spring and clamp stand in series, k_p / (1 + k_p C), and while the plate stands still its spring
helps the clamp's, f sqrt(1 + k_p C).  What is seen is known to parts in a million, C itself to a few in a hundred.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.quick_shot import Values
from analysis.model.least_squares import Infeasible

Floats = NDArray[np.float64]
LAG = "demodulation_lag"
CLAMP = "support_compliance"
_SOFTEST = 0.9  # of the whole compliance is the clamp's, at most


@dataclass(frozen=True, slots=True)
class Point:
    """Parameters of a hypothesis: base, shape (b,); own (v_i, touch, offset) a shot, shape (s, 3); effects a shot."""

    base: Floats
    own: Floats
    values: tuple[Values, ...]


def to_effective(point: Point) -> Point:
    """Return the point as the record shows it."""
    own = point.own + [[0.0, _delay(values), 0.0] for values in point.values]
    clamp = point.values[0].get(CLAMP)
    if clamp is None:
        return Point(point.base, own, point.values)
    both = 1 + point.base[0] * clamp["compliance_m_per_n"]
    return _clamped(point, own, point.base[0] / both, clamp["frequency_hz"] * math.sqrt(both))


def to_actual(effective: Point) -> Point:
    """Return the point that is seen so; Infeasible where no plate would be left."""
    own = effective.own - [[0.0, _delay(values), 0.0] for values in effective.values]
    clamp = effective.values[0].get(CLAMP)
    if clamp is None:
        return Point(effective.base, own, effective.values)
    left = _left(effective.base[0], clamp)
    return _clamped(effective, own, effective.base[0] / left, clamp["frequency_hz"] * math.sqrt(left))


def slope(effective: Point, size: int, at: Mapping[tuple[str, str], int], touches: list[int]) -> Floats:
    """Return the derivatives of parameters as they are by those that are seen, shape (size, size).

    ``at`` says where in the vector an (effect, parameter) stands, ``touches`` where each shot's touch time does.
    """
    out = np.eye(size)
    if (lag := at.get((LAG, "time_s"))) is not None:
        out[touches, lag] = -1.0
    if (soft := at.get((CLAMP, "compliance_m_per_n"))) is not None:
        clamp, fast = effective.values[0][CLAMP], at[CLAMP, "frequency_hz"]
        stiffness, left = float(effective.base[0]), _left(effective.base[0], clamp)
        root = math.sqrt(left)
        by_left = -0.5 * clamp["frequency_hz"] / root
        out[0, [0, soft]] = 1 / left**2, (stiffness / left) ** 2
        out[fast, [0, soft, fast]] = by_left * clamp["compliance_m_per_n"], by_left * stiffness, root
    return out


def _left(stiffness: float, clamp: Mapping[str, float]) -> float:
    """Return the plate's share of the whole compliance."""
    left = 1 - float(stiffness) * clamp["compliance_m_per_n"]
    if left < 1 - _SOFTEST:
        raise Infeasible("the clamp alone is softer than what is seen")
    return left


def _clamped(point: Point, own: Floats, stiffness: float, frequency_hz: float) -> Point:
    base = point.base.copy()
    base[0] = stiffness
    return Point(base, own, tuple({**v, CLAMP: {**v[CLAMP], "frequency_hz": frequency_hz}} for v in point.values))


def _delay(values: Values) -> float:
    """Return by how much the optics show everything late, in s: a growing lag must not move the touch as it is seen."""
    return values.get(LAG, {}).get("time_s", 0.0)

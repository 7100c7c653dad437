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

from analysis.collision.effects.row import Effect
from analysis.collision.parameters import Infeasible
from analysis.inference.fit.situation import Values

Floats = NDArray[np.float64]
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
    clamp = _clamp(point.values[0])
    if clamp is None:
        return Point(point.base, own, point.values)
    both = 1 + point.base[0] * clamp.softness
    return clamp.put(point, own, point.base[0] / both, clamp.swing * math.sqrt(both))


def to_actual(effective: Point) -> Point:
    """Return the point that is seen so; Infeasible where no plate would be left."""
    own = effective.own - [[0.0, _delay(values), 0.0] for values in effective.values]
    clamp = _clamp(effective.values[0])
    if clamp is None:
        return Point(effective.base, own, effective.values)
    left = clamp.left(effective.base[0])
    return clamp.put(effective, own, effective.base[0] / left, clamp.swing * math.sqrt(left))


def chained(effective: Point, seen: Floats, at: Mapping[tuple[Effect, str], int], touches: list[int]) -> Floats:
    """Return the derivatives of parameters as they are, from those of the parameters as they are ``seen``.

    Both have shape (p, k), a row a parameter; ``at`` says in which an (effect, parameter) stands, ``touches`` in which
    each shot's touch time does.
    """
    out = seen.copy()
    for (effect, parameter), place in at.items():
        if parameter == effect.delays:
            out[touches] -= seen[place]
    clamp = _clamp(effective.values[0])
    if clamp is not None and (soft := at.get((clamp.effect, clamp.compliance))) is not None:
        fast = at[clamp.effect, clamp.frequency]
        stiffness, left = float(effective.base[0]), clamp.left(effective.base[0])
        root = math.sqrt(left)
        by_left = -0.5 * clamp.swing / root
        out[0] = seen[0] / left**2 + (stiffness / left) ** 2 * seen[soft]
        out[fast] = by_left * (clamp.softness * seen[0] + stiffness * seen[soft]) + root * seen[fast]
    return out


@dataclass(frozen=True, slots=True)
class _Clamp:
    """An effect whose spring stands in series with the plate's: its parameters' names, and their values."""

    effect: Effect
    compliance: str
    frequency: str
    softness: float
    swing: float

    def left(self, stiffness: float) -> float:
        """Return the plate's share of the whole compliance."""
        left = 1 - float(stiffness) * self.softness
        if left < 1 - _SOFTEST:
            raise Infeasible("the clamp alone is softer than what is seen")
        return left

    def put(self, point: Point, own: Floats, stiffness: float, swing: float) -> Point:
        """Return the point with another plate and another frequency of the clamp."""
        base = point.base.copy()
        base[0] = stiffness
        values = tuple({**v, self.effect: {**v[self.effect], self.frequency: swing}} for v in point.values)
        return Point(base, own, values)


def _clamp(values: Values) -> _Clamp | None:
    for effect, given in values.items():
        if (names := effect.in_series) is not None:
            return _Clamp(effect, *names, *(given[parameter] for parameter in names))
    return None


def _delay(values: Values) -> float:
    """Return by how much the optics show everything late, in s: a growing lag must not move the touch as it is seen."""
    return sum(given[effect.delays] for effect, given in values.items() if effect.delays)

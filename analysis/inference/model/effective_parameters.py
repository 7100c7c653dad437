"""Convert between physical parameters and effective parameters, which a record determines directly.

The optics' delay makes the touch appear late.  A plate on a compliant clamp (compliance C) appears softer, k_p / (1 +
k_p C), since plate and clamp are springs in series.  The clamp's mode appears faster, f sqrt(1 + k_p C), since the
plate at rest adds its spring to the clamp's.  The record determines these apparent values to parts in a million, but C
only to a few per cent.  A search in effective parameters therefore has straight valleys.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.collision import Effect, Infeasible
from analysis.shot import Floats

Values = Mapping[Effect, Mapping[str, float]]  # of a shot's effects, by effect and parameter

_SOFTEST = 0.9  # largest share of the clamp in the total compliance


@dataclass(frozen=True, slots=True)
class Point:
    """Parameters of a model: base, shape (b,); own (v_i, touch, offset), shape (shots, 3); effects by shot."""

    base: Floats
    own: Floats
    values: tuple[Values, ...]

    def with_effect(self, effect: Effect, starts: Sequence[Mapping[str, float]]) -> "Point":
        """Return the point with one more effect, at the values given for each shot."""
        values = tuple({**before, effect: start} for before, start in zip(self.values, starts, strict=True))
        return Point(self.base, self.own, values)


def to_effective(point: Point) -> Point:
    """Return the effective parameters of physical ones."""
    own = point.own + [[0.0, _delay(values), 0.0] for values in point.values]
    clamp = _clamp(point.values[0])
    if clamp is None:
        return Point(point.base, own, point.values)
    both = 1 + point.base[0] * clamp.softness
    return clamp.put(point, own, point.base[0] / both, clamp.swing * math.sqrt(both))


def to_physical(effective: Point) -> Point:
    """Return the physical parameters of effective ones; Infeasible if the clamp takes nearly all the compliance."""
    own = effective.own - [[0.0, _delay(values), 0.0] for values in effective.values]
    clamp = _clamp(effective.values[0])
    if clamp is None:
        return Point(effective.base, own, effective.values)
    left = clamp.left(effective.base[0])
    return clamp.put(effective, own, effective.base[0] / left, clamp.swing * math.sqrt(left))


def physical_derivatives(effective: Point, seen: Floats, at: Mapping[tuple[Effect, str], int], touch: int) -> Floats:
    """Return the derivatives of each shot's physical parameters, given those of the effective ones (``seen``).

    Both have shape (shots, p, k), one row per parameter of a shot.  ``at`` holds the row of each shared (effect,
    parameter), ``touch`` is the row of the touch time.
    """
    out = seen.copy()
    for (effect, parameter), place in at.items():
        if parameter == effect.delay_parameter:
            out[:, touch] -= seen[:, place]
    clamp = _clamp(effective.values[0])
    if clamp is not None and (soft := at.get((clamp.effect, clamp.compliance))) is not None:
        fast = at[clamp.effect, clamp.frequency]
        stiffness, left = float(effective.base[0]), clamp.left(effective.base[0])
        root = math.sqrt(left)
        by_left = -0.5 * clamp.swing / root
        out[:, 0] = seen[:, 0] / left**2 + (stiffness / left) ** 2 * seen[:, soft]
        by_clamp = by_left * (clamp.softness * seen[:, 0] + stiffness * seen[:, soft])
        out[:, fast] = by_clamp + root * seen[:, fast]
    return out


@dataclass(frozen=True, slots=True)
class _Clamp:
    """An effect whose spring is in series with the plate's: the effect, its parameter names, and their values."""

    effect: Effect
    compliance: str
    frequency: str
    softness: float
    swing: float

    def left(self, stiffness: float) -> float:
        """Return the plate's share of the total compliance."""
        left = 1 - float(stiffness) * self.softness
        if left < 1 - _SOFTEST:
            raise Infeasible("the clamp alone is softer than what is seen")
        return left

    def put(self, point: Point, own: Floats, stiffness: float, swing: float) -> Point:
        """Return the point with this stiffness of the plate and this frequency of the clamp (Hz)."""
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
    """Return the delay of the optics in s; the effective touch time stays fixed when the delay changes."""
    return sum(given[effect.delay_parameter] for effect, given in values.items() if effect.delay_parameter)

"""A collision and its effects as the integrators take them: numbers, slots, addresses, and how fast things swing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.model.effects.kernel import Kernel, address, complex_address
from analysis.model.effects.row import Acts, Effect
from analysis.model.parameters import Collision, Floats
from analysis.model.rates import SLOT_COLUMNS, SLOT_PARAMETERS

Addresses = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Active:
    """An effect switched on, with its parameters' values in the row's order."""

    effect: Effect
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Laid:
    """What ``rates`` asks for: ``p``, shape (8 + 3 m,), and ``slots``, shape (m, 7), of m effects; ``hidden`` states.

    ``functions`` are the effects' addresses in real numbers, ``carrying`` in complex ones (zero unless asked for).
    """

    p: Floats
    slots: Floats
    functions: Addresses
    carrying: Addresses
    hidden: int


def lay_out(collision: Collision, effects: Sequence[Active], *, carrying: bool = False) -> Laid:
    """Lay out a collision with mechanical effects; ValueError for one that does not act on the motion."""
    count = len(effects)
    p, slots = np.zeros(SLOT_PARAMETERS + 3 * count), np.zeros((count, SLOT_COLUMNS))
    functions, complex_ones = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    p[:SLOT_PARAMETERS] = collision.vector
    for slot, active in enumerate(effects):
        row = active.effect
        function, acts = function_of(row, collision)
        functions[slot] = address(function)
        if carrying:
            complex_ones[slot] = complex_address(function)
        first = SLOT_PARAMETERS + 3 * slot
        p[first : first + len(active.values)] = active.values
        on_plate, pair = acts is Acts.ON_PLATE, acts is Acts.IN_CONTACT
        slots[slot] = [1, pair, row.hidden, row.shift, on_plate, row.rides, row.range_at]
    hidden = 2 * max((slot + 1 for slot, active in enumerate(effects) if active.effect.hidden), default=0)
    return Laid(p, slots, functions, complex_ones, hidden)


def function_of(row: Effect, collision: Collision) -> tuple[Kernel, Acts]:
    """Return the function by which an effect acts on a collision, and where; ValueError where it does not."""
    if row.kernel is None:
        raise ValueError(f"{row.name} does not act on the motion")
    if row.locked is not None and math.isinf(collision.plate_mass_kg):
        return row.locked, Acts.IN_CONTACT
    return row.kernel, row.acts


@dataclass(frozen=True, slots=True)
class Swings:
    """The fastest rates in rad/s: of the bodies in ``contact``, of the ``plate`` alone, and what the effects bring.

    ``inside`` is what of the effects' stays with the block when it has left; ``every`` is theirs altogether.
    """

    contact: float
    plate: float
    every: float
    inside: float


def swings(collision: Collision, effects: Sequence[Active]) -> Swings:
    """Return how fast a collision with mechanical effects swings or fades at most."""
    c = collision
    values = [np.asarray(active.values) for active in effects]
    rows = [active.effect for active in effects]
    factor = math.prod(row.stiffens(v, c) for row, v in zip(rows, values, strict=True))
    inverse = 1 / c.block_mass_kg + 1 / c.plate_mass_kg
    plate = c.plate_stiffness_n_per_m / c.plate_mass_kg
    swinging = math.sqrt(factor * c.contact_stiffness_n_per_m * inverse + plate)
    each = [(row.fastest(v, c), row.acts is Acts.ON_BLOCK) for row, v in zip(rows, values, strict=True)]
    return Swings(
        contact=max(swinging, c.contact_damping_n_s_per_m * inverse),
        plate=math.sqrt(plate),
        every=max((rate for rate, _ in each), default=0.0),
        inside=max((rate for rate, block in each if block), default=0.0),
    )

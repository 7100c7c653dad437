"""Lays out a collision and its effects as arrays for the solver's kernels, and estimates their fastest rates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision.effects.kernel import Kernel, address, complex_address
from analysis.collision.effects.row import Acts, Effect
from analysis.collision.parameters import Collision
from analysis.collision.system import SLOT_COLUMNS, SLOT_PARAMETERS, System, system_of

_MOST_PARAMETERS = 4096  # of one effect


@dataclass(frozen=True, slots=True)
class Active:
    """An effect with the values of its parameters in the row's order, or the result of ``clocked`` for them."""

    effect: Effect
    values: tuple[float, ...]


def direction(slot: int, place: int) -> int:
    """Return the number by which a derivative by the ``place``-th parameter of the effect in ``slot`` is requested."""
    return SLOT_PARAMETERS + _MOST_PARAMETERS * slot + place


def _place(direction: int, begins: Sequence[int]) -> int:
    """Return the index in ``p`` of the parameter of a direction; -1: none."""
    slot, place = divmod(direction - SLOT_PARAMETERS, _MOST_PARAMETERS)
    return direction if direction < SLOT_PARAMETERS else begins[slot] + place


def lay_out(collision: Collision, effects: Sequence[Active], which: Sequence[int]) -> System:
    """Lay out a collision with mechanical effects, and derivatives by ``which``.

    Those are places in ``kernel_order``, -1 for none, or the ``direction`` of an effect's parameter.  Raises ValueError
    for an effect that does not act on the motion.
    """
    count, first, hidden = len(effects), SLOT_PARAMETERS, 0
    begins, values = [], list(collision.vector)
    slots, addresses = np.empty((count, SLOT_COLUMNS)), np.empty((2, count), dtype=np.int64)
    for slot, active in enumerate(effects):
        row = active.effect
        function, acts = function_of(row, collision)
        addresses[0, slot], addresses[1, slot] = address(function), complex_address(function)
        range_at = first + row.range_at if row.range_at >= 0 else -1
        rate_at = first + 1 if row.clocked is not None else -1
        on_plate, pair = acts is Acts.ON_PLATE, acts is Acts.IN_CONTACT
        slots[slot] = [pair, row.hidden, row.shift, on_plate, row.rides, range_at, first, rate_at]
        if row.hidden:
            hidden = 2 * (slot + 1)
        begins.append(first)
        values += active.values
        first += len(active.values)
    by = np.array([_place(one, begins) for one in which], dtype=np.int64)
    return system_of(np.array(values, dtype=np.float64), slots, addresses, by, int(collision.variant), 4 + hidden)


def function_of(row: Effect, collision: Collision) -> tuple[Kernel, Acts]:
    """Return the function of an effect on a collision, and where it acts.  Raises ValueError if it does not act."""
    if row.kernel is None:
        raise ValueError(f"{row.name} does not act on the motion")
    if row.locked is not None and math.isinf(collision.plate_mass_kg):
        return row.locked, Acts.IN_CONTACT
    return row.kernel, row.acts


@dataclass(frozen=True, slots=True)
class FastestRates:
    """The fastest rates in rad/s: of the bodies in ``contact``, of the ``plate`` alone, and of the effects.

    ``every`` is the fastest of all effects, ``inside`` that of effects on the block, which go on after the release.
    """

    contact: float
    plate: float
    every: float
    inside: float


def fastest_rates(collision: Collision, effects: Sequence[Active]) -> FastestRates:
    """Return the fastest rates of oscillation or decay of a collision with mechanical effects."""
    c = collision
    values = [np.asarray(active.values) for active in effects]
    rows = [active.effect for active in effects]
    factor = math.prod(row.stiffens(v, c) for row, v in zip(rows, values, strict=True))
    inverse = 1 / c.block_mass_kg + 1 / c.plate_mass_kg
    plate = c.plate_stiffness_n_per_m / c.plate_mass_kg
    oscillation = math.sqrt(factor * c.contact_stiffness_n_per_m * inverse + plate)
    each = [(row.fastest(v, c), row.acts is Acts.ON_BLOCK) for row, v in zip(rows, values, strict=True)]
    return FastestRates(
        contact=max(oscillation, c.contact_damping_n_s_per_m * inverse),
        plate=math.sqrt(plate),
        every=max((rate for rate, _ in each), default=0.0),
        inside=max((rate for rate, block in each if block), default=0.0),
    )

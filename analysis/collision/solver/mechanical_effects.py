"""Lay out the mechanical effects of one shot for the solver's kernels, and find their fastest rates.

A frame vibration runs on the recording's clock.  Its phase at the first touch depends on the touch time, and the
plate's response to it on the plate's stiffness and mass.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision.effects.kernel import OUTPUTS, STATES, Kernel, address, complex_address
from analysis.collision.effects.row import Acts, Effect
from analysis.collision.parameters import KERNEL_ORDER, Collision, Floats
from analysis.collision.solver.system import SLOT_COLUMNS, SLOT_PARAMETERS, System

_STEP = 1e-40  # size of a complex step
_PLATE = KERNEL_ORDER[:2]  # stiffness and mass
_MAX_PARAMETERS = 4096  # upper limit for one effect


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with its parameter values in the row's order, or with the result of ``clocked`` for them."""

    effect: Effect
    values: tuple[float, ...]


def direction(slot: int, place: int) -> int:
    """Return the number that requests the derivative with respect to parameter ``place`` of the effect in ``slot``."""
    return SLOT_PARAMETERS + _MAX_PARAMETERS * slot + place


def _parameter_index(direction: int, begins: Sequence[int]) -> int:
    """Return the index in ``p`` of a direction's parameter; -1 (no parameter) stays -1."""
    slot, place = divmod(direction - SLOT_PARAMETERS, _MAX_PARAMETERS)
    return direction if direction < SLOT_PARAMETERS else begins[slot] + place


def build_system(collision: Collision, effects: Sequence[ActiveEffect], which: Sequence[int]) -> System:
    """Lay out a collision with mechanical effects, for derivatives with respect to the parameters ``which``.

    Each of ``which`` is an index into ``KERNEL_ORDER``, -1 for none, or the ``direction`` of an effect's parameter.
    Raises ValueError if an effect does not act on the motion.
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
        slots[slot] = [pair, row.hidden, row.shift, on_plate, row.moves_with_block, range_at, first, rate_at]
        if row.hidden:
            hidden = 2 * (slot + 1)
        begins.append(first)
        values += active.values
        first += len(active.values)
    by = np.array([_parameter_index(one, begins) for one in which], dtype=np.int64)
    p, inputs = np.array(values, dtype=np.float64), np.zeros(STATES + OUTPUTS)
    variant, numbers = int(collision.variant), 4 + hidden
    return System(p, slots, addresses, by, variant, numbers, inputs, p.astype(complex), inputs.astype(complex))


def function_of(row: Effect, collision: Collision) -> tuple[Kernel, Acts]:
    """Return an effect's function for this collision, and where it acts.  Raises ValueError if it does not act."""
    if row.kernel is None:
        raise ValueError(f"{row.name} does not act on the motion")
    if row.locked is not None and math.isinf(collision.plate_mass_kg):
        return row.locked, Acts.IN_CONTACT
    return row.kernel, row.acts


@dataclass(frozen=True, slots=True)
class FastestRates:
    """The fastest rates in rad/s: of the bodies in ``contact``, of the ``plate`` alone, and of the effects.

    ``bodies`` is that in contact without effects, ``effects`` that of all effects alone, and ``on_block`` that of
    effects on the block, which continue after the release.
    """

    bodies: float
    contact: float
    plate: float
    effects: float
    on_block: float

    @property
    def of_modes(self) -> tuple[float, float, float, float]:
        """Get the fastest rates in contact, apart, after the block has left for good, and before the touch."""
        return math.hypot(self.contact, self.effects), math.hypot(self.plate, self.effects), self.on_block, 0.0


def fastest_rates(collision: Collision, effects: Sequence[ActiveEffect]) -> FastestRates:
    """Return the fastest rates of oscillation or decay of a collision with mechanical effects."""
    c = collision
    values = [np.asarray(active.values) for active in effects]
    rows = [active.effect for active in effects]
    factor = math.prod(row.stiffens(v, c) for row, v in zip(rows, values, strict=True))
    inverse = 1 / c.block_mass_kg + 1 / c.plate_mass_kg
    plate = c.plate_stiffness_n_per_m / c.plate_mass_kg
    spring, decay = c.contact_stiffness_n_per_m * inverse, c.contact_damping_n_s_per_m * inverse
    each = [(row.fastest(v, c), row.acts is Acts.ON_BLOCK) for row, v in zip(rows, values, strict=True)]
    return FastestRates(
        bodies=max(math.sqrt(spring + plate), decay),
        contact=max(math.sqrt(factor * spring + plate), decay),
        plate=math.sqrt(plate),
        effects=max((rate for rate, _ in each), default=0.0),
        on_block=max((rate for rate, block in each if block), default=0.0),
    )


@dataclass(frozen=True, slots=True)
class ChainRule:
    """The derivatives ``slopes``, shape (3, n), of a kernel's three values with respect to the parameters ``names``."""

    slot: int
    names: tuple[str, ...]
    slopes: Floats


def active_effects(
    rows: Sequence[Effect], values: Mapping[Effect, Mapping[str, float]], collision: Collision, touch_time_s: float
) -> list[ActiveEffect]:
    """Return those of ``rows`` that act on the motion, in order; ``values`` maps effect and parameter to a value."""
    out = []
    for row in rows:
        if row.kernel is None:
            continue
        given = tuple(values[row][p.name] for p in row.parameters)
        if row.clocked is not None:
            plate = collision.plate_stiffness_n_per_m, collision.plate_mass_kg
            at_meeting = row.clocked(given, *plate, touch_time_s + _begin_of_interaction(rows, values, collision)[0])
            given = tuple(float(value) for value in at_meeting)
        out.append(ActiveEffect(row, given))
    return out


def chain_rules(
    rows: Sequence[Effect], values: Mapping[Effect, Mapping[str, float]], collision: Collision, touch_time_s: float
) -> list[ChainRule]:
    """Return the chain rules of clocked effects, by exact complex steps; ``slot`` counts as in ``active_effects``."""
    out = []
    for slot, row in enumerate(row for row in rows if row.kernel is not None):
        if row.clocked is None:
            continue
        earlier, reach = _begin_of_interaction(rows, values, collision)
        begins = [*(values[row][p.name] for p in row.parameters), *collision.vector[:2], touch_time_s + earlier]
        steps = np.array(begins)[:, None] + 1j * _STEP * np.eye(len(begins))
        count = len(row.parameters)
        given = row.clocked(steps[:count], *steps[count:])
        slopes = np.stack([np.broadcast_to(np.imag(one) / _STEP, (len(begins),)) for one in given])
        names = [*(f"{row.key}.{p.name}" for p in row.parameters), *_PLATE, "touch_time_s"]
        if reach:
            v = collision.velocity_in_m_per_s
            slopes = np.column_stack([slopes, slopes[:, -1] / v, -slopes[:, -1] * earlier / v])
            names += [reach, "velocity_in_m_per_s"]
        out.append(ChainRule(slot, tuple(names), slopes))
    return out


def chain_matrix(chains: Sequence[ChainRule], names: Sequence[str], of_base: Mapping[str, int]) -> Floats:
    """Return the matrix, shape (p + 3 c, p), that applies c chain rules to derivatives with respect to p ``names``.

    ``of_base`` maps those names that are plate or contact parameters to their indices in ``KERNEL_ORDER``.
    """
    rows, here = [np.eye(len(names))], {KERNEL_ORDER[place]: name for name, place in of_base.items()}
    for chain in chains:
        slopes = np.zeros((chain.slopes.shape[0], len(names)))
        for name, column in zip((here.get(name, name) for name in chain.names), chain.slopes.T, strict=True):
            if name in names:
                slopes[:, list(names).index(name)] += column
        rows.append(slopes)
    return np.concatenate(rows)


def _begin_of_interaction(
    rows: Sequence[Effect], values: Mapping[Effect, Mapping[str, float]], collision: Collision
) -> tuple[float, str]:
    """Return when the interaction begins, in s from the touch (at most 0), and the name of the longest range."""
    reaches = [(values[row][row.parameters[row.range_at].name], row) for row in rows if row.range_at >= 0]
    if not reaches:
        return 0.0, ""
    farthest, row = max(reaches, key=lambda one: one[0])
    return farthest / collision.velocity_in_m_per_s, f"{row.key}.{row.parameters[row.range_at].name}"

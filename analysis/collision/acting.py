"""The mechanical effects of one shot with their values, as the solver takes them, and effects on the recording's clock.

A vibration runs on the recording's clock, so its phase at the first touch depends on the touch time and, as the plate
responds to it, on the plate's stiffness and mass.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision.effects.row import Effect
from analysis.collision.parameters import Collision, Floats, kernel_order
from analysis.collision.slots import Active

_STEP = 1e-40  # of a complex step
_PLATE = kernel_order[:2]  # stiffness and mass


@dataclass(frozen=True, slots=True)
class ChainRule:
    """How the three values given to a kernel depend on parameters: their ``names``, and the derivatives, (3, n)."""

    slot: int
    names: tuple[str, ...]
    slopes: Floats


def active_effects(
    rows: Sequence[Effect], values: Mapping[Effect, Mapping[str, float]], collision: Collision, touch_time_s: float
) -> list[Active]:
    """Return the effects that act on the motion, in the order of ``rows``; ``values`` by effect and parameter."""
    out = []
    for row in rows:
        if row.kernel is None:
            continue
        given = tuple(values[row][p.name] for p in row.parameters)
        if row.clocked is not None:
            plate = collision.plate_stiffness_n_per_m, collision.plate_mass_kg
            at_meeting = row.clocked(given, *plate, touch_time_s + _earlier(rows, values, collision)[0])
            given = tuple(float(value) for value in at_meeting)
        out.append(Active(row, given))
    return out


def chain_rules(
    rows: Sequence[Effect], values: Mapping[Effect, Mapping[str, float]], collision: Collision, touch_time_s: float
) -> list[ChainRule]:
    """Return the chain rules of clocked effects, by exact complex steps; ``slot`` is as in ``active_effects``."""
    out = []
    for slot, row in enumerate(row for row in rows if row.kernel is not None):
        if row.clocked is None:
            continue
        earlier, reach = _earlier(rows, values, collision)
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
    """Return the matrix, (p + 3 c, p), that turns derivatives by p ``names`` and c kernels' values into those by names.

    ``of_base`` gives the place in ``kernel_order`` of those names that are the shot's plate or contact parameters.
    """
    rows, here = [np.eye(len(names))], {kernel_order[place]: name for name, place in of_base.items()}
    for chain in chains:
        slopes = np.zeros((chain.slopes.shape[0], len(names)))
        for name, column in zip((here.get(name, name) for name in chain.names), chain.slopes.T, strict=True):
            if name in names:
                slopes[:, list(names).index(name)] += column
        rows.append(slopes)
    return np.concatenate(rows)


def _earlier(
    rows: Sequence[Effect], values: Mapping[Effect, Mapping[str, float]], collision: Collision
) -> tuple[float, str]:
    """Return when the bodies begin to act on each other, in s from the touch, and the name of the longest range."""
    reaches = [(values[row][row.parameters[row.range_at].name], row) for row in rows if row.range_at >= 0]
    if not reaches:
        return 0.0, ""
    farthest, row = max(reaches, key=lambda one: one[0])
    return farthest / collision.velocity_in_m_per_s, f"{row.key}.{row.parameters[row.range_at].name}"

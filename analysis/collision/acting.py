"""What acts on the motion of one shot, as the solver takes it: effects with their values, and their clocks.

What goes on by the recording's clock, shot or no shot, is at another point of its way when the bodies meet; where that
is depends on the touch time and, as the plate follows it, on the plate.
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
class Chained:
    """The parameters of one shot that come to a kernel by way of others: ``names``, and d(given)/d(those), (3, n)."""

    slot: int
    names: tuple[str, ...]
    slopes: Floats


def acting(
    rows: Sequence[Effect], values: Mapping[str, Mapping[str, float]], collision: Collision, touch_time_s: float
) -> list[Active]:
    """Return those of the effects that act on the motion, with their values by effect and parameter; as ``rows``."""
    out = []
    for row in rows:
        if row.kernel is None:
            continue
        given = tuple(values[row.name][p.name] for p in row.parameters)
        if row.clocked is not None:
            plate = collision.plate_stiffness_n_per_m, collision.plate_mass_kg
            told = row.clocked(given, *plate, touch_time_s + _earlier(rows, values, collision)[0])
            given = tuple(float(value) for value in told)
        out.append(Active(row, given))
    return out


def chained(
    rows: Sequence[Effect], values: Mapping[str, Mapping[str, float]], collision: Collision, touch_time_s: float
) -> list[Chained]:
    """Return how what is clocked depends on parameters, by exact complex steps; ``slot`` is a place in ``acting``."""
    out = []
    for slot, row in enumerate(row for row in rows if row.kernel is not None):
        if row.clocked is None:
            continue
        earlier, reach = _earlier(rows, values, collision)
        begins = [*(values[row.name][p.name] for p in row.parameters), *collision.vector[:2], touch_time_s + earlier]
        steps = np.array(begins)[:, None] + 1j * _STEP * np.eye(len(begins))
        count = len(row.parameters)
        told = row.clocked(steps[:count], *steps[count:])
        slopes = np.stack([np.broadcast_to(np.imag(one) / _STEP, (len(begins),)) for one in told])
        names = [*(f"{row.name}.{p.name}" for p in row.parameters), *_PLATE, "touch_time_s"]
        if reach:
            v = collision.velocity_in_m_per_s
            slopes = np.column_stack([slopes, slopes[:, -1] / v, -slopes[:, -1] * earlier / v])
            names += [reach, "velocity_in_m_per_s"]
        out.append(Chained(slot, tuple(names), slopes))
    return out


def through(chains: Sequence[Chained], names: Sequence[str], of_base: Mapping[str, int]) -> Floats:
    """Return what makes derivatives by p ``names`` of those by them and by what c kernels are given, (p + 3 c, p).

    ``of_base`` says which names are the shot's plate's and contact's in ``kernel_order``.
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
    rows: Sequence[Effect], values: Mapping[str, Mapping[str, float]], collision: Collision
) -> tuple[float, str]:
    """Return when the bodies begin to act on each other, in s from the touch, and what gives the reach, if any does."""
    reaches = [(values[row.name][row.parameters[row.range_at].name], row) for row in rows if row.range_at >= 0]
    if not reaches:
        return 0.0, ""
    farthest, row = max(reaches, key=lambda one: one[0])
    return farthest / collision.velocity_in_m_per_s, f"{row.name}.{row.parameters[row.range_at].name}"

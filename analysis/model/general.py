"""The model with effects: solved at any times, with derivatives by any of its parameters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.model.exact import Event, TooManyEvents
from analysis.model.parameters import Collision, Floats
from analysis.model.phases import CONTACT, FREE, MAX_EVENTS, OVERLAPPED, PARTING
from analysis.model.rates import SLOT_PARAMETERS
from analysis.model.slots import Active as Active
from analysis.model.slots import lay_out, swings

_BASE_STEP = 0.14  # radians of the fastest swing of block, contact and plate a step: 1e-12 of the displacement
_HIDDEN_STEP = 0.22  # of an effect's own swing, which is small beside the motion
_LONGEST_S = 1e-3


@dataclass(frozen=True, slots=True)
class GeneralRun:
    """A collision with mechanical effects at the asked times, arrays of shape (n,); time zero is the first touch.

    ``displacement_derivatives`` has shape (n, k), by the ``directions`` asked for.
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    plate_displacement_m: Floats
    contact_point_m: Floats
    events: tuple[Event, ...]
    displacement_derivatives: Floats

    @property
    def gap_m(self) -> Floats:
        """Get the gap between block and contact point; negative: they overlap."""
        return self.displacement_m - self.contact_point_m

    @property
    def released(self) -> Event | None:
        """Get the last release, or None while the block is in contact at the end."""
        changes = [event for event in self.events if event.kind in ("touch", "release")]
        return changes[-1] if changes and changes[-1].kind == "release" else None


class RunsAway(ArithmeticError):
    """The parameters make the motion grow without bound."""


def direction(slot: int, place: int) -> int:
    """Return the direction of an effect's parameter: the ``place``-th of the effect in ``slot``."""
    return SLOT_PARAMETERS + 3 * slot + place


def solve(
    collision: Collision,
    effects: Sequence[Active],
    time_s: Floats,
    *,
    directions: Sequence[int] = (),
    stride: float = 1.0,
    block: int = 1,
) -> GeneralRun:
    """Solve ``collision`` with mechanical ``effects`` at ``time_s``, shape (n,), ascending.

    ``directions`` are indices into ``parameters.kernel_order`` (0 to 6) and ``direction(slot, place)``, a slot being a
    place in ``effects``; the block's mass (7) is not among them.  Before the touch only what acts on the block and
    has no hidden state takes part: what rides inside has come to rest.  ``block``: everything but the events is a mean
    over so many samples, the last ones left out where they do not fill one.

    Effects that are linear in the state are solved to rounding.  Where one is not, ``stride`` lengthens the steps: 2
    takes 0.6 of the time and shows the displacement of a millimetre to 0.05 pm instead of 0.001 pm.
    Raises TooManyEvents, RunsAway, ValueError.
    """
    from analysis.model import hybrid, linear  # compiled on first use: the base model does without them

    times = np.ascontiguousarray(time_s, dtype=np.float64)
    if times.ndim != 1 or times.size < block or times.size == 0 or not np.all(np.diff(times) >= 0):
        raise ValueError("time_s must be one-dimensional, not empty and ascending")
    laid = lay_out(collision, effects, carrying=True)
    which = np.asarray(directions, dtype=np.int64)
    variant, k = int(collision.variant), which.size
    event_time, event_kind = np.empty(MAX_EVENTS), np.empty(MAX_EVENTS, dtype=np.int64)
    event_d_time = np.empty((MAX_EVENTS, k))
    count = linear.NOT_LINEAR
    if all(active.effect.range_at < 0 and not active.effect.bent for active in effects):
        size, n = 4 + laid.hidden, times.size // block
        states, d_x = np.empty((n, 5)), np.empty((n, k))
        event_state, event_d_state = np.empty((MAX_EVENTS, size)), np.empty((MAX_EVENTS, k, size))
        closed: Any = linear.integrate
        count = closed(
            times, block, laid.p, which, variant, laid.slots, size, _rates(collision, effects),
            laid.functions, laid.carrying,
            states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
        )  # fmt: skip
    if count == linear.NOT_LINEAR:
        size, n = 4 + 4 * math.ceil(laid.hidden / 4), times.size  # the kernel counts in fours
        states, d_x = np.empty((n, 5)), np.empty((n, k))
        event_state, event_d_state = np.empty((MAX_EVENTS, size)), np.empty((MAX_EVENTS, k, size))
        stepped: Any = hybrid.integrate
        count = stepped(
            times, laid.p, which, variant, laid.slots, _steps(collision, effects, stride),
            laid.functions, laid.carrying,
            states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
        )  # fmt: skip
        states, d_x = averaged(states, block), averaged(d_x, block)
    if count == -1:
        raise TooManyEvents(f"more than {MAX_EVENTS} contact events with {collision}")
    if count < 0:
        raise RunsAway(f"the motion grows without bound with {collision}")
    events = tuple(
        Event(
            _kind(int(event_kind[e])),
            float(event_time[e]),
            event_state[e, : 4 + laid.hidden].copy(),
            event_d_time[e].copy(),
            event_d_state[e, :, : 4 + laid.hidden].copy(),
        )
        for e in range(count)
    )
    return GeneralRun(averaged(times, block), states[:, 0], states[:, 1], states[:, 2], states[:, 4], events, d_x)


def averaged(columns: Floats, block: int) -> Floats:
    """Return ``columns``, shape (n,) or (n, k), as means over blocks of rows; an incomplete one is left out."""
    if block == 1:
        return columns
    count = columns.shape[0] // block
    blocks = columns[: count * block].reshape((count, block, *columns.shape[1:]))
    return np.asarray(np.einsum("nb...->n...", blocks) / block)  # a mean over so short an axis takes four times as long


_KIND = {
    (FREE, CONTACT): "touch",
    (OVERLAPPED, CONTACT): "touch",
    (CONTACT, FREE): "release",
    (CONTACT, OVERLAPPED): "release",
    (PARTING, FREE): "release",
    (CONTACT, PARTING): "damping_off",
    (PARTING, CONTACT): "damping_on",
    (OVERLAPPED, FREE): "apart",
    (9, 0): "turn",
}


def _kind(code: int) -> str:
    return _KIND.get((code // 10, code % 10), "range")


def _rates(collision: Collision, effects: Sequence[Active]) -> Floats:
    """Return the fastest rates in rad/s in contact, apart, gone, and before the touch."""
    rates = swings(collision, effects)
    contact, apart = math.hypot(rates.contact, rates.every), math.hypot(rates.plate, rates.every)
    return np.array([contact, apart, rates.inside, 0.0])


def _steps(collision: Collision, effects: Sequence[Active], stride: float) -> Floats:
    """Return the longest steps in s (in contact, apart, gone, before the touch), their growth and nearing."""
    rates = swings(collision, effects)

    def longest(base: float, own: float) -> float:
        return min(stride * min(_BASE_STEP / max(base, 1e-9), _HIDDEN_STEP / max(own, 1e-9)), _LONGEST_S)

    contact, apart = longest(rates.contact, rates.every), longest(rates.plate, rates.every)
    steps = [contact, apart, longest(0.0, rates.inside), _LONGEST_S]
    # A law that is not smooth where the overlap begins is stepped away from, and up to, in short strides.
    rough = any(active.effect.rough for active in effects)
    return np.array([*steps, *((1.35, 0.4) if rough else (3.0, 0.0))])

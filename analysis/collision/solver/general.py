"""Solve a collision with effects at any times, with derivatives with respect to any of its parameters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.collision.parameters import Collision, Floats, Infeasible
from analysis.collision.solver import march
from analysis.collision.solver.mechanical_effects import ActiveEffect as ActiveEffect
from analysis.collision.solver.mechanical_effects import FastestRates, build_system, fastest_rates
from analysis.collision.solver.mechanical_effects import direction as direction
from analysis.collision.solver.modes import CONTACT, FREE, NEAR_0, OVERLAPPED, PARTING
from analysis.collision.solver.system import MAX_EVENTS, Record, System

_BASE_STEP = 0.14  # phase step, in rad, of the fastest oscillation of block, contact and plate: error 1e-12
_HIDDEN_STEP = 0.22  # phase step, in rad, of an effect's own oscillation, which is small compared with the motion
_LONGEST_S = 1e-3
_ERROR_M, _ORDER = 1e-18, 12  # allowed error of steps beyond the safe length; it grows with this power of the stride


@dataclass(frozen=True, slots=True)
class Event:
    """A change of mode: ``kind`` "touch", "release", "damping_off", "damping_on", "turn", ...; time from first touch.

    ``state`` is (x_b, v_b, x_p, v_p, hidden states); ``state_derivatives``, shape (k, 4 or more), are its total
    derivatives in the k requested directions, those of the event's time included.
    """

    kind: str
    time_s: float
    state: Floats
    state_derivatives: Floats


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A solved collision, arrays of shape (n,); time zero is the first touch.

    ``displacement_derivatives``, shape (n, k), has one column for each of the requested ``directions``.
    """

    collision: Collision
    displacement_m: Floats
    velocity_m_per_s: Floats
    plate_displacement_m: Floats
    plate_velocity_m_per_s: Floats
    contact_point_m: Floats
    displacement_derivatives: Floats
    log: "EventLog"
    sample_time_s: Floats
    block: int = 1

    @property
    def time_s(self) -> Floats:
        """Get the times, shape (n,): means over ``block`` of the sample times."""
        return averaged(self.sample_time_s, self.block)

    @property
    def events(self) -> tuple[Event, ...]:
        """Get the changes of mode in order (see ``EventLog.events``)."""
        return self.log.events

    @property
    def gap_m(self) -> Floats:
        """Get the gap between block and contact point; negative: overlap."""
        return self.displacement_m - self.contact_point_m

    @property
    def force_n(self) -> Floats:
        """Get the contact force on the block without effects (Eq. 9); zero while the bodies are apart."""
        c, events = self.collision, self.events
        rate = self.plate_velocity_m_per_s - self.velocity_m_per_s
        index = np.searchsorted([event.time_s for event in events], self.time_s, side="right") - 1
        touching = np.array([event.kind != "release" for event in events])[index] & (index >= 0)
        damped = np.array([event.kind in ("touch", "damping_on") for event in events])[index]
        force = np.where(damped, c.contact_damping_n_s_per_m * rate, 0.0) - c.contact_stiffness_n_per_m * self.gap_m
        return np.where(touching, force, 0.0)

    @property
    def released(self) -> Event | None:
        """Get the last release, or None while the block is in contact at the end."""
        return self.log.released


@dataclass(frozen=True, slots=True)
class EventLog:
    """The events as the kernel recorded them; an event is copied only when it is read, because most never are."""

    kinds: tuple[str, ...]
    record: Record

    @property
    def events(self) -> tuple[Event, ...]:
        """Get all events in order, except the end of an overlap that outlasts the release."""
        return tuple(self._event(place) for place, kind in enumerate(self.kinds) if kind != "apart")

    def _event(self, place: int) -> Event:
        record = self.record
        return Event(
            self.kinds[place],
            float(record.event_time[place]),
            record.event_state[place].copy(),
            record.event_d_state[place].copy(),
        )

    @property
    def released(self) -> Event | None:
        """Get the last release, or None while the block is in contact at the end."""
        for place in range(len(self.kinds) - 1, -1, -1):
            if self.kinds[place] in ("touch", "release"):
                return self._event(place) if self.kinds[place] == "release" else None
        return None


def solve(
    collision: Collision,
    effects: Sequence[ActiveEffect],
    time_s: Floats,
    *,
    directions: Sequence[int] = (),
    stride: float = 1.0,
    block: int = 1,
    rates: FastestRates | None = None,
) -> Trajectory:
    """Solve ``collision`` with mechanical ``effects`` at ``time_s``, shape (n,), ascending.

    ``directions`` are indices into ``parameters.KERNEL_ORDER`` (0 to 6; not the block's mass, 7) and
    ``direction(slot, place)``; a slot is an index into ``effects``.  Before the touch only effects on the block without
    a hidden state act; a mass inside the block is at rest.  All outputs except the events are means over ``block``
    samples; an incomplete last block is left out.  ``rates`` are the ``fastest_rates``, if they are known.

    Effects that are linear in the state are solved to rounding error.  For others ``stride`` lengthens the steps: a
    stride of 2 takes 0.6 of the time, and its error is 0.05 pm instead of 0.001 pm for a displacement of a millimetre.
    A chain of forty changes of the contact can magnify either fifty times.  Kinks are not located as events, so the
    stride is then at most 1: a hinge of 5 N/m causes an error of 3 pm (130 pm at stride 2), one of 50 N/m 30 pm.
    Raises ValueError, and Infeasible if the contact chatters, if the motion oscillates so fast that a
    solution would take minutes, or if it grows without bound.
    """
    rates = rates or fastest_rates(collision, effects)
    record = _solved(collision, effects, time_s, rates, directions=directions, stride=stride, block=block)
    left = block // record.block
    states, d_x = averaged(record.states, left), averaged(record.d_x, left)
    kinds = tuple(map(_kind, record.event_kind.tolist()))
    x, v, y, u, point = states[:, :5].T
    return Trajectory(collision, x, v, y, u, point, d_x, EventLog(kinds, record), record.times, block)


def solve_with_modes(
    collision: Collision, effects: Sequence[ActiveEffect], time_s: Floats, spacing_s: float = 0.0
) -> Record:
    """Solve as ``solve`` does, and return all that was recorded; ``spacing_s`` is the spacing of most times.

    The events are those that occurred, each with the mode after it.  The states include the hidden states.
    """
    return _solved(collision, effects, time_s, fastest_rates(collision, effects), spacing_s=spacing_s)


def _solved(
    collision: Collision,
    effects: Sequence[ActiveEffect],
    time_s: Floats,
    rates: FastestRates,
    *,
    directions: Sequence[int] = (),
    stride: float = 1.0,
    block: int = 1,
    spacing_s: float | None = None,
) -> Record:
    """Return the solution; with ``spacing_s``, the spacing of most times (0: unknown), also the hidden states."""
    times = np.ascontiguousarray(time_s, dtype=np.float64)
    if times.ndim != 1 or times.size < block or not np.all(times[1:] >= times[:-1]):
        raise ValueError("time_s must be one-dimensional, not empty and ascending")
    system = build_system(collision, effects, directions)
    numbers = system.numbers
    shown = 5 if spacing_s is None else 1 + numbers
    record = _record(times, block, system, shown)
    closed: Any = march.in_closed_form
    count = march.NOT_LINEAR
    if not any(active.effect.nonlinear for active in effects):
        room = np.zeros(march.room_for(system, record))
        count = closed(system, record, np.array([*rates.of_modes, spacing_s or 0.0]), room)
    if count == march.NOT_LINEAR:
        record = _record(times, 1, system, shown)
        stepped: Any = march.step_by_step
        room = np.zeros(march.room_for(system, record))
        count = stepped(system, record, _limits(rates, effects, stride), room)
    assert count != march.NO_ROOM
    if count == march.TOO_MANY_EVENTS:
        raise Infeasible(f"more than {MAX_EVENTS} contact events")
    if count == march.TOO_MANY_STEPS:
        raise Infeasible("more steps than a solution may take")
    if count < 0:
        raise Infeasible("the motion grows without bound")
    return record._replace(
        event_time=record.event_time[:count],
        event_kind=record.event_kind[:count],
        event_state=record.event_state[:count, :numbers],
        event_mode=record.event_mode[:count],
        event_d_state=record.event_d_state[:count, :, :numbers],
    )


def _record(times: Floats, block: int, system: System, shown: int) -> Record:
    """Return the arrays that the kernels fill for ``times``; states are padded to a multiple of four numbers."""
    k, slots, samples = system.which.size, system.slots.shape[0], times.size // block
    size = 4 * math.ceil(system.numbers / 4)
    return Record(
        times,
        block,
        np.empty((samples, shown)),
        np.empty((samples, k)),
        np.empty(MAX_EVENTS),
        np.empty(MAX_EVENTS, dtype=np.int64),
        np.empty((MAX_EVENTS, size)),
        np.empty((MAX_EVENTS, NEAR_0 + slots)),
        np.empty((MAX_EVENTS, k, size)),
    )


def averaged(columns: Floats, block: int) -> Floats:
    """Return ``columns``, shape (n,) or (n, k), as means over blocks of rows; an incomplete block is left out."""
    if block == 1:
        return columns
    count = columns.shape[0] // block
    blocks = columns[: count * block].reshape((count, block, *columns.shape[1:]))
    return np.asarray(np.einsum("nb...->n...", blocks) / block)  # four times faster than mean() on an axis this short


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


def _limits(rates: FastestRates, effects: Sequence[ActiveEffect], stride: float) -> Floats:
    """Return the ``limits`` of ``RungeKutta``."""
    if any(active.effect.kinked for active in effects):
        stride = min(stride, 1.0)

    def longest(base: float, own: float) -> float:
        return min(stride * min(_BASE_STEP / max(base, 1e-9), _HIDDEN_STEP / max(own, 1e-9)), _LONGEST_S)

    safe = [longest(rates.contact, rates.effects), longest(rates.plate, rates.effects)]
    safe += [longest(0.0, rates.on_block), _LONGEST_S]
    # A law that is not smooth at the start of the overlap may have an infinite slope there, and the error of a step
    # grows with its length.  Short steps are therefore taken before and after.
    rough = any(active.effect.rough for active in effects)
    growth, nearing, shortest = (1.6, 0.4, 1e-8) if rough else (3.0, 0.0, 1e-4)
    allowed = _ERROR_M * stride**_ORDER
    return np.array([*safe, *rates.of_modes, longest(0.0, rates.effects), growth, nearing, allowed, shortest])

"""The paper's model solved exactly between its contact events: state, events and derivatives at any times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.model import phases
from analysis.model.parameters import Collision, Floats


@dataclass(frozen=True, slots=True)
class Event:
    """The model changes its phase: ``kind`` "touch", "release", "damping_off" or "damping_on"; time from first touch.

    ``state`` is (x_b, v_b, x_p, v_p).  The derivatives are total ones, by the first seven of
    ``parameters.kernel_order``: of the event's time, shape (7,), and of the state at that event, shape (7, 4);
    empty where no derivatives were asked for.
    """

    kind: str
    time_s: float
    state: Floats
    time_derivatives: Floats
    state_derivatives: Floats


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A solved collision at the asked times; arrays of shape (n,), time zero is the first touch.

    ``displacement_derivatives`` has shape (n, 7), by the first seven of ``parameters.kernel_order`` (or (0, 7)).
    """

    collision: Collision
    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    plate_displacement_m: Floats
    plate_velocity_m_per_s: Floats
    events: tuple[Event, ...]
    displacement_derivatives: Floats

    @property
    def gap_m(self) -> Floats:
        """Get x_b - x_p; negative: the bodies overlap."""
        return self.displacement_m - self.plate_displacement_m

    @property
    def force_n(self) -> Floats:
        """Get the contact force on the block (Eq. 9; zero where the bodies are apart)."""
        c = self.collision
        overlap = -self.gap_m
        rate = self.plate_velocity_m_per_s - self.velocity_m_per_s
        touching, damped = self._phases_at(self.time_s)
        force = c.contact_stiffness_n_per_m * overlap + np.where(damped, c.contact_damping_n_s_per_m * rate, 0.0)
        return np.where(touching, force, 0.0)

    def _phases_at(self, time_s: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        starts = np.array([event.time_s for event in self.events])
        index = np.searchsorted(starts, time_s, side="right") - 1
        touching = np.array([event.kind != "release" for event in self.events])
        damped = np.array([event.kind in ("touch", "damping_on") for event in self.events])
        before = index < 0
        index = np.clip(index, 0, None)
        return touching[index] & ~before, damped[index] & ~before

    @property
    def released(self) -> Event | None:
        """Get the last release, or None while the block is still in contact at the end of the asked times."""
        last = self.events[-1]
        return last if last.kind == "release" else None


_KIND = {
    (phases.FREE, phases.CONTACT): "touch",
    (phases.OVERLAPPED, phases.CONTACT): "touch",
    (phases.CONTACT, phases.FREE): "release",
    (phases.CONTACT, phases.OVERLAPPED): "release",
    (phases.PARTING, phases.FREE): "release",
    (phases.CONTACT, phases.PARTING): "damping_off",
    (phases.PARTING, phases.CONTACT): "damping_on",
}


class TooManyEvents(ArithmeticError):
    """The parameters make the contact chatter: no trajectory is given."""


def solve(collision: Collision, time_s: Floats, *, derivatives: bool = False) -> Trajectory:
    """Solve ``collision`` at ``time_s``, shape (n,), ascending, in s from the first touch.

    Before the touch the block flies freely.  Events are located to about 1e-17 s, the state to rounding
    (about 1e-13 relative over a contact).  Raises TooManyEvents and, for times out of order, ValueError.
    """
    times = np.ascontiguousarray(time_s, dtype=np.float64)
    if times.ndim != 1 or times.size == 0 or not np.all(np.diff(times) >= 0):
        raise ValueError("time_s must be one-dimensional, not empty and ascending")
    n, most = times.size, phases.MAX_EVENTS
    rows = phases.COLUMNS + 1 if derivatives else 1
    states = np.empty((n, 4))
    d_x = np.empty((n if derivatives else 0, phases.COLUMNS))
    event_time, event_kind = np.empty(most), np.empty(most, dtype=np.int64)
    event_state, event_d_time = np.empty((most, 4)), np.empty((most, phases.COLUMNS))
    event_d_state = np.empty((most, phases.COLUMNS, 4))
    count = phases.solve(
        times,
        collision.vector,
        int(collision.variant),
        rows,
        states,
        d_x,
        event_time,
        event_kind,
        event_state,
        event_d_time,
        event_d_state,
    )
    if count < 0:
        raise TooManyEvents(f"more than {most} contact events with {collision}")
    events = []
    for k in range(count):
        kind = _KIND.get(divmod(int(event_kind[k]), 10))
        if kind is not None:
            last = derivatives
            events.append(
                Event(
                    kind,
                    float(event_time[k]),
                    event_state[k].copy(),
                    event_d_time[k].copy() if last else np.empty(0),
                    event_d_state[k].copy() if last else np.empty((0, 4)),
                )
            )
    return Trajectory(collision, times, states[:, 0], states[:, 1], states[:, 2], states[:, 3], tuple(events), d_x)

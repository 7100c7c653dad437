"""The exact solution of the paper's model, without effects: state, events and derivatives at any times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.collision import general
from analysis.collision.general import Event, TooManyEvents
from analysis.collision.parameters import Collision, Floats


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A solved collision; arrays of shape (n,), time zero is the first touch.

    ``displacement_derivatives`` has shape (n, 7), by the first seven of ``parameters.kernel_order`` (or (n, 0)).
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
        """Get the last release, None if the block is still in contact at the end."""
        last = self.events[-1]
        return last if last.kind == "release" else None


def solve(collision: Collision, time_s: Floats, *, derivatives: bool = False) -> Trajectory:
    """Solve ``collision`` at ``time_s``, shape (n,), ascending, in s from the first touch.

    Before the touch the block flies freely.  Events are located to about 1e-17 s, the state to rounding
    (about 1e-13 relative over a contact).  Raises TooManyEvents and, for times out of order, ValueError.
    """
    run = general.solve(collision, (), time_s, directions=range(7) if derivatives else ())
    return Trajectory(
        collision,
        run.time_s,
        run.displacement_m,
        run.velocity_m_per_s,
        run.plate_displacement_m,
        run.plate_velocity_m_per_s,
        tuple(event for event in run.events if event.kind != "apart"),
        run.displacement_derivatives,
    )


__all__ = ["Event", "TooManyEvents", "Trajectory", "solve"]

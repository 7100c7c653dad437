"""The fitted model laid over the measurement: on its time grid, through its filters."""


import numpy as np

from analysis.fit import Overlay
from analysis.model.exact import Trajectory
from analysis.model.parameters import Floats
from analysis.motion import Motion


def lay_over(motion: Motion, run: Trajectory, displacement_m: Floats, touch_time_s: float) -> Overlay:
    """Return the overlay of a solved shot; ``displacement_m`` is the model's, as the optics would see it."""
    events = tuple((e.kind, e.time_s + touch_time_s) for e in run.events if e.kind in ("touch", "release"))
    velocity = np.gradient(displacement_m, motion.time_s)
    force = motion.moving_mass_kg * np.gradient(velocity, motion.time_s)
    return Overlay(
        time_s=motion.time_s,
        displacement_m=displacement_m,
        velocity_m_per_s=velocity,
        force_n=force,
        deflection_m=run.plate_displacement_m,
        gap_m=run.gap_m,
        events_s=events,
    )

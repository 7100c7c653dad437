"""The fitted model laid over the measurement: on its time grid, through its filters."""

from analysis.collision.parameters import Floats
from analysis.shot.fit import Overlay
from analysis.shot.motion import Motion
from analysis.signal.filters import derivatives


def lay_over(
    motion: Motion,
    displacement_m: Floats,
    plate_displacement_m: Floats,
    gap_m: Floats,
    events_s: tuple[tuple[str, float], ...],
) -> Overlay:
    """Return the overlay of a solved shot; ``displacement_m`` is the model's as the optics would see it.

    Velocity and force are its derivatives through the motion's own filters, so that model and measurement are
    smeared alike.
    """
    velocity, acceleration = derivatives(displacement_m, motion.sample_rate_hz, motion.bandwidth_hz)
    return Overlay(
        time_s=motion.time_s,
        displacement_m=displacement_m,
        velocity_m_per_s=velocity,
        force_n=motion.moving_mass_kg * acceleration,
        deflection_m=plate_displacement_m,
        gap_m=gap_m,
        events_s=events_s,
    )

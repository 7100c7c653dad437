"""The simulated plate's position, which the rig does not measure."""

from instrument.bench import forces as slot
from instrument.bench.forces import Floats
from instrument.bench.mechanics import Trajectory
from instrument.bench.sines import interpolate


def plate_m(run: Trajectory, time_s: Floats) -> Floats:
    """Return the plate's position at ascending times, cubic between nodes."""
    return interpolate(run.time_s, run.states[:, slot.PLATE_X].copy(), run.states[:, slot.PLATE_V].copy(), time_s)

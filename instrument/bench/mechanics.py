"""Simulate a collision of block and plate from a start velocity."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from instrument.bench import forces as slot
from instrument.bench.frame import Frame
from instrument.bench.integrator import STILL, FrameAcceleration, frame_acceleration, integrate
from instrument.bench.sines import interpolate

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bodies:
    """Masses, stiffnesses and damping of block, plate and contact; defaults from the paper's simulation section."""

    block_mass_kg: float = 17.85e-3
    plate_mass_kg: float = 1.984e-4
    plate_stiffness_n_per_m: float = 221.4
    contact_stiffness_n_per_m: float = 1e4
    contact_damping_n_s_per_m: float = 0.4


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The motion at nodes in time; arrays have shape (n,), and ``states`` (n, 13) has the columns of forces.py.

    Positions and velocities are relative to the frame.  Time zero is the start of the flight.
    ``events`` are ("touch" | "release", time in s), in order.
    """

    time_s: Floats
    states: Floats
    acceleration_m_per_s2: Floats  # of the block
    events: tuple[tuple[str, float], ...]
    velocity_in_m_per_s: float  # just before the first touch; nan without a touch
    velocity_out_m_per_s: float  # just after the last release; nan without a release

    @property
    def touch_time_s(self) -> float:
        """Get the time of the first touch in s, nan without a touch."""
        return next((time for what, time in self.events if what == "touch"), float("nan"))

    @property
    def release_time_s(self) -> float:
        """Get the time of the last release in s, nan without a release."""
        return next((time for what, time in reversed(self.events) if what == "release"), float("nan"))

    def block_m(self, time_s: Floats) -> Floats:
        """Return the block's position at ``time_s`` (ascending), cubic between nodes: error below 1 pm."""
        return self._interpolated(slot.BLOCK_X, slot.BLOCK_V, time_s)

    def block_velocity_m_per_s(self, time_s: Floats) -> Floats:
        """Return the block's velocity at ``time_s`` (ascending)."""
        return interpolate(self.time_s, self.states[:, slot.BLOCK_V].copy(), self.acceleration_m_per_s2, time_s)

    def plate_m(self, time_s: Floats) -> Floats:
        """Return the plate's position at ``time_s`` (ascending)."""
        return self._interpolated(slot.PLATE_X, slot.PLATE_V, time_s)

    def _interpolated(self, position: int, velocity: int, time_s: Floats) -> Floats:
        return interpolate(self.time_s, self.states[:, position].copy(), self.states[:, velocity].copy(), time_s)


@njit(cache=True, nogil=True, error_model="numpy")
def _accelerations(
    time_s: Floats, states: Floats, on: NDArray[np.int64], p: Floats, drive: FrameAcceleration
) -> Floats:
    dy = np.empty(slot.STATES)
    result = np.empty(states.shape[0])
    for i in range(states.shape[0]):
        slot.rates(states[i], p, on[i], frame_acceleration(drive, time_s[i]), dy)
        result[i] = dy[slot.BLOCK_V]
    return result


def parameters(bodies: Bodies, extra: Mapping[int, float] | None = None) -> Floats:
    """Return the parameter array of forces.py for ``bodies``, with further parameters from ``extra`` (index: value)."""
    p = np.zeros(slot.PARAMETERS)
    p[slot.M_BLOCK] = bodies.block_mass_kg
    p[slot.M_PLATE] = bodies.plate_mass_kg
    p[slot.K_PLATE] = bodies.plate_stiffness_n_per_m
    p[slot.K_CONTACT] = bodies.contact_stiffness_n_per_m
    p[slot.C_CONTACT] = bodies.contact_damping_n_s_per_m
    p[slot.CONTACT_XI0] = 1e-5
    for index, value in (extra or {}).items():
        p[index] = value
    return p


def _fine_steps_s(p: Floats, steps_s: tuple[float, float], speed_m_per_s: float) -> tuple[float, float]:
    """Return steps in contact and in flight that resolve the fastest resonance and the bristles."""
    contact_s, flight_s = steps_s
    fastest = max(p[slot.W_HIDDEN], p[slot.W_MODE], p[slot.W_CLAMP])
    if fastest:  # error per step: 1e-9 of the oscillation
        contact_s, flight_s = min(contact_s, 0.1 / fastest), min(flight_s, 0.1 / fastest)
    if p[slot.F_BRISTLE]:
        flight_s = min(flight_s, 0.1 * p[slot.F_BRISTLE] / p[slot.K_BRISTLE] / speed_m_per_s)
        contact_s = min(contact_s, flight_s)
    return contact_s, flight_s


def collide(
    velocity_m_per_s: float,
    *,
    bodies: Bodies | None = None,
    extra: Mapping[int, float] | None = None,
    distance_m: float = 2e-3,
    duration_s: float = 0.06,
    plate_at_touch: tuple[float, float] = (0.0, 0.0),
    steps_s: tuple[float, float] = (4e-6, 1e-5),
    frame: Frame | None = None,
) -> Trajectory:
    """Simulate a block that starts at ``distance_m`` with ``velocity_m_per_s`` (negative: towards the plate).

    ``plate_at_touch`` is the displacement (m) and velocity (m/s) of a freely oscillating plate when the block arrives;
    ``steps_s`` are the steps in contact and in flight.  A ``frame`` has its time zero at the start.  Then distance and
    velocity are relative to space, the trajectory is relative to the frame, and the plate has its stationary response
    to the frame.  Raises ValueError if the block does not move towards the plate or comes to rest against it.
    """
    if not velocity_m_per_s < 0.0:
        raise ValueError(f"the block must start towards the plate: velocity {velocity_m_per_s} m/s is not negative")
    p = parameters(bodies or Bodies(), extra)
    steps_s = _fine_steps_s(p, steps_s, abs(velocity_m_per_s))
    start = np.zeros(slot.STATES)
    start[slot.BLOCK_X] = start[slot.HIDDEN_X] = distance_m
    start[slot.BLOCK_V] = start[slot.HIDDEN_V] = velocity_m_per_s
    w = float(np.sqrt(p[slot.K_PLATE] / p[slot.M_PLATE]))
    x, v = plate_at_touch
    back = w * (distance_m - x) / abs(velocity_m_per_s)
    start[slot.PLATE_X] = x * np.cos(back) - v / w * np.sin(back)
    start[slot.PLATE_V] = x * w * np.sin(back) + v * np.cos(back)
    drive = STILL
    if frame is not None:
        (x,), (v,) = frame.motion(np.zeros(1))
        start[[slot.BLOCK_X, slot.HIDDEN_X]] -= x
        start[[slot.BLOCK_V, slot.HIDDEN_V]] -= v
        start[[slot.PLATE_X, slot.PLATE_V]] += frame.plate_response(w)
        drive = FrameAcceleration(*frame.acceleration(duration_s))
    room = int(duration_s / min(steps_s)) + 20_000
    time_s, states, on = np.empty(room), np.empty((room, slot.STATES)), np.empty((room, slot.SWITCHES), np.int64)
    n = integrate(start, duration_s, steps_s, p, drive, (time_s, states, on))
    if n < 0:
        raise ValueError("the block came to rest against the plate or the bearing: more events than a shot can have")
    time_s, states, on = time_s[:n].copy(), states[:n].copy(), on[:n].copy()
    change = np.diff(on[:, slot.IN_CONTACT])
    events = tuple(("touch" if change[i] > 0 else "release", float(time_s[i + 1])) for i in np.flatnonzero(change))
    at_touch, at_release = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    return Trajectory(
        time_s=time_s,
        states=states,
        acceleration_m_per_s2=_accelerations(time_s, states, on, p, drive),
        events=events,
        velocity_in_m_per_s=float(states[at_touch[0] + 1, slot.BLOCK_V]) if at_touch.size else float("nan"),
        velocity_out_m_per_s=float(states[at_release[-1] + 1, slot.BLOCK_V]) if at_release.size else float("nan"),
    )

"""Simulate a collision of block and plate from a start velocity.

The integration has fixed Dormand-Prince steps; events (touch, release, turnaround, adhesion's range) are bisected.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from instrument.bench import forces as slot
from instrument.bench.forces import Floats
from instrument.bench.frame import Frame
from instrument.bench.sines import interpolate

BISECTIONS = 45  # 10 us / 2^45: below a femtosecond


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
        position, velocity = self.states[:, slot.BLOCK_X].copy(), self.states[:, slot.BLOCK_V].copy()
        return interpolate(self.time_s, position, velocity, time_s)

    def block_velocity_m_per_s(self, time_s: Floats) -> Floats:
        """Return the block's velocity at ``time_s`` (ascending)."""
        return interpolate(self.time_s, self.states[:, slot.BLOCK_V].copy(), self.acceleration_m_per_s2, time_s)


class FrameAcceleration(NamedTuple):
    """Acceleration (m/s2) and jerk (m/s3) of the frame at equally spaced nodes from time zero; empty: at rest."""

    spacing_s: float
    acceleration: Floats
    jerk: Floats


STILL = FrameAcceleration(np.inf, np.array([]), np.array([]))


@njit(cache=True, nogil=True, error_model="numpy")
def frame_acceleration(drive: FrameAcceleration, t: float) -> float:
    """Return the frame's acceleration at ``t``, interpolated cubically between nodes.  Cost: 5 ns."""
    last = drive.acceleration.shape[0] - 2
    if last < 0:
        return 0.0
    h = drive.spacing_s
    j = min(int(t / h), last)
    u = t / h - j
    w = 1.0 - u
    d = drive.acceleration[j + 1] - drive.acceleration[j]
    a = h * drive.jerk[j] - d
    b = d - h * drive.jerk[j + 1]
    return float(drive.acceleration[j] + u * (d + w * (a * w + b * u)))


@njit(cache=True, nogil=True, error_model="numpy")
def _step(
    y: Floats, t: float, h: float, p: Floats, on: NDArray[np.int64], drive: FrameAcceleration, k: Floats, new: Floats
) -> None:
    """Advance ``y`` from ``t`` by ``h`` into ``new``, with constant switches: six stages, fifth order.

    Method: Dormand and Prince (1980).  ``k`` holds the stages' rates and, in its last row, the state of a stage.
    """
    work = k[6]
    slot.rates(y, p, on, frame_acceleration(drive, t), k[0])
    for i in range(slot.STATES):
        work[i] = y[i] + h * (k[0, i] / 5)
    slot.rates(work, p, on, frame_acceleration(drive, t + h / 5), k[1])
    for i in range(slot.STATES):
        work[i] = y[i] + h * (3 / 40 * k[0, i] + 9 / 40 * k[1, i])
    slot.rates(work, p, on, frame_acceleration(drive, t + 0.3 * h), k[2])
    for i in range(slot.STATES):
        work[i] = y[i] + h * (44 / 45 * k[0, i] - 56 / 15 * k[1, i] + 32 / 9 * k[2, i])
    slot.rates(work, p, on, frame_acceleration(drive, t + 0.8 * h), k[3])
    for i in range(slot.STATES):
        work[i] = y[i] + h * (
            19372 / 6561 * k[0, i] - 25360 / 2187 * k[1, i] + 64448 / 6561 * k[2, i] - 212 / 729 * k[3, i]
        )
    slot.rates(work, p, on, frame_acceleration(drive, t + 8 / 9 * h), k[4])
    for i in range(slot.STATES):
        work[i] = y[i] + h * (
            9017 / 3168 * k[0, i]
            - 355 / 33 * k[1, i]
            + 46732 / 5247 * k[2, i]
            + 49 / 176 * k[3, i]
            - 5103 / 18656 * k[4, i]
        )
    slot.rates(work, p, on, frame_acceleration(drive, t + h), k[5])
    for i in range(slot.STATES):
        new[i] = y[i] + h * (
            35 / 384 * k[0, i] + 500 / 1113 * k[2, i] + 125 / 192 * k[3, i] - 2187 / 6784 * k[4, i] + 11 / 84 * k[5, i]
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _switches(y: Floats, p: Floats, before: NDArray[np.int64], now: NDArray[np.int64]) -> bool:
    """Write the switches for state ``y`` into ``now``; return whether any differs from ``before``."""
    gap = slot.gap_m(y)
    now[slot.IN_CONTACT] = 1 if gap < 0.0 else 0
    now[slot.MOVING_RIGHT] = 1 if y[slot.BLOCK_V] > 0.0 else 0
    now[slot.WITHIN_REACH] = 1 if 0.0 <= gap < p[slot.D_ADHESION] else 0
    passed = p[slot.JUMP_MASS] != 0.0 and y[slot.BLOCK_V] > 0.0 and y[slot.BLOCK_X] > p[slot.JUMP_X]
    now[slot.JUMPED] = 1 if passed or before[slot.JUMPED] == 1 else 0
    different = False
    for i in range(slot.SWITCHES):
        different = different or now[i] != before[i]
    return different


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(y: Floats, on: NDArray[np.int64], out_y: Floats, out_on: NDArray[np.int64]) -> None:
    """Copy state and switches in loops, which compile faster than slices."""
    for i in range(slot.STATES):
        out_y[i] = y[i]
    for i in range(slot.SWITCHES):
        out_on[i] = on[i]


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(
    start: Floats,
    t_end: float,
    steps_s: tuple[float, float],
    p: Floats,
    drive: FrameAcceleration,
    out: tuple[Floats, Floats, NDArray[np.int64]],
) -> int:
    """Integrate from time zero to ``t_end``; write time, state and switches of every node; return their number.

    ``steps_s`` are the steps in contact and in flight.  There is a node at every step and at every event, with the
    switches after the event.  Returns -1 if the node arrays are too short.  Cost: about 0.4 us per node.
    """
    y = start.copy()
    new = np.empty(slot.STATES)
    h_contact, h_flight = steps_s
    out_t, out_y, out_on = out
    k = np.empty((7, slot.STATES))
    on = np.zeros(slot.SWITCHES, np.int64)
    now = np.empty(slot.SWITCHES, np.int64)
    _switches(y, p, on, on)
    t = 0.0
    n = 0
    out_t[0] = t
    _keep(y, on, out_y[0], out_on[0])
    while t < t_end:
        n += 1
        if n >= out_t.shape[0]:
            return -1
        h = h_contact if on[slot.IN_CONTACT] == 1 else h_flight
        h = min(h, t_end - t)
        _step(y, t, h, p, on, drive, k, new)
        if _switches(new, p, on, now):
            low, high = 0.0, h
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                _step(y, t, middle, p, on, drive, k, new)
                if _switches(new, p, on, now):
                    high = middle
                else:
                    low = middle
            h = high
            _step(y, t, h, p, on, drive, k, new)
            _switches(new, p, on, now)
            if now[slot.JUMPED] > on[slot.JUMPED]:  # the picked-up mass was at rest: momentum is conserved
                carried = p[slot.M_BLOCK] - p[slot.M_HIDDEN]
                new[slot.BLOCK_V] *= carried / (carried + p[slot.JUMP_MASS])
        t = t_end if t + h > t_end - 1e-15 else t + h
        out_t[n] = t
        _keep(new, now, y, on)
        _keep(new, now, out_y[n], out_on[n])
    return n + 1


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

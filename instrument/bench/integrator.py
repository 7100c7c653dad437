"""Integrate with fixed Dormand-Prince steps; events (touch, release, turnaround, adhesion's range) are bisected."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from instrument.bench.forces import (
    BLOCK_V,
    BLOCK_X,
    D_ADHESION,
    IN_CONTACT,
    JUMP_MASS,
    JUMP_X,
    JUMPED,
    M_BLOCK,
    M_HIDDEN,
    MOVING_RIGHT,
    STATES,
    SWITCHES,
    WITHIN_REACH,
    gap_m,
    rates,
)

Floats = NDArray[np.float64]
BISECTIONS = 45  # 10 us / 2^45: below a femtosecond


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
    rates(y, p, on, frame_acceleration(drive, t), k[0])
    for i in range(STATES):
        work[i] = y[i] + h * (k[0, i] / 5)
    rates(work, p, on, frame_acceleration(drive, t + h / 5), k[1])
    for i in range(STATES):
        work[i] = y[i] + h * (3 / 40 * k[0, i] + 9 / 40 * k[1, i])
    rates(work, p, on, frame_acceleration(drive, t + 0.3 * h), k[2])
    for i in range(STATES):
        work[i] = y[i] + h * (44 / 45 * k[0, i] - 56 / 15 * k[1, i] + 32 / 9 * k[2, i])
    rates(work, p, on, frame_acceleration(drive, t + 0.8 * h), k[3])
    for i in range(STATES):
        work[i] = y[i] + h * (
            19372 / 6561 * k[0, i] - 25360 / 2187 * k[1, i] + 64448 / 6561 * k[2, i] - 212 / 729 * k[3, i]
        )
    rates(work, p, on, frame_acceleration(drive, t + 8 / 9 * h), k[4])
    for i in range(STATES):
        work[i] = y[i] + h * (
            9017 / 3168 * k[0, i]
            - 355 / 33 * k[1, i]
            + 46732 / 5247 * k[2, i]
            + 49 / 176 * k[3, i]
            - 5103 / 18656 * k[4, i]
        )
    rates(work, p, on, frame_acceleration(drive, t + h), k[5])
    for i in range(STATES):
        new[i] = y[i] + h * (
            35 / 384 * k[0, i] + 500 / 1113 * k[2, i] + 125 / 192 * k[3, i] - 2187 / 6784 * k[4, i] + 11 / 84 * k[5, i]
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _switches(y: Floats, p: Floats, before: NDArray[np.int64], now: NDArray[np.int64]) -> bool:
    """Write the switches for state ``y`` into ``now``; return whether any differs from ``before``."""
    gap = gap_m(y)
    now[IN_CONTACT] = 1 if gap < 0.0 else 0
    now[MOVING_RIGHT] = 1 if y[BLOCK_V] > 0.0 else 0
    now[WITHIN_REACH] = 1 if 0.0 <= gap < p[D_ADHESION] else 0
    passed = p[JUMP_MASS] != 0.0 and y[BLOCK_V] > 0.0 and y[BLOCK_X] > p[JUMP_X]
    now[JUMPED] = 1 if passed or before[JUMPED] == 1 else 0
    different = False
    for i in range(SWITCHES):
        different = different or now[i] != before[i]
    return different


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(y: Floats, on: NDArray[np.int64], out_y: Floats, out_on: NDArray[np.int64]) -> None:
    """Copy state and switches in loops, which compile faster than slices."""
    for i in range(STATES):
        out_y[i] = y[i]
    for i in range(SWITCHES):
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
    new = np.empty(STATES)
    h_contact, h_flight = steps_s
    out_t, out_y, out_on = out
    k = np.empty((7, STATES))
    on = np.zeros(SWITCHES, np.int64)
    now = np.empty(SWITCHES, np.int64)
    _switches(y, p, on, on)
    t = 0.0
    n = 0
    out_t[0] = t
    _keep(y, on, out_y[0], out_on[0])
    while t < t_end:
        n += 1
        if n >= out_t.shape[0]:
            return -1
        h = h_contact if on[IN_CONTACT] == 1 else h_flight
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
            if now[JUMPED] > on[JUMPED]:  # the picked-up mass was at rest: momentum is conserved
                carried = p[M_BLOCK] - p[M_HIDDEN]
                new[BLOCK_V] *= carried / (carried + p[JUMP_MASS])
        t = t_end if t + h > t_end - 1e-15 else t + h
        out_t[n] = t
        _keep(new, now, y, on)
        _keep(new, now, out_y[n], out_on[n])
    return n + 1

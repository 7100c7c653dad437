"""Simulate a shot pushed by hand: hold the block, push it, catch it after the collision, and bring it back."""

import math
from dataclasses import dataclass

import numpy as np

from instrument.bench.effects import Effects
from instrument.bench.frame import Frame
from instrument.bench.measured_path import measured_path, simulate_collision
from instrument.bench.mechanics import Bodies, Trajectory
from instrument.bench.sines import Floats, interpolate_with_slope

HOLD_M = 30e-3  # distance from the plate at which the hand holds the block
RELEASE_M = 12e-3  # distance from the plate at which the hand releases the block
CATCH_S, RETURN_S = 0.1, 0.5
AFTER_S = 0.19  # free flight after the collision
_NODES = 400
_TREMOR_M, _TREMOR_HZ = 3e-6, 9.0


@dataclass(frozen=True, slots=True)
class PushedShot:
    """One shot on the stream's clock, from the start of the push until the block is back; arrays of shape (n,).

    Positions are relative to space, as hand and block do not move with the frame.
    """

    start_s: float
    end_s: float
    release_s: float  # the trajectory's time zero
    caught_s: float  # the end of the flight
    trajectory: Trajectory
    time_s: Floats
    optical_m: Floats
    optical_m_per_s: Floats
    block_m: Floats
    block_m_per_s: Floats

    def at(self, time_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Return optical position (m) and velocity (m/s), and block position (m), in space at ascending times."""
        x, v = interpolate_with_slope(self.time_s, self.optical_m, self.optical_m_per_s, time_s)
        return x, v, interpolate_with_slope(self.time_s, self.block_m, self.block_m_per_s, time_s)[0]


def push_duration_s(velocity_m_per_s: float) -> float:
    """Return the time in s from the start of the push to the release."""
    return 2.0 * (HOLD_M - RELEASE_M) / abs(velocity_m_per_s)


def simulate_push(
    start_s: float, velocity_m_per_s: float, effects: Effects, bodies: Bodies, frame: Frame
) -> PushedShot:
    """Simulate a shot whose push starts at ``start_s``; the frame, on the stream's clock, carries the plate."""
    u = np.linspace(0.0, 1.0, _NODES)
    step, slope, area = u**3 * (10 + u * (6 * u - 15)), 30 * u**2 * (1 - u) ** 2, u**4 * (2.5 + u * (u - 3))
    pushing = push_duration_s(velocity_m_per_s)
    push_x, push_v = HOLD_M + velocity_m_per_s * pushing * area, velocity_m_per_s * step
    free = RELEASE_M / abs(velocity_m_per_s) + 0.03 + AFTER_S
    release = start_s + pushing
    trajectory = simulate_collision(velocity_m_per_s, effects, bodies, RELEASE_M, free, frame.from_time(release))
    flight_t = trajectory.time_s
    frame_x, frame_v = frame.motion(release + flight_t)
    block_x = trajectory.block_m(flight_t) + frame_x
    block_v = trajectory.block_velocity_m_per_s(flight_t) + frame_v
    flight_x, flight_v = measured_path(trajectory, effects, flight_t)
    flight_x, flight_v = flight_x - flight_x[0] + RELEASE_M + frame_x - frame_x[0], flight_v + frame_v
    catch_x, catch_v = block_x[-1] + block_v[-1] * CATCH_S * (u - area), block_v[-1] * (1 - step)
    way = HOLD_M - catch_x[-1]
    hand_x = np.concatenate((catch_x[1:], catch_x[-1] + way * step[1:]))
    hand_v = np.concatenate((catch_v[1:], way * slope[1:] / RETURN_S))
    gained = float(flight_x[-1] - block_x[-1])  # optical minus block position, returned to zero on the way back
    still = np.zeros(_NODES - 1)
    caught = release + free
    time_s = np.concatenate(
        (
            start_s + pushing * u[:-1],
            release + flight_t,
            caught + CATCH_S * u[1:],
            caught + CATCH_S + RETURN_S * u[1:],
        )
    )
    return PushedShot(
        start_s=start_s,
        end_s=float(time_s[-1]),
        release_s=release,
        caught_s=caught,
        trajectory=trajectory,
        time_s=time_s,
        optical_m=np.concatenate((push_x[:-1], flight_x, hand_x + gained * np.concatenate((still + 1, 1 - step[1:])))),
        optical_m_per_s=np.concatenate(
            (push_v[:-1], flight_v, hand_v - gained * np.concatenate((still, slope[1:] / RETURN_S)))
        ),
        block_m=np.concatenate((push_x[:-1], block_x, hand_x)),
        block_m_per_s=np.concatenate((push_v[:-1], block_v, hand_v)),
    )


def next_push_time_s(time_s: float) -> float:
    """Return the next time at which the hand's tremor is zero, so that a push starts without a jump."""
    return math.ceil(time_s * _TREMOR_HZ - 1e-9) / _TREMOR_HZ


def held_block_motion(time_s: Floats) -> tuple[Floats, Floats]:
    """Return position and velocity of the block held in the trembling hand."""
    omega = 2 * math.pi * _TREMOR_HZ
    return HOLD_M + 0.5 * _TREMOR_M * (1 - np.cos(omega * time_s)), 0.5 * _TREMOR_M * omega * np.sin(omega * time_s)

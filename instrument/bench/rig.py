"""The complete simulated rig, and its endless stream of counts, which is determined by one seed.

A hand holds the block, pushes it, catches it after the collision, and brings it back.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Setup
from instrument.bench.effects import Effects, complete, effects_of_shot
from instrument.bench.frame import Frame, frame_of
from instrument.bench.measured_path import measured_path, simulate_collision, with_cyclic_error
from instrument.bench.mechanics import Bodies, Trajectory
from instrument.bench.optics import FLIGHT_NODES_S, HELD_NODES_S, Optics, Path, fill, node_times_s
from instrument.bench.sines import Floats, interpolate_with_slope, path_vibration
from instrument.bench.site import QUIET, Site

HOLD_M = 30e-3  # distance from the plate at which the hand holds the block
RELEASE_M = 12e-3  # distance from the plate at which the hand releases the block
CATCH_S, RETURN_S = 0.1, 0.5
AFTER_S = 0.19  # free flight after the collision
_NODES = 400
_TREMOR_M, _TREMOR_HZ = 3e-6, 9.0


@dataclass(frozen=True, slots=True)
class Bench:
    """The simulated rig: bodies, optics, effects, site and pushes."""

    bodies: Bodies = field(default_factory=Bodies)
    optics: Optics = field(default_factory=Optics)
    effects: Effects = field(default_factory=dict)
    site: Site = QUIET  # the vibration of the frame
    floor_m: float = 3e-10  # rms vibration of the optical path
    velocity_m_per_s: float = 0.265  # towards the plate
    velocity_spread: float = 0.15  # largest relative deviation of a push
    added_kg: float = 0.0  # weights on the block
    seed: int = 1

    def __post_init__(self) -> None:
        complete(self.effects)
        if not 0.02 <= self.velocity_m_per_s <= 1.0 or not 0 <= self.velocity_spread < 1:
            raise ValueError(f"a push to {self.velocity_m_per_s} m/s: 0.02 to 1 m/s can be simulated")
        if not 0 <= self.added_kg <= 1:
            raise ValueError(f"weights of {self.added_kg} kg on the block: 0 to 1 kg can be simulated")

    @property
    def bodies_with_weights(self) -> Bodies:
        """Get the bodies, with the added weights included in the block's mass."""
        return replace(self.bodies, block_mass_kg=self.bodies.block_mass_kg + self.added_kg)

    @property
    def setup(self) -> Setup:
        """Get the set-up as known to an operator, without the effects."""
        return Setup(
            moving_mass_kg=self.bodies_with_weights.block_mass_kg,
            moving_mass_u_kg=1e-6,
            wavelength_air_m=self.optics.wavelength_m,
            rest_frequency_hz=None if self.optics.with_reference else self.optics.rest_frequency_hz,
            digitizer_bits=self.optics.bits,
        )


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


class SimulatedStream:
    """The stream of a simulated rig with its pushes: position at any time, counts of any samples."""

    def __init__(self, rig: Bench, sample_rate_hz: float, first_shot: int = 0) -> None:
        """Begin the stream; its first push is number ``first_shot`` of the seed's sequence."""
        self._rig = rig
        self._rate_hz = sample_rate_hz
        self._optics = with_cyclic_error(rig.optics, rig.effects)
        self._effects = complete(rig.effects)
        self._floor = path_vibration(rig.floor_m, rig.seed)
        self._frame = frame_of(rig.site, rig.seed)
        self.shots = first_shot  # number of the next push
        self._pushed: list[PushedShot] = []

    def push(self, time_s: float) -> PushedShot:
        """Push the block at ``time_s``, or as soon as the hand is free; return the shot."""
        rig = self._rig
        random = np.random.default_rng((rig.seed, self.shots, 0x5))
        speed = rig.velocity_m_per_s * (1 + rig.velocity_spread * float(random.uniform(-1, 1)))
        effects = effects_of_shot(self._effects, self.shots, rig.seed)
        free_from_s = self._pushed[-1].end_s if self._pushed else 0.0
        start_s = next_push_time_s(max(time_s, free_from_s))
        self._frame = self._frame.with_knocks(start_s + push_duration_s(speed), self.shots)
        pushed = simulate_push(start_s, -speed, effects, rig.bodies_with_weights, self._frame)
        self.shots += 1
        self._pushed = [*self._pushed[-1:], pushed]  # older shots are over, as the stream only goes forward
        return pushed

    def path(self, time_s: Floats) -> Path:
        """Return the path, relative to the frame, at ascending times of equal spacing (s)."""
        x, v = held_block_motion(time_s)
        block = x.copy()
        for pushed in self._pushed:
            a, b = np.searchsorted(time_s, (pushed.start_s, pushed.end_s))
            if b > a:
                x[a:b], v[a:b], block[a:b] = pushed.at(time_s[a:b])
        shake_x, shake_v = self._floor.motion(time_s)
        frame_x, frame_v = self._frame.motion(time_s)
        x += shake_x - frame_x
        v += shake_v - frame_v
        block -= frame_x
        return Path(time_s, x, v, block)

    def fill(self, first_sample: int, out: NDArray[np.int16]) -> None:
        """Fill ``out`` (n, channels) with samples from ``first_sample`` on."""
        begin_s, end_s = first_sample / self._rate_hz, (first_sample + out.shape[0]) / self._rate_hz
        flies = any(pushed.release_s < end_s and begin_s < pushed.caught_s for pushed in self._pushed)
        sudden = flies or self._frame.ringing or self._optics.drop_outs
        spacing_s = FLIGHT_NODES_S if sudden else HELD_NODES_S
        path = self.path(node_times_s(first_sample, out.shape[0], self._rate_hz, spacing_s))
        fill(self._optics, path, first_sample, self._rate_hz, self._rig.seed, out)

"""A collision of the paper's two bodies for tests of the reading: integrated here, sharing nothing with the model."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis.shot.motion import Motion
from analysis.signal.filters import derivative_gains, derivatives

Floats = NDArray[np.float64]
MASS_KG, PLATE_KG, PLATE_N_PER_M, CONTACT_N_PER_M, DASHPOT = 17.85e-3, 1.984e-4, 221.4, 1e4, 0.4


@dataclass(frozen=True)
class Synthetic:
    """What a synthetic shot is made with."""

    speed_m_per_s: float = 0.265
    touch_s: float = 0.010003
    duration_s: float = 0.06
    noise_m: float = 0.1e-9
    drag_n_s_per_m: float = 0.0
    rate_hz: float = 1e5
    bandwidth_hz: float = 1e4
    ring_m: float = 0.0  # the plate swings so far when it is touched, from the shot before
    ring_rad: float = 0.0


@lru_cache(maxsize=8)
def _path(speed: float, drag: float, ring_m: float, ring_rad: float) -> tuple[Floats, Floats]:
    """Return the times since the touch, and block and plate against the place where they touched, shape (4, n)."""
    rate = float(np.sqrt(PLATE_N_PER_M / PLATE_KG))
    rest = -ring_m * np.sin(ring_rad)

    def rates(_: float, y: Floats) -> list[float]:
        overlap, closing = y[2] - y[0], y[3] - y[1]
        force = CONTACT_N_PER_M * overlap + DASHPOT * closing if overlap > 0.0 else 0.0
        plate = (-PLATE_N_PER_M * (y[2] - rest) - force) / PLATE_KG
        return [y[1], (force - drag * y[1]) / MASS_KG, y[3], plate]

    start = [0.0, -speed, 0.0, ring_m * rate * np.cos(ring_rad)]
    solution = solve_ivp(rates, (0.0, 0.034), start, max_step=1e-6, rtol=1e-8, atol=1e-14)
    return solution.t, solution.y


def motion_of(rig: Synthetic, seed: int = 1) -> Motion:
    """Return the motion a perfect demodulator would give of this rig, with white noise."""
    time = np.arange(0.0, rig.duration_s, 1.0 / rig.rate_hz)
    x = position_m(rig, time) + np.random.default_rng(seed).normal(0.0, rig.noise_m, time.size)
    return motion_from(time, x, rig)


def position_m(rig: Synthetic, time_s: Floats) -> Floats:
    """Return where the block is at any times of the shot, without noise."""
    times, states = _path(rig.speed_m_per_s, rig.drag_n_s_per_m, rig.ring_m, rig.ring_rad)
    tau = time_s - rig.touch_s
    decay = rig.drag_n_s_per_m / MASS_KG

    def flight(start_m: float, speed: float, u: Floats) -> Floats:
        return start_m + speed * (u if decay == 0.0 else -np.expm1(-decay * u) / decay)

    x = np.where(tau < 0.0, flight(0.0, -rig.speed_m_per_s, np.minimum(tau, 0.0)), np.interp(tau, times, states[0]))
    late = tau > times[-1]
    x[late] = flight(states[0][-1], states[1][-1], tau[late] - times[-1])
    return x


def true_of(rig: Synthetic) -> dict[str, float]:
    """Return what a perfect reading would tell of a shot without drag, by its names in the impact."""
    _, states = _path(rig.speed_m_per_s, rig.drag_n_s_per_m, rig.ring_m, rig.ring_rad)
    return {
        "velocity_in_m_per_s": -rig.speed_m_per_s,
        "velocity_out_m_per_s": float(states[1][-1]),
        "deflection_max_m": float(-states[0].min()),
    }


def motion_from(time_s: Floats, displacement_m: Floats, rig: Synthetic) -> Motion:
    """Return a Motion of given samples, with the demodulator's own filters and stated noise."""
    velocity, acceleration = derivatives(displacement_m, rig.rate_hz, rig.bandwidth_hz)
    gains = derivative_gains(np.isfinite(displacement_m), rig.rate_hz, rig.bandwidth_hz)
    return Motion(
        time_s=time_s,
        displacement_m=displacement_m,
        velocity_m_per_s=velocity,
        acceleration_m_per_s2=acceleration,
        force_n=MASS_KG * acceleration,
        displacement_std_m=np.full(time_s.size, rig.noise_m),
        velocity_std_m_per_s=rig.noise_m * gains[0],
        acceleration_std_m_per_s2=rig.noise_m * gains[1],
        force_std_n=MASS_KG * rig.noise_m * gains[1],
        valid=np.isfinite(displacement_m),
        sample_rate_hz=rig.rate_hz,
        bandwidth_hz=rig.bandwidth_hz,
        displacement_band_hz=0.4 * rig.rate_hz,
        moving_mass_kg=MASS_KG,
        moving_mass_u_kg=1e-6,
        wavelength_m=632.8e-9,
    )

"""From what the block does to what the optics see: drift, lag, a frame that moves, light in the wrong arm."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from instrument.bench.effects import Effects, force_slots
from instrument.bench.frame import Frame
from instrument.bench.mechanics import Bodies, Trajectory, collide
from instrument.bench.optics import Optics
from instrument.bench.sines import Sines, at_times
from instrument.bench.site import QUIET

Floats = NDArray[np.float64]
_LAG_GRID_S = 1e-6
_NONE: Mapping[str, float] = {}


def shoot(
    velocity_m_per_s: float,
    effects: Effects,
    bodies: Bodies,
    distance_m: float,
    duration_s: float,
    frame: Frame | None = None,
) -> Trajectory:
    """Let the block go with the effects of one shot, in a frame whose time zero is that moment."""
    motion = effects.get("plate_motion", _NONE)
    return collide(
        velocity_m_per_s,
        bodies=bodies,
        extra=force_slots(effects),
        distance_m=distance_m,
        duration_s=duration_s,
        plate_at_touch=(motion.get("displacement_m", 0.0), motion.get("velocity_m_per_s", 0.0)),
        frame=riding(frame, effects),
    )


def seen(trajectory: Trajectory, effects: Effects, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the displacement (m) and velocity (m/s) that the optics see at ascending ``time_s``.

    Sensor drift b: + b t^2 / 2.  Frame vibration: velocity + A sin(omega t + phi).  Demodulation lag tau: the optics
    follow with tau dx_m/dt = x - x_m.  Cyclic error is light, see ``lit`` and ``cyclic_m``.
    """
    tau = effects.get("demodulation_lag", _NONE).get("time_s", 0.0)
    if tau > 0.0:
        fine = np.arange(0.0, time_s[-1] + 2 * _LAG_GRID_S, _LAG_GRID_S)
        lagged = _first_order(trajectory.block_m(fine), trajectory.block_velocity_m_per_s(fine), _LAG_GRID_S, tau)
        slope = (trajectory.block_m(fine) - lagged) / tau
        x = at_times(fine, lagged, slope, time_s)
        v = (trajectory.block_m(time_s) - x) / tau
    else:
        x, v = trajectory.block_m(time_s), trajectory.block_velocity_m_per_s(time_s)
    ramp = effects.get("sensor_drift", _NONE).get("ramp_m_per_s2", 0.0)
    if ramp:
        x, v = x + 0.5 * ramp * time_s**2, v + ramp * time_s
    for shake in (effects.get("frame_vibration", _NONE), _optics_alone(effects)):
        if not shake:
            continue
        omega, phase, amplitude = 2 * math.pi * shake["frequency_hz"], shake["phase_rad"], shake["amplitude_m_per_s"]
        x = x - amplitude / omega * (np.cos(omega * time_s + phase) - math.cos(phase))
        v = v + amplitude * np.sin(omega * time_s + phase)
    return x, v


def riding(frame: Frame | None, effects: Effects) -> Frame | None:
    """Return how the plate's foot moves: with the frame, and by a factor of a vibration that takes the plate along.

    The bodies are followed in the foot's coordinates.
    """
    shake = effects.get("frame_vibration_with_plate", _NONE)
    if not shake or shake["plate_factor"] == 0.0:
        return frame
    omega = 2 * math.pi * shake["frequency_hz"]
    size = shake["plate_factor"] * shake["amplitude_m_per_s"] / omega
    turned = shake["phase_rad"] + 0.5 * math.pi  # a cosine
    line = Sines(np.array([omega]), np.array([size]), np.array([turned]))
    return Frame(QUIET, 0, line) if frame is None else replace(frame, sines=frame.sines.with_(line))


def _optics_alone(effects: Effects) -> Mapping[str, float]:
    """Return what the optics move by against the plate's foot, as a frame's vibration."""
    shake = effects.get("frame_vibration_with_plate", _NONE)
    if not shake:
        return _NONE
    return {**shake, "amplitude_m_per_s": shake["amplitude_m_per_s"] * (1.0 - shake["plate_factor"])}


def lit(optics: Optics, effects: Effects) -> Optics:
    """Return the optics with the light that takes the wrong arm."""
    cyclic = effects.get("cyclic_error", _NONE)
    if not cyclic:
        return optics
    return replace(optics, leak_m=cyclic["amplitude_m"], leak_order=int(cyclic["order"]), leak_turns=0.15)


def cyclic_m(optics: Optics, x_m: Floats) -> Floats:
    """Return the displacement error of the leak: lambda/(4 pi) times the phase of the sum of both lights."""
    if optics.leak_m == 0.0:
        return np.zeros_like(x_m)
    scale = optics.wavelength_m / (4 * math.pi)
    leak = optics.leak_m / scale * cmath.exp(2j * math.pi * optics.leak_turns)
    # the beat is cos(rest - x / scale); the leak stands at -(1 - order) x / scale against the same rest
    turned = leak * np.exp(1j * (x_m / scale) * optics.leak_order)
    error: Floats = -scale * np.angle(1.0 + turned)
    return error


@njit(cache=True, nogil=True, error_model="numpy")
def _first_order(x: Floats, v: Floats, h: float, tau: float) -> Floats:
    """Return the exact answer of a first-order lag to a path that is quadratic between samples."""
    result = np.empty(x.shape[0])
    e = math.exp(-h / tau)
    y = x[0] - tau * v[0]
    result[0] = y
    for i in range(x.shape[0] - 1):
        a = (v[i + 1] - v[i]) / h
        # particular solution of tau y' + y = x_i + v u + a u^2 / 2
        start = x[i] - tau * v[i] + tau * tau * a
        end = x[i + 1] - tau * v[i + 1] + tau * tau * a
        y = end + (y - start) * e
        result[i + 1] = y
    return result

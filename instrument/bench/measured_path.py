"""Compute the path measured by the optics from the block's motion: drift, lag, vibration, polarisation leak."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numba import njit

from instrument.bench.effects import Effects, force_slots
from instrument.bench.frame import Frame
from instrument.bench.mechanics import Bodies, Trajectory, collide
from instrument.bench.optics import Optics
from instrument.bench.sines import Floats, Sines, interpolate
from instrument.bench.site import QUIET

_LAG_GRID_S = 1e-6
_NONE: Mapping[str, float] = {}


def simulate_collision(
    velocity_m_per_s: float,
    effects: Effects,
    bodies: Bodies,
    distance_m: float,
    duration_s: float,
    frame: Frame | None = None,
) -> Trajectory:
    """Simulate the collision with the effects of one shot; the frame's time zero is the release."""
    motion = effects.get("plate_motion", _NONE)
    return collide(
        velocity_m_per_s,
        bodies=bodies,
        extra=force_slots(effects),
        distance_m=distance_m,
        duration_s=duration_s,
        plate_at_touch=(motion.get("displacement_m", 0.0), motion.get("velocity_m_per_s", 0.0)),
        frame=clamp_motion(frame, effects),
    )


def measured_path(trajectory: Trajectory, effects: Effects, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the displacement (m) and velocity (m/s) that the optics measure at ascending ``time_s``.

    Sensor drift b adds b t^2 / 2.  Frame vibration adds the velocity A sin(omega t + phi).  With a demodulation lag tau
    the measured x_m follows tau dx_m/dt = x - x_m.  The cyclic error is part of the light, see ``with_cyclic_error``.
    """
    tau = effects.get("demodulation_lag", _NONE).get("time_s", 0.0)
    if tau > 0.0:
        fine = np.arange(0.0, time_s[-1] + 2 * _LAG_GRID_S, _LAG_GRID_S)
        lagged = _first_order(trajectory.block_m(fine), trajectory.block_velocity_m_per_s(fine), _LAG_GRID_S, tau)
        slope = (trajectory.block_m(fine) - lagged) / tau
        x = interpolate(fine, lagged, slope, time_s)
        v = (trajectory.block_m(time_s) - x) / tau
    else:
        x, v = trajectory.block_m(time_s), trajectory.block_velocity_m_per_s(time_s)
    ramp = effects.get("sensor_drift", _NONE).get("ramp_m_per_s2", 0.0)
    if ramp:
        x, v = x + 0.5 * ramp * time_s**2, v + ramp * time_s
    for name in ("frame_vibration", "frame_vibration_with_plate"):
        shake = effects.get(name, _NONE)
        if not shake:
            continue
        omega, phase = 2 * math.pi * shake["frequency_hz"], shake["phase_rad"]
        amplitude = shake["amplitude_m_per_s"] * (1.0 - shake.get("plate_factor", 0.0))  # relative to the plate's clamp
        x = x - amplitude / omega * (np.cos(omega * time_s + phase) - math.cos(phase))
        v = v + amplitude * np.sin(omega * time_s + phase)
    return x, v


def clamp_motion(frame: Frame | None, effects: Effects) -> Frame | None:
    """Return the motion of the plate's clamp: the frame's, plus its share of a vibration that also moves the plate.

    The equations of motion are in the clamp's coordinates.
    """
    shake = effects.get("frame_vibration_with_plate", _NONE)
    if not shake:
        return frame
    omega = 2 * math.pi * shake["frequency_hz"]
    size = shake["plate_factor"] * shake["amplitude_m_per_s"] / omega
    turned = shake["phase_rad"] + 0.5 * math.pi  # turns the sine into a cosine
    line = Sines(np.array([omega]), np.array([size]), np.array([turned]))
    return Frame(QUIET, 0, line) if frame is None else replace(frame, sines=frame.sines.plus(line))


def with_cyclic_error(optics: Optics, effects: Effects) -> Optics:
    """Return the optics with the light leak that causes the cyclic error."""
    cyclic = effects.get("cyclic_error", _NONE)
    if not cyclic:
        return optics
    return replace(optics, leak_m=cyclic["amplitude_m"], leak_order=int(cyclic["order"]), leak_turns=0.15)


@njit(cache=True, nogil=True, error_model="numpy")
def _first_order(x: Floats, v: Floats, h: float, tau: float) -> Floats:
    """Return the exact response of a first-order lag to a path that is quadratic between samples."""
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

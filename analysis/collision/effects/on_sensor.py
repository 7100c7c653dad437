"""Effects on the measurement: the measured displacement differs from that of the block.

Each function takes displacements, shape (n, k), and its parameters, shape (3, k), and returns the measured
displacements; times are on the recording's clock.  Both may be complex, with one derivative in the imaginary part.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from analysis.collision.effects.kernel import Q_RATE, W_RATE, Q, W
from analysis.collision.effects.row import Acts, Effect, Parameter, SensorInput, frequencies
from analysis.collision.parameters import Collision, Floats

_PLATE_QUALITY = 1e4  # only keeps a resonance finite, because the base model's plate has no damping
_CHIRP_PASSES, _CHIRP_STOPS = 0.38, 0.66  # pass band and stop band of the decimator, as shares of the record's rate
_ITERATIONS = 4  # iterations that remove the cyclic error from the path: one of 5 nm is then known to 0.01 nm


def sensor_drift(seen: SensorInput, x: Any, p: Any) -> Any:
    """Measure v + b t, that is x + b t^2 / 2; p = (b in m/s^2), t from the recording's first sample.

    Caused by drift of the laser frequency or of the optical path.
    """
    return x + 0.5 * p[0] * (seen.time_s - seen.time_s[0])[:, None] ** 2


def demodulation_lag(seen: SensorInput, x: Any, p: Any) -> Any:
    """Measure x_m with tau x_m' = x - x_m; p = (tau in s).  A first-order low-pass in the optics' electronics.

    Solved exactly for a velocity that is linear between samples, starting from steady flight.  A pure delay has no
    effect, because the touch time absorbs it; the effect on the bounces is of order tau^2.
    """
    velocity = np.repeat(seen.velocity_m_per_s[:, None], x.shape[1], axis=1)
    if np.iscomplexobj(x):  # the derivative of the velocity is approximated from that of the displacement
        velocity = velocity + 1j * np.gradient(x.imag, seen.time_s, axis=0)
    out = np.empty_like(x)
    _lag(seen.time_s, np.ascontiguousarray(x), velocity, np.ascontiguousarray(p[0]), out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _lag(time_s, x, v, lag, out):  # type: ignore[no-untyped-def]
    """Write the lagging displacements; about 10 ns per value, 60 ns if complex."""
    for k in range(x.shape[1]):
        tau = lag[k]
        behind = x[0, k] - tau * v[0, k]
        out[0, k] = behind
        for i in range(1, x.shape[0]):
            step = time_s[i] - time_s[i - 1]
            bend = tau * tau * (v[i, k] - v[i - 1, k]) / step
            before = x[i - 1, k] - tau * v[i - 1, k] + bend
            after = x[i, k] - tau * v[i, k] + bend
            fade = np.exp(-step / tau) if tau.real * 600.0 > step else 0.0 * tau
            behind = after + (behind - before) * fade
            out[i, k] = behind


def frame_vibration(seen: SensorInput, x: Any, p: Any) -> Any:
    """Measure v + A sin(omega t + phi); p = (A in m/s, f in Hz, phi in rad at time zero).  The frame vibrates."""
    omega = 2 * math.pi * p[1]
    return x - p[0] / omega * np.cos(omega * seen.time_s[:, None] + p[2])


def vibration_from_wave(frequency_hz: float, cosine_and_sine_m: Floats) -> list[dict[str, float]]:
    """Return the common velocity amplitude and each shot's phase of a vibration -A/omega cos(omega t + phi).

    ``cosine_and_sine_m`` has shape (shots, 2).
    """
    omega = 2 * math.pi * frequency_hz
    size = omega * float(np.sqrt(np.mean(np.sum(cosine_and_sine_m**2, axis=1))))
    return [
        {"frequency_hz": frequency_hz, "phase_rad": math.atan2(float(y), -float(x)), "amplitude_m_per_s": size}
        for x, y in cosine_and_sine_m
    ]


def plate_response_to_frame(p: Any, stiffness: Any, mass: Any, time_s: Any) -> tuple[Any, Any, Any]:
    """Return (m, m/s, rad/s): displacement, velocity and rate of a plate in its stationary response to the frame.

    p = (A in m/s, f in Hz, phi in rad, factor): the clamp moves by factor A/omega cos(omega t + phi), and the plate
    responds as a mass on a spring of quality factor 10,000 (nearly undamped).
    """
    omega, own = 2 * math.pi * p[1], stiffness / mass
    turn = omega * time_s + p[2]
    apart, loss = own - omega * omega, omega * np.sqrt(own) / _PLATE_QUALITY
    size = p[3] * p[0] / (omega * (apart * apart + loss * loss))
    with_it, behind = size * (own * apart + loss * loss), size * loss * omega * omega
    cosine, sine = np.cos(turn), np.sin(turn)
    return with_it * cosine + behind * sine, omega * (behind * cosine - with_it * sine), omega


def plate_on_frame(s: Any, p: Any, out: Any) -> None:
    """Displace the contact point by q: q'' = -omega^2 (q + q_0); p = (q_0, q' at first touch, omega); q = 0 there.

    The motion of a plate whose clamp vibrates is the sum of its stationary response, q + q_0, and of its motion with
    the clamp at rest, y.
    """
    out[Q_RATE] += s[W]
    out[W_RATE] -= p[2] * p[2] * (s[Q] + p[0])


def vibration_with_plate_from_wave(frequency_hz: float, cosine_and_sine_m: Floats) -> list[dict[str, float]]:
    """Return the values of ``vibration_from_wave`` with a plate factor of one half."""
    return [{**values, "plate_factor": 0.5} for values in vibration_from_wave(frequency_hz, cosine_and_sine_m)]


def cyclic_error(seen: SensorInput, x: Any, p: Any) -> Any:
    """Measure x - s arg(1 - A/s e^(i u)), s = lambda / (4 pi), u = n x / s + phi; p = (A in m, n, phi in rad).

    Polarisation leakage (Wu and Deslattes, Appl. Opt. 37 (1998) 6696), A sin u to first order.  The demodulator passes
    only the chirp near the turnaround, where 2 n |v| / lambda is within its band.  The error is periodic in the whole
    optical path, frame motion included.  Where the displacement was measured, the path is the measured one minus the
    error; otherwise it is the model's.
    """
    velocity_m_per_s = np.gradient(x[:, :1].real, seen.time_s, axis=0)  # velocity of the path, not of the block alone
    line = 2 * np.abs(p[1, :1].real * velocity_m_per_s) / seen.wavelength_m / seen.rate_hz
    beyond = np.clip((line - _CHIRP_PASSES) / (_CHIRP_STOPS - _CHIRP_PASSES), 0.0, 1.0)
    passed, scale = 0.5 + 0.5 * np.cos(np.pi * beyond), seen.wavelength_m / (4 * math.pi)

    def error_at(path: Any) -> Any:
        turn = p[1] * path / scale + p[2]
        return passed * scale * np.arctan(p[0] * np.sin(turn) / (scale - p[0] * np.cos(turn)))

    if seen.measured_m is None:
        return x + error_at(x)
    measured_m = np.where(np.isfinite(seen.measured_m), seen.measured_m, x[:, 0].real)[:, None]
    error: Any = 0.0
    for _ in range(_ITERATIONS):
        error = error_at(measured_m - error)
    return x + error


_LINE = (
    Parameter("amplitude_m_per_s", "m/s", 1e-6, lower=0.0),
    Parameter("frequency_hz", "Hz", 150.0, 1.0, 2e4, frequencies(25, 4000), logarithmic=True),
    Parameter("phase_rad", "rad", 0.0, grid=(0.0, math.pi / 2), tried=(0.0,), own=True),
)


def third_as_rate(values: Floats, _collision: Collision) -> float:
    """Return the third value, the rate of the effect in rad/s."""
    return float(values[2])


ROWS = (
    Effect(
        "sensor_drift",
        "a drift of the measured velocity",
        Acts.ON_SENSOR,
        (Parameter("ramp_m_per_s2", "m/s²", 1e-4),),
        "ramp_m_per_s2",
        sensor=sensor_drift,
        at_rest=True,
        look_alikes=("tilt", "coulomb_friction"),
    ),
    Effect(
        "demodulation_lag",
        "a lag of the demodulation",
        Acts.ON_SENSOR,
        (Parameter("time_s", "s", 1e-5, lower=2e-7, upper=5e-4, logarithmic=True),),
        "time_s",
        sensor=demodulation_lag,
        response_power=2.0,  # the touch time absorbs a pure delay
        delay_parameter="time_s",
        has_memory=True,
    ),
    Effect(
        "frame_vibration",
        "a vibration of the frame",
        Acts.ON_SENSOR,
        _LINE,
        "amplitude_m_per_s",
        sensor=frame_vibration,
        wave=vibration_from_wave,
        at_rest=True,
    ),
    Effect(
        "cyclic_error",
        "a cyclic error of the interferometer",
        Acts.ON_SENSOR,
        (
            Parameter("amplitude_m", "m", 1e-9, lower=0.0, upper=3e-8),  # the leaked light is weaker than the main beam
            Parameter("order", "", 1.0, lower=0.5, upper=4.0, grid=(1.0, 2.0), fixed=True),
            Parameter("phase_rad", "rad", 0.0, grid=(0.0, math.pi / 2), tried=(0.0,), own=True),
        ),
        "amplitude_m",
        sensor=cyclic_error,
        optical=True,
        needs_full_rate=True,
    ),
)

WIDER_EFFECTS = (
    Effect(
        "frame_vibration_with_plate",
        "a vibration of the frame and the plate on it",
        Acts.ON_PLATE,
        (*_LINE, Parameter("plate_factor", "", 0.5, lower=0.0, upper=1.0)),
        "amplitude_m_per_s",
        plate_on_frame,
        sensor=frame_vibration,
        hidden=2,
        shift=1.0,
        wave=vibration_with_plate_from_wave,
        at_rest=True,
        clocked=plate_response_to_frame,
        widens="frame_vibration",
        fastest=third_as_rate,
    ),
)

"""Effects on what is measured: the displacement is not quite that of the block.

Each takes the displacements (complex, shape (n, k)) and its parameters (complex, shape (3, k)) and returns what the
optics would show; times count from the first touch.
"""

import math

import numpy as np
from numba import njit

from analysis.model.effects.row import Acts, Complexes, Effect, Parameter, Sensed, frequencies


def sensor_drift(seen: Sensed, x: Complexes, p: Complexes) -> Complexes:
    """Measure v + b t, that is x + b t^2 / 2; p = (b in m/s^2).  A laser frequency or an optical path that drifts."""
    return np.asarray(x + 0.5 * p[0] * seen.time_s[:, None] ** 2)


def demodulation_lag(seen: Sensed, x: Complexes, p: Complexes) -> Complexes:
    """Measure x_m with tau x_m' = x - x_m; p = (tau in s).  A first-order low-pass in the optics' electronics.

    Solved exactly for a displacement that is straight between two samples.  A pure delay is no effect: the touch
    time takes it up; what shows in the bounces is of order tau^2.
    """
    out = np.empty(x.shape, dtype=np.complex128)
    _lag(seen.time_s, np.ascontiguousarray(x), np.ascontiguousarray(p[0]), out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _lag(time_s, x, lag, out):  # type: ignore[no-untyped-def]
    """Write the lagging displacements; about 60 ns a value."""
    for k in range(x.shape[1]):
        tau = lag[k]
        behind = (x[1, k] - x[0, k]) / (time_s[1] - time_s[0]) * tau  # the record begins in steady flight
        out[0, k] = x[0, k] - behind
        for i in range(1, x.shape[0]):
            step = time_s[i] - time_s[i - 1]
            steady = (x[i, k] - x[i - 1, k]) / step * tau
            fade = np.exp(-step / tau) if tau.real * 600.0 > step else 0.0 * tau
            behind = steady + (behind - steady) * fade
            out[i, k] = x[i, k] - behind


def frame_vibration(seen: Sensed, x: Complexes, p: Complexes) -> Complexes:
    """Measure v + A sin(omega t + phi); p = (A in m/s, f in Hz, phi in rad at first touch).  The frame swings."""
    omega = 2 * math.pi * p[1]
    return np.asarray(x - p[0] / omega * np.cos(omega * seen.time_s[:, None] + p[2]))


def cyclic_error(seen: Sensed, x: Complexes, p: Complexes) -> Complexes:
    """Measure x + A sin(4 pi n x / lambda + phi); p = (A in m, n, phi in rad).

    Polarisation leak (Wu and Deslattes, Appl. Opt. 37 (1998) 6696).  Only what the demodulator passes shows: the
    chirp near the turnaround, where 2 n |v| / lambda lies in its band (half-power edge taken as a soft one).
    """
    wave = 4 * math.pi * p[1] / seen.wavelength_m
    swing = 2 * np.abs(p[1, :1].real) * np.abs(seen.velocity_m_per_s)[:, None] / seen.wavelength_m
    passed = 1 / (1 + (swing / seen.band_hz) ** 12)
    return np.asarray(x + p[0] * passed * np.sin(wave * x + p[2]))


ROWS = (
    Effect(
        "sensor_drift",
        "a measured velocity that drifts",
        Acts.ON_SENSOR,
        (Parameter("ramp_m_per_s2", "m/s²", 1e-4),),
        "ramp_m_per_s2",
        sensor=sensor_drift,
        look_alikes=("tilt", "coulomb_friction"),
    ),
    Effect(
        "demodulation_lag",
        "optics that lag behind",
        Acts.ON_SENSOR,
        (Parameter("time_s", "s", 1e-5, lower=0.0, upper=1e-2),),
        "time_s",
        sensor=demodulation_lag,
    ),
    Effect(
        "frame_vibration",
        "a frame that vibrates with the optics",
        Acts.ON_SENSOR,
        (
            Parameter("amplitude_m_per_s", "m/s", 1e-6, lower=0.0),
            Parameter("frequency_hz", "Hz", 150.0, lower=5.0, upper=2e4, grid=frequencies(20, 4000, 180)),
            Parameter("phase_rad", "rad", 0.0, grid=(0.0, math.pi / 2), own=True),
        ),
        "amplitude_m_per_s",
        sensor=frame_vibration,
    ),
    Effect(
        "cyclic_error",
        "a phase error that repeats every half wavelength",
        Acts.ON_SENSOR,
        (
            Parameter("amplitude_m", "m", 2e-10, lower=0.0),
            Parameter("order", "", 1.0, lower=0.5, upper=4.0, grid=(1.0, 2.0), fixed=True),
            Parameter("phase_rad", "rad", 0.0, grid=(0.0, math.pi / 2), own=True, nuisance=True),
        ),
        "amplitude_m",
        sensor=cyclic_error,
    ),
)

"""Simulated recordings for the tests: two beats with a known motion, white noise, and faults."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Channel, Recording, Role, Setup

WAVELENGTH_M = 632.8e-9
MASS_KG = 0.01785
Floats = NDArray[np.float64]
Motion = Callable[[Floats], Floats]


def free_flight(velocity_m_per_s: float) -> Motion:
    """Return a motion at constant velocity, displacement in m of time in s."""
    return lambda t: velocity_m_per_s * t


def collision(velocity_m_per_s: float, turn_s: float, contact_s: float = 10e-3) -> Motion:
    """Return in with -v, a half sine of force about ``turn_s``, out with +v; displacement in m of time in s."""
    omega = np.pi / contact_s
    start = turn_s - contact_s / 2

    def displacement(t: Floats) -> Floats:
        u = np.clip(t - start, 0.0, contact_s)
        inside = -velocity_m_per_s * np.sin(omega * u) / omega
        return (
            -velocity_m_per_s * np.minimum(t - start, 0.0)
            + inside
            + velocity_m_per_s * np.maximum(t - start - contact_s, 0.0)
        )

    return displacement


def make_recording(
    motion: Motion,
    samples: int,
    *,
    rate_hz: float = 10e6,
    rest_hz: float = 2.73e6,
    snr_db: float | None = 40.0,
    seed: int = 1,
    amplitude: float = 8000.0,
    offset: float = 100.0,
    order: tuple[Role, ...] = (Role.REFERENCE, Role.MEASUREMENT),
    alter: Callable[[Role, Floats, Floats], Floats] | None = None,
    rest_phase: Motion | None = None,
    bits: int = 16,
) -> Recording:
    """Return a recording of ``motion``; ``alter(role, time, volts)`` may spoil a channel before it is rounded."""
    random = np.random.default_rng(seed)
    t = np.arange(samples) / rate_hz
    rest = 2 * np.pi * rest_hz * t + random.uniform(0, 2 * np.pi)
    if rest_phase is not None:
        rest = rest + rest_phase(t)
    columns, channels = [], []
    for role in order:
        if role is Role.SWITCH:
            signal = np.where(np.arange(samples) > samples // 4, 2000.0, 50.0)
        else:
            phase = rest if role is Role.REFERENCE else rest - 4 * np.pi / WAVELENGTH_M * motion(t)
            signal = amplitude * np.cos(phase + (0.0 if role is Role.REFERENCE else 1.234)) + offset
            if snr_db is not None:
                signal = signal + random.normal(0, amplitude / np.sqrt(2 * 10 ** (snr_db / 10)), samples)
            if alter is not None:
                signal = alter(role, t, signal)
        columns.append(signal)
        channels.append(Channel(role, 1e-4))
    rail = 1 << (bits - 1)
    counts = np.clip(np.rint(np.stack(columns, axis=1)), -rail, rail - 1).astype(np.int16)
    setup = Setup(
        MASS_KG,
        wavelength_air_m=WAVELENGTH_M,
        digitizer_bits=bits,
        rest_frequency_hz=None if Role.REFERENCE in order else rest_hz,
    )
    return Recording("made", counts, rate_hz, tuple(channels), setup)

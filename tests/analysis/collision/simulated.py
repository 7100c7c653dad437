"""Displacements of simulated shots for the tests of the fit: the exact model, plus noise of known size."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.collision.effects import CATALOGUE
from analysis.collision.effects.row import SensorInput
from analysis.collision.parameters import PAPER, Collision, Floats
from analysis.collision.solver import general
from analysis.shot.motion import Motion

WAVELENGTH_M = 632.8e-9
BAND_HZ = 32e3


def shot(
    collision: Collision = PAPER,
    *,
    effects: Mapping[str, Sequence[float]] | None = None,
    seed: int = 0,
    samples: int = 6000,
    rate_hz: float = 1e5,
    touch_s: float = 0.0123456,
    white_m: float = 1.5e-10,
    floor_m: float = 0.0,
    floor_time_s: float = 3e-3,
) -> Motion:
    """Return a shot of ``collision`` with ``effects`` ({name: values in the row's order}), white noise and a floor."""
    random = np.random.default_rng(seed)
    time_s = np.arange(samples) / rate_hz
    chosen = effects or {}
    active = [
        general.ActiveEffect(CATALOGUE[n], tuple(v)) for n, v in chosen.items() if CATALOGUE[n].kernel is not None
    ]
    run = general.solve(collision, active, time_s - touch_s)
    x = run.displacement_m
    for name, values in chosen.items():
        sensor = CATALOGUE[name].sensor
        if sensor is not None:
            p = np.zeros((3, 1), dtype=np.complex128)
            p[: len(values), 0] = values
            seen = SensorInput(time_s, run.velocity_m_per_s, WAVELENGTH_M, rate_hz)
            x = sensor(seen, x[:, None].astype(np.complex128), p)[:, 0].real
    noise = white_m * random.standard_normal(samples)
    if floor_m > 0:
        memory = np.exp(-1 / rate_hz / floor_time_s)
        wander, kicks = floor_m * random.standard_normal(), random.standard_normal(samples)
        for i in range(samples):
            noise[i] += wander
            wander = memory * wander + floor_m * np.sqrt(1 - memory**2) * kicks[i]
    nothing = np.zeros(samples)
    return Motion(
        time_s=time_s,
        displacement_m=x + 3.1e-3 + noise,
        velocity_m_per_s=nothing.copy(),
        acceleration_m_per_s2=nothing.copy(),
        force_n=nothing.copy(),
        displacement_std_m=np.full(samples, white_m),
        velocity_std_m_per_s=nothing.copy(),
        acceleration_std_m_per_s2=nothing.copy(),
        force_std_n=nothing.copy(),
        valid=np.ones(samples, dtype=np.bool_),
        sample_rate_hz=rate_hz,
        bandwidth_hz=1e4,
        displacement_band_hz=BAND_HZ,
        moving_mass_kg=collision.block_mass_kg,
        moving_mass_u_kg=1e-6,
        wavelength_m=WAVELENGTH_M,
    )


def with_vector(collision: Collision, vector: Floats) -> Collision:
    """Return a collision with the parameters ``vector``, in the order of ``Collision.vector``."""
    k_p, m_p, k_n, gamma_n, v_i, y_0, u_0, m_b = (float(value) for value in vector)
    return Collision(m_b, v_i, k_p, m_p, k_n, gamma_n, y_0, u_0, collision.variant)

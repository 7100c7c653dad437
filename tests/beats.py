"""Counts of a synthetic shot for tests: two beats and a light switch, made here and from nothing of the program."""

import numpy as np

from analysis.shot.recording import Channel, Recording, Role, Setup
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, position_m

REST_HZ, WAVELENGTH_M, VOLTS_PER_COUNT = 2.73e6, 632.8e-9, 1 / 2048


def recording_of(
    rig: Synthetic, *, rate_hz: float = 10e6, snr_db: float = 35.0, bits: int = 12, seed: int = 1
) -> Recording:
    """Return a 12-bit recording of three channels; the switch opens 1 ms before the touch."""
    time = np.arange(round(rig.duration_s * rate_hz)) / rate_hz
    random = np.random.default_rng(seed)
    noise_v = 0.7 / np.sqrt(2.0 * 10 ** (snr_db / 10))
    rest = 2.0 * np.pi * REST_HZ * time
    # the block comes in with v < 0 and a beat above the rest frequency (docs/physics.md, "from beats to force")
    moved = rest - 4.0 * np.pi / WAVELENGTH_M * position_m(rig, time)
    volts = np.empty((time.size, 3))
    volts[:, 0] = 0.7 * np.cos(rest) + random.normal(0.0, noise_v, time.size)
    volts[:, 1] = 0.6 * np.cos(moved + 0.4) + random.normal(0.0, noise_v, time.size)
    trigger = round((rig.touch_s - 1e-3) * rate_hz)
    volts[:, 2] = np.where(np.arange(time.size) < trigger, 0.88, 0.05)
    rail = 2 ** (bits - 1)
    counts = np.clip(np.round(volts / VOLTS_PER_COUNT), -rail, rail - 1).astype("<i2")
    counts.flags.writeable = False
    return Recording(
        name="shot",
        counts=counts,
        sample_rate_hz=rate_hz,
        channels=tuple(Channel(role, VOLTS_PER_COUNT) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH)),
        setup=Setup(MASS_KG, 1e-6, wavelength_air_m=WAVELENGTH_M, digitizer_bits=bits),
        trigger_sample=trigger,
    )

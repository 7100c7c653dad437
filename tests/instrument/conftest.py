"""A small recording that uses every part of the format."""

import numpy as np
import pytest

from analysis.shot.recording import Air, Channel, Gap, Plate, Recording, Role, Setup


@pytest.fixture
def shot() -> Recording:
    """Return a 3-channel shot of 20,000 samples with a light-switch step at 5,000 and a gap at 12,000."""
    rng = np.random.default_rng(7)
    t = np.arange(20_000)
    counts = np.empty((t.size, 3), np.int16)
    counts[:, 0] = np.rint(1500 * np.sin(2 * np.pi * 0.091 * t) + rng.normal(0, 5, t.size))
    counts[:, 1] = np.rint(1200 * np.sin(2 * np.pi * 0.099 * t) + rng.normal(0, 5, t.size))
    counts[:, 2] = np.rint(np.where(t < 5_000, 100, 1800) + rng.normal(0, 20, t.size))
    counts.flags.writeable = False
    return Recording(
        name="shot-1",
        counts=counts,
        sample_rate_hz=30e6,
        channels=(Channel(Role.REFERENCE, 5e-4), Channel(Role.MEASUREMENT, 4e-4, 0.01), Channel(Role.SWITCH, 1e-3)),
        setup=Setup(
            moving_mass_kg=0.01785,
            moving_mass_u_kg=1e-6,
            wavelength_vacuum_m=632.991354e-9,
            air=Air(20.0, 101325.0, 50.0),
            plate=Plate(0.015, 0.002, 0.0003, 0.01, 8510.0, 131e9),
            digitizer_bits=12,
            extra={"rig": "north bench", "air": {"co2_ppm": 450}},
        ),
        trigger_sample=5_000,
        gaps=(Gap(12_000, 77), Gap(15_000, None)),
        started_at="2026-11-20T09:00:07Z",
        note="first touch\nafter cleaning",
        flags=("gap",),
        extra={"global": {"core:author": "someone", "lmm:other": [1, {"a": None}]}},
    )

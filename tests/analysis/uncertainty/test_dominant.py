"""Each source of the budget made dominant once: readings of a motion that it falsified err by what the budget says.

The falsified motions are made, filtered and read again; nothing of the budget's measurement equations is used.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from analysis.reading.read import read_impact
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.uncertainty.budget_sources import InstrumentUncertainty
from analysis.uncertainty.gum_budget import budget
from tests.analysis.shots import shot_of
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_from, position_m
from tests.analysis.uncertainty.test_budget import LASER

RIG = Synthetic(noise_m=1e-12)
DRAWS = 8
EVEN = (np.arange(DRAWS) + 0.5) / DRAWS  # a distribution's quantiles in place of draws
RECTANGLE, GAUSS = 2.0 * EVEN - 1.0, norm.ppf(EVEN) / np.std(norm.ppf(EVEN))
READ = (
    "velocity_in_m_per_s",
    "velocity_out_m_per_s",
    "cor_quasi_static",
    "force_peak_n",
    "contact_time_s",
    "deflection_max_m",
    "stiffness_slope_n_per_m",
)
LENGTHS = ("velocity_in_m_per_s", "velocity_out_m_per_s", "force_peak_n", "deflection_max_m")


def _seen(scale: float = 1.0, clock: float = 1.0, drift_m_per_s: float = 0.0, mass: float = 1.0) -> Motion:
    """Return a motion whose lengths are seen ``scale`` times as large, whose clock counts ``clock`` s a second, ..."""
    time = np.arange(0.0, RIG.duration_s, 1.0 / RIG.rate_hz)  # as the digitizer counts it
    x = scale * position_m(RIG, time / clock) + drift_m_per_s * time
    motion = motion_from(time, x + np.random.default_rng(1).normal(0.0, RIG.noise_m, time.size), RIG)
    return replace(motion, moving_mass_kg=mass * MASS_KG, moving_mass_u_kg=0.0, force_n=mass * motion.force_n)


@dataclass(frozen=True)
class Dominant:
    """How large a source is made, the errors that it may then have, what each makes of a motion, and what it spares."""

    known: Mapping[str, Any]
    errors: np.ndarray
    falsified: Callable[[float], Motion]
    moves: tuple[str, ...]


SIZE = 3e-3
SOURCES = {
    "wavelength": Dominant({"wavelength_vacuum_relative": SIZE}, SIZE * GAUSS, lambda e: _seen(1 + e), LENGTHS),
    "alignment (cosine)": Dominant(
        {"alignment_limit_rad": 0.1},
        0.1 * np.sqrt(EVEN),  # angles of directions uniform in a narrow cone
        lambda a: _seen(float(np.cos(a))),
        LENGTHS,
    ),
    "timebase": Dominant(
        {"timebase_limit": SIZE},
        SIZE * RECTANGLE,
        lambda e: _seen(clock=1 + e),
        tuple(name for name in READ if name not in ("cor_quasi_static", "deflection_max_m")),
    ),
    "mass": Dominant(
        {"mass_u_kg": SIZE * MASS_KG},
        SIZE * GAUSS,
        lambda e: _seen(mass=1 + e),
        ("force_peak_n", "stiffness_slope_n_per_m"),
    ),
    "rest frequency": Dominant(
        {"rest_frequency_u_hz": 2500.0},
        0.5 * 632.8e-9 * 2500.0 * GAUSS,
        lambda v: _seen(drift_m_per_s=v),
        (
            "velocity_in_m_per_s",
            "velocity_out_m_per_s",
            "cor_quasi_static",
            "deflection_max_m",
            "stiffness_slope_n_per_m",
        ),
    ),
}
QUIET = {
    "mass_u_kg": 0.0, "wavelength_vacuum_relative": 0.0, "air_temperature_u_k": 0.0, "air_pressure_u_pa": 0.0,
    "air_humidity_u_percent": 0.0, "alignment_limit_rad": 0.0, "timebase_limit": 0.0, "rest_frequency_u_hz": 0.0,
    "instant_limit_s": 0.0,
}  # fmt: skip


def _value(motion: Motion, name: str) -> float:
    reading = getattr(read_impact(motion), name)
    assert isinstance(reading, Quantity)
    return reading.value


@pytest.fixture(scope="module")
def plain() -> Motion:
    return _seen()


@pytest.mark.parametrize("source", SOURCES)
def test_readings_err_by_what_the_budget_says(source: str, plain: Motion) -> None:
    made = SOURCES[source]
    setup = replace(LASER, moving_mass_u_kg=0.0)
    shot = shot_of(setup=setup, motion=plain, impact=read_impact(plain), fit=None)
    tables = budget(shot, InstrumentUncertainty(**QUIET | made.known))
    impacts = [read_impact(made.falsified(float(error))) for error in made.errors]
    true = read_impact(plain)
    for name in READ:
        table = tables.of(name)
        assert table is not None, name
        off = np.array([getattr(impact, name).value - getattr(true, name).value for impact in impacts])
        rms = float(np.sqrt(np.mean(off**2)))
        if name in made.moves:
            assert table.std_b > 10.0 * table.std_a, name
            assert rms == pytest.approx(table.std_b, rel=0.05), name
        else:
            assert table.std_b < 1e-5 * abs(table.value), name
            assert rms < 5e-6 * abs(table.value), name

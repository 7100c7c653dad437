"""The closed loop on a driven slider: synthetic ones of known truth, and the EMPS benchmark where it is present."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.driven import diagnose_driven
from analysis.diagnosis.result import Diagnosis, Verdict
from analysis.motion import Motion
from analysis.quantity import Quantity
from analysis.shot import AnalysisError
from analysis.signal.record import motion_from_displacement
from instrument.motion_file import read_motion

Floats = np.ndarray
MASS, VISCOUS, OFFSET = 95.0, 200.0, -3.0
ENCODER_M = 2.7e-8  # what the EMPS record shows


def slider(extra: Callable[[Floats, Floats], Floats], noise_n: float = 0.5, seed: int = 1) -> Motion:
    """Return a slider on a smooth path, driven by the force its laws ask for."""
    time = np.arange(0.0, 12.0, 1e-3)
    phases = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, 3)
    waves = [(0.08, 0.31, phases[0]), (0.03, 0.97, phases[1]), (0.008, 2.3, phases[2])]
    x = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in waves)
    v = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * time + p) for a, f, p in waves)
    acc = sum(-a * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * time + p) for a, f, p in waves)
    random = np.random.default_rng(seed)
    force = MASS * acc + VISCOUS * v + OFFSET + extra(x, v) + random.normal(0.0, noise_n, time.size)
    return motion_from_displacement(
        time, x + random.normal(0.0, ENCODER_M, time.size), None, force, moving_mass_kg=None
    )


def only(diagnosis: Diagnosis) -> tuple[str, Quantity]:
    (effect,) = diagnosis.effects
    ((_, quantity),) = effect.parameters.items()
    return effect.name, quantity


def test_clean_is_adequate() -> None:
    diagnosis = diagnose_driven([slider(lambda x, v: 0.0 * x)])
    assert diagnosis.verdict is Verdict.ADEQUATE
    assert diagnosis.effects == ()
    for name, true in zip(
        ("moving_mass_kg", "viscous_coefficient_n_s_per_m", "offset_n"), (MASS, VISCOUS, OFFSET), strict=True
    ):
        found = diagnosis.fit_before.parameters[name]
        assert abs(found.value - true) < 4.0 * found.std


@pytest.mark.parametrize(
    ("name", "true", "law"),
    [
        ("coulomb_friction", 20.0, lambda x, v: 20.0 * np.sign(v)),
        ("quadratic_drag", 150.0, lambda x, v: 150.0 * v * np.abs(v)),
        ("bearing_gradient", 80.0, lambda x, v: 80.0 * x),
    ],
)
def test_an_effect_is_named(name: str, true: float, law: Callable[[Floats, Floats], Floats]) -> None:
    diagnosis = diagnose_driven([slider(law)])
    found, quantity = only(diagnosis)
    assert diagnosis.verdict is Verdict.EFFECT_FOUND
    assert found == name
    assert abs(quantity.value - true) < 4.0 * quantity.std
    assert diagnosis.error_after.force_rms_n < diagnosis.error_before.force_rms_n
    assert diagnosis.error_held_out_after is not None
    assert diagnosis.error_held_out_before is not None
    assert diagnosis.error_held_out_after.force_rms_n < diagnosis.error_held_out_before.force_rms_n


def test_an_effect_off_the_catalogue_stays_unexplained() -> None:
    diagnosis = diagnose_driven([slider(lambda x, v: 6.0 * np.sin(2 * np.pi * x / 0.013))])
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.effects == ()
    assert "times the force's own noise" in diagnosis.remainder


def test_no_force_is_refused() -> None:
    motion = slider(lambda x, v: 0.0 * x)
    bare = motion_from_displacement(motion.time_s, motion.displacement_m.copy(), None, None, moving_mass_kg=None)
    with pytest.raises(AnalysisError, match="force_n"):
        diagnose_driven([bare])


def test_emps(measured: Path) -> None:
    """The published parameters (Janot, Gautier, Brunot 2019) lie within the stated uncertainty."""
    record = read_motion(measured / "emps.csv")
    motion = motion_from_displacement(
        record.time_s, record.displacement_m, None, record.force_n, moving_mass_kg=record.moving_mass_kg
    )
    diagnosis = diagnose_driven([motion])
    name, friction = only(diagnosis)
    assert name == "coulomb_friction"
    assert diagnosis.error_before.force_rms_n == pytest.approx(9.18, abs=0.1)
    assert diagnosis.error_after.force_rms_n == pytest.approx(2.36, abs=0.05)
    viscous = diagnosis.fit_after.parameters["viscous_coefficient_n_s_per_m"]
    assert abs(friction.value - 20.394) < 2.0 * friction.std < 1.5
    assert abs(viscous.value - 203.5) < 2.0 * viscous.std < 15.0
    # what is left is far above the force's noise, and the diagnosis says so instead of claiming to be done
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert "direction" in diagnosis.remainder

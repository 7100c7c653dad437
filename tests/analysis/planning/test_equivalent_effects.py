"""A soft clamp and an undamped second mode of the plate are equivalent, in any shot of the simulated bench."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.diagnosis.findings.words import EQUIVALENT_EFFECTS
from instrument.bench.mechanics import Bodies
from tests.bench.blind import Take, Truth, clean_m, drawn

COMPLIANCE_M_PER_N, CLAMP_HZ = 2e-5, 700.0


def _as_two_modes(bodies: Bodies) -> tuple[Bodies, dict[str, float]]:
    """Return the plate on its soft clamp as its two modes at the contact point: a plate, and a mode beside it."""
    clamp_n_per_m = 1 / COMPLIANCE_M_PER_N
    clamp_kg = clamp_n_per_m / (2 * np.pi * CLAMP_HZ) ** 2
    k = bodies.plate_stiffness_n_per_m
    root = np.sqrt([bodies.plate_mass_kg, clamp_kg])
    values, vectors = np.linalg.eigh(np.array([[k, -k], [-k, k + clamp_n_per_m]]) / np.outer(root, root))
    modal_kg = (root[0] / vectors[0]) ** 2
    plate = replace(bodies, plate_mass_kg=modal_kg[0], plate_stiffness_n_per_m=values[0] * modal_kg[0])
    return plate, {"mass_kg": modal_kg[1], "frequency_hz": np.sqrt(values[1]) / (2 * np.pi), "damping_ratio": 0.0}


def _shot(truth: Truth, speed_m_per_s: float, added_kg: float) -> Truth:
    take = Take(added_kg, 0.02, 0.14)
    return replace(truth, speeds_m_per_s=(speed_m_per_s,), takes=(take,))


@pytest.mark.parametrize("speed_m_per_s", [0.05, 0.2, 0.6])
@pytest.mark.parametrize("added_kg", [0.0, 0.05])
def test_a_soft_clamp_is_an_undamped_second_mode_in_every_shot(speed_m_per_s, added_kg):
    rig = drawn((), 4)
    clamp = {"support_compliance": {"compliance_m_per_n": COMPLIANCE_M_PER_N, "frequency_hz": CLAMP_HZ}}
    plate, mode = _as_two_modes(rig.bodies)
    soft = clean_m(_shot(replace(rig, effects=clamp), speed_m_per_s, added_kg), 0)
    as_mode = replace(rig, bodies=plate, effects={"second_plate_mode": mode})
    two_modes = clean_m(_shot(as_mode, speed_m_per_s, added_kg), 0)
    still = clean_m(_shot(rig, speed_m_per_s, added_kg), 0)
    assert np.abs(soft - still).max() > 1e-6  # micrometres, where the two differ by picometres
    assert np.abs(soft - two_modes).max() < 2e-11
    damped = {"second_plate_mode": {**mode, "damping_ratio": 0.02}}
    assert np.abs(clean_m(_shot(replace(as_mode, effects=damped), speed_m_per_s, added_kg), 0) - soft).max() > 1e-9


def test_a_plan_states_that_they_are_equivalent():
    assert frozenset({"support_compliance", "second_plate_mode"}) in EQUIVALENT_EFFECTS

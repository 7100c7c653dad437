"""Joint fits of shots with and without weights: one plate, one contact, each shot's own stated mass."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.diagnosis import best_first, diagnosis_input
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.inference.fit.shot_fit import fit_shots
from tests.analysis.diagnosis.shots import WHITE_M, motions_of
from tests.bench.blind import Take, Truth, drawn
from tests.bench.displacement_noise import Noise, NoiseKind

LADEN = Take(added_kg=0.05, before_touch_s=0.02, duration_s=0.13)


def _truth() -> Truth:
    rig = drawn((), 6, Noise(NoiseKind.WHITE, white_m=WHITE_M))
    friction = {"coulomb_friction": {"force_n": 2e-5}}
    return replace(rig, effects=friction, speeds_m_per_s=(0.2, 0.3), takes=(Take(), LADEN))


@pytest.fixture(scope="module")
def fitted():
    truth = _truth()
    return truth, fit_shots(motions_of(truth), effects=("coulomb_friction",))


def test_a_joint_fit_takes_every_shots_own_mass(fitted):
    truth, fit = fitted
    # chi^2 of so many samples, and the noise known from no more of them
    assert fit.converged and abs(fit.reduced_chi2 - 1.0) < 3 * np.sqrt(4 / fit.samples)
    true = {
        "plate_stiffness_n_per_m": truth.bodies.plate_stiffness_n_per_m,
        "plate_mass_kg": truth.bodies.plate_mass_kg,
        "contact_stiffness_n_per_m": truth.bodies.contact_stiffness_n_per_m,
        "contact_damping_n_s_per_m": truth.bodies.contact_damping_n_s_per_m,
        "coulomb_friction.force_n": 2e-5,
    }
    for name, value in true.items():
        assert abs(fit.parameters[name].value - value) < 4 * fit.parameters[name].std, name


def test_the_order_of_the_shots_does_not_matter(fitted):
    truth, there = fitted
    back = fit_shots(motions_of(truth)[::-1], effects=("coulomb_friction",))
    for name, quantity in there.parameters.items():
        assert back.parameters[name].value == pytest.approx(quantity.value, abs=0.02 * quantity.std), name


@pytest.mark.parametrize("held", [0, 1])
def test_a_shot_of_another_mass_is_predicted_from_the_others(held, monkeypatch):
    for module in (best_first, diagnosis_input):
        monkeypatch.setattr(module, "choose", lambda data, *, in_turn=True: (held,))
    found = diagnose(motions_of(_truth()))
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    before, after = found.error_held_out_before, found.error_held_out_after
    assert after.displacement_rms_m < 1.2 * WHITE_M < before.displacement_rms_m

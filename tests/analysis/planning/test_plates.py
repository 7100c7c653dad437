"""Joint fits of shots on two plates: one contact, each plate's own stiffness and mass."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from analysis.collision.parameters import Collision
from analysis.diagnosis import best_first, diagnosis_input
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.evidence.prediction_errors import evaluate_predictions
from analysis.diagnosis.findings.model_file import saved
from analysis.diagnosis.findings.result import Verdict
from analysis.fitted.readings_from_fit import contact_cor, fitted_contact_cor
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.flights import noise_of_flights
from analysis.planning.model_comparison import refit_diagnosed
from analysis.planning.next_shot import Reach, contact_s, next_shots
from analysis.planning.precision import plan_precision
from analysis.planning.predictions import blank_shot, predict
from analysis.shot import plate_count
from analysis.shot.plates_of_set import describe_plates, plate_numbers
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Plate
from instrument.bench.mechanics import Bodies
from tests.analysis.diagnosis.shots import WHITE_M, calm, motions_of
from tests.analysis.shots import shots_of
from tests.bench.blind import drawn
from tests.bench.displacement_noise import Noise, NoiseKind

THIN = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)
THICK = replace(THIN, thickness_m=0.4e-3)
_SECOND = ("plate_2_stiffness_n_per_m", "plate_2_mass_kg")
FRICTION = {"coulomb_friction": {"force_n": 2e-6}}


def _taken(on_thin: int, on_thick: int, effects):
    """Return shots on a thin plate, then on one that is stiffer and heavier, and the bodies of both rigs."""
    rig = replace(drawn((), 3, Noise(NoiseKind.WHITE, white_m=WHITE_M), on_thin + on_thick), effects=effects)
    thin = rig.bodies
    thick = replace(
        thin,
        plate_stiffness_n_per_m=1.9 * thin.plate_stiffness_n_per_m,
        plate_mass_kg=1.4 * thin.plate_mass_kg,
    )
    first = [replace(motion, plate=THIN) for motion in motions_of(rig)[:on_thin]]
    then = [replace(motion, plate=THICK) for motion in motions_of(replace(rig, bodies=thick))[on_thin:]]
    return (*first, *then), (thin, thick)


@pytest.fixture(scope="module")
def five():
    motions, bodies = _taken(3, 2, FRICTION)
    return motions, bodies, diagnose(motions)


def _true(thin: Bodies, thick: Bodies) -> dict[str, float]:
    return {
        "plate_stiffness_n_per_m": thin.plate_stiffness_n_per_m,
        "plate_mass_kg": thin.plate_mass_kg,
        "contact_stiffness_n_per_m": thin.contact_stiffness_n_per_m,
        "contact_damping_n_s_per_m": thin.contact_damping_n_s_per_m,
        "plate_2_stiffness_n_per_m": thick.plate_stiffness_n_per_m,
        "plate_2_mass_kg": thick.plate_mass_kg,
    }


def test_a_joint_diagnosis_finds_both_plates_and_what_is_missing(five):
    _, bodies, found = five
    assert found.verdict is Verdict.EFFECT_FOUND and [e.name for e in found.effects] == ["coulomb_friction"]
    fit = found.fit_after
    assert 0.97 < fit.reduced_chi2 < 1.03
    for name, value in (_true(*bodies) | {"coulomb_friction.force_n": 2e-6}).items():
        assert abs(fit.parameters[name].value - value) < 4 * fit.parameters[name].std, name


def test_two_plates_determine_the_contact_better_than_one(five):
    motions, _, found = five
    alone = fit_shots(motions[:3], effects=("coulomb_friction",))
    for name in ("contact_stiffness_n_per_m", "contact_damping_n_s_per_m", "coulomb_friction.force_n"):
        assert found.fit_after.parameters[name].std < 0.9 * alone.parameters[name].std, name


def test_a_held_out_shot_alone_on_its_plate_fits_that_plate_itself(monkeypatch):
    motions, _ = _taken(2, 1, FRICTION)
    for module in (best_first, diagnosis_input):
        monkeypatch.setattr(module, "choose", lambda data, *, in_turn=True: (2,))
    found = diagnose(motions)
    assert [e.name for e in found.effects] == ["coulomb_friction"]
    assert found.error_held_out_after.displacement_rms_m < 1.1 * WHITE_M
    assert found.error_held_out_after.displacement_rms_m < 0.5 * found.error_held_out_before.displacement_rms_m


def test_the_contact_cor_of_each_shot_uses_its_own_plate(five):
    _, bodies, found = five
    read = []
    for index, on in ((0, bodies[0]), (4, bodies[1])):
        fit = found.fit_after.of_shot(index)
        assert set(fit.parameters) == {*_true(*bodies), "coulomb_friction.force_n"} - {*_SECOND}
        assert abs(fit.parameters["plate_mass_kg"].value - on.plate_mass_kg) < 4 * fit.parameters["plate_mass_kg"].std
        mine = list(fit.parameters).index("plate_mass_kg")
        assert np.sqrt(fit.covariance[mine, mine]) == pytest.approx(fit.parameters["plate_mass_kg"].std)
        cor = fitted_contact_cor(fit, on.block_mass_kg)
        true = contact_cor(Collision(velocity_in_m_per_s=-1.0, **asdict(on)))
        assert isinstance(cor, Quantity) and abs(cor.value - true) < 4 * cor.std
        read.append(true)
    assert abs(read[0] - read[1]) > 10 * cor.std  # the plate's mass has a part in it


def test_the_derivatives_by_both_plates_are_those_of_the_sum_of_squares(five):
    motions, _, found = five
    base, shots = base_named("paper").on_plates(plate_count(motions)), averaged_shots(motions)
    problem = Problem(JointData(shots, base), (), noise_of_flights(shots)[0])
    shared = np.array([found.fit_before.parameters[name].value * 1.0001 for name in base.names])
    here = problem.pack(Point(shared, np.array([shot.course.own for shot in shots]), ({},) * len(shots)))
    gradient = problem.square(here).gradient
    for place in range(len(shared)):
        step = np.zeros(here.size)
        step[place] = 1e-5 * abs(here[place])
        left = [problem.whitened_residual(here + sign * step) for sign in (1.0, -1.0)]
        slope = (left[0] @ left[0] - left[1] @ left[1]) / (2 * step[place])
        assert slope == pytest.approx(2 * gradient[place], rel=2e-3), base.names[place]


def test_the_next_shot_is_planned_on_the_last_plate(five):
    motions, bodies, found = five
    fitted = refit_diagnosed(found.fit_after, motions, calm)
    shots = fitted.problem.data.shots
    planned = next_shots(shots, Reach(speeds_m_per_s=(0.3,), added_kg=(0.0,)))[0]
    shown = predict(fitted, blank_shot(planned, fitted))
    assert shown.plate_number == 1
    assert contact_s(planned, shots) == pytest.approx(shots[3].course.contact_time_s)
    deepest_m = -float(shown.displacement_m.min())
    assert deepest_m == pytest.approx(
        0.3 * np.sqrt(bodies[1].block_mass_kg / bodies[1].plate_stiffness_n_per_m), rel=0.1
    )
    assert plan_precision(fitted, "plate_2_stiffness_n_per_m").ratio < 0.7


def test_shots_of_nearly_equal_stated_plates_share_a_plate():
    one, other = (
        replace(motion, plate=plate) for motion, plate in zip(_taken(1, 1, {})[0], (THIN, THICK), strict=True)
    )
    again_measured = replace(one, plate=replace(THIN, thickness_m=0.305e-3))
    silent, impossible = replace(one, plate=None), replace(one, plate=replace(THIN, arm_width_m=0.1))
    set_ = (silent, one, again_measured, impossible, other, silent, one)
    assert plate_numbers(set_) == (0, 0, 0, 0, 1, 1, 0)
    assert describe_plates(set_) == "shots 1-4 on plate 1, 5-6 on plate 2, 7 on plate 1"
    assert describe_plates((one, silent)) == describe_plates(()) == ""


def test_a_model_of_two_plates_predicts_each_shot_on_its_own(five):
    motions, _, found = five
    model = saved(found.fit_after, ("a", "b", "c", "d", "e"), found)
    for motion in (motions[0], motions[4]):
        prediction = evaluate_predictions(shots_of([motion]), model)
        assert prediction.error_model.displacement_rms_m < 1.2 * WHITE_M
        assert prediction.error_base.displacement_rms_m > 2 * WHITE_M
    elsewhere = evaluate_predictions(shots_of([replace(motions[4], plate=None)]), model)
    assert elsewhere.error_model.displacement_rms_m > 1e3 * WHITE_M

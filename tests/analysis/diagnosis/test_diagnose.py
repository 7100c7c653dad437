"""The closed loop on rigs whose truth is known here and nowhere in the analysis."""

import math

import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from analysis.diagnosis.findings.result_file import diagnosis_result
from analysis.diagnosis.findings.wording import in_words
from analysis.shot.shot import Cancelled
from tests.analysis.diagnosis.shots import WHITE_M, shots


def test_a_clean_rig_on_a_wandering_floor_is_adequate() -> None:
    found = diagnose(shots({}, floor=True))
    assert found.verdict is Verdict.ADEQUATE
    assert found.effects == ()
    assert found.error_before == found.error_after
    assert any("tilt below" in line for line in in_words(found).blind_spots)


def test_friction_is_named_and_the_error_falls_to_the_noise() -> None:
    found = diagnose(shots({"coulomb_friction": {"force_n": 2e-6}}))
    assert found.verdict is Verdict.EFFECT_FOUND
    (effect,) = found.effects
    assert effect.name == "coulomb_friction"
    assert effect.indistinguishable_from == ()
    force = effect.parameters["force_n"]
    assert abs(force.value - 2e-6) < 4 * force.std
    assert force.std < 2e-8
    assert found.error_before.displacement_rms_m > 1.05 * WHITE_M
    assert found.error_after.displacement_rms_m == pytest.approx(WHITE_M, rel=0.03)
    assert found.error_after.reduced_chi2 == pytest.approx(1.0, abs=0.1)
    assert found.error_held_out_before is not None
    assert found.error_held_out_after is not None
    assert found.error_held_out_after.displacement_rms_m == pytest.approx(WHITE_M, rel=0.05)
    assert found.fit_after.effects == (effect_named("coulomb_friction"),)
    assert diagnosis_result(found)["effects"][0]["parameters"]["force_n"]["value"] == force.value


def test_two_strong_effects_are_both_named() -> None:
    truth = {"viscous_drag": {"coefficient_n_s_per_m": 8e-4}, "cubic_stiffness": {"coefficient_n_per_m3": 3e5}}
    found = diagnose(shots(truth, count=2))
    assert found.verdict is Verdict.EFFECT_FOUND
    assert {effect.name for effect in found.effects} == set(truth)
    for effect in found.effects:
        for name, value in truth[effect.name].items():
            quantity = effect.parameters[name]
            assert abs(quantity.value - value) < 4 * quantity.std


@pytest.mark.slow
def test_what_is_off_the_catalogue_is_explained_in_part_and_the_rest_described() -> None:
    found = diagnose(shots({"magnet": {"force_n": -3e-3, "range_m": 7e-4}}, count=2))
    assert found.verdict is Verdict.PARTLY_EXPLAINED
    assert "mostly resembles" in found.sentence
    assert "rms in displacement" in in_words(found).remainder
    assert found.error_held_out_after is not None and found.error_held_out_before is not None
    assert found.error_held_out_after.displacement_rms_m < found.error_held_out_before.displacement_rms_m
    assert found.error_after.displacement_rms_m < found.error_before.displacement_rms_m


def test_one_shot_is_judged_without_a_held_out_one() -> None:
    found = diagnose(shots({"viscous_drag": {"coefficient_n_s_per_m": 2e-4}}, count=1))
    assert found.error_held_out_before is None
    named = {one.name for found_one in found.effects for one in (found_one.effect, *found_one.indistinguishable_from)}
    assert "viscous_drag" in named


def test_an_accepted_effect_is_part_of_the_model_before() -> None:
    motions = shots({"viscous_drag": {"coefficient_n_s_per_m": 2e-4}}, count=2)
    done: list[float] = []
    found = diagnose(motions, accepted=("viscous_drag",), progress=lambda _what, fraction: done.append(fraction))
    assert done[0] == 0.0 and done == sorted(done) and 0.5 < done[-1] <= 1.0
    assert found.verdict is Verdict.ADEQUATE
    assert found.fit_before.effects == (effect_named("viscous_drag"),)
    assert math.isclose(found.fit_before.parameters["viscous_drag.coefficient_n_s_per_m"].value, 2e-4, rel_tol=0.02)


def test_a_diagnosis_can_be_stopped_and_names_what_it_does_not_know() -> None:
    motions = shots({})
    with pytest.raises(Cancelled):
        diagnose(motions, cancelled=lambda: True)
    with pytest.raises(ValueError, match="no effect is called 'gremlins'"):
        diagnose(motions, accepted=("gremlins",))

"""Shots whose flights bend each in its own way: told from laws that all share, and taken along."""

import sys

import numpy as np
import pytest

from analysis.collision.effects import named
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.model_file import from_text, saved, to_text
from analysis.diagnosis.result import Verdict
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.foretold import foretell
from analysis.inference.fit.course import read_course
from analysis.inference.fit.samples import averaged_shots
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.noise.own_flights import own_flights
from analysis.shot.motion import Motion
from tests.analysis.camera import MASS_KG, Camera
from tests.benchmarks.stories import simulated

SPEEDS = (0.13, 0.16, 0.19, 0.23)
OWN = ((0.012, -0.02), (-0.015, 0.01), (0.02, 0.018), (-0.01, -0.016))  # m/s^2


def shots(bends: tuple[tuple[float, float], ...], drag: float = 0.0, growing: float = 0.0) -> list[Motion]:
    return [
        Camera(speed, bends=bend, drag=drag, growing=growing).motion(20e-6, seed)
        for seed, (speed, bend) in enumerate(zip(SPEEDS, bends, strict=True))
    ]


def test_bends_that_no_shared_law_gives_are_the_shots_own() -> None:
    assert own_flights(averaged_shots(shots(OWN)), CRITERIA.own_flights) == (named("flight_acceleration"),)


@pytest.mark.parametrize("drag", [0.0, 0.12])
def test_a_drag_that_all_shots_share_is_not(drag: float) -> None:
    assert own_flights(averaged_shots(shots(((0.0, 0.0),) * 4, drag)), CRITERIA.own_flights) == ()


def test_two_shots_cannot_contradict_a_law() -> None:
    assert own_flights(averaged_shots(shots(OWN)[:2]), CRITERIA.own_flights) == ()


def test_a_shot_fitted_with_its_own_bends_gives_them() -> None:
    motion = Camera(bends=(0.012, -0.02)).motion(20e-6)
    fit = fit_shots([motion], model="contact", effects=("flight_acceleration",))
    assert fit.converged
    for name, true in (("before", 0.012), ("after", -0.02)):
        found = fit.shots[0].own_parameters[f"flight_acceleration.{name}_m_per_s2"]
        assert abs(found.value - true) < 4.0 * found.std < 0.002


def test_what_is_taken_along_is_no_finding_and_a_foretold_shot_has_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    # The search itself is tested elsewhere: here nothing is searched but the shots' own bends.
    monkeypatch.setattr(sys.modules["analysis.diagnosis.question"], "trial_effects", lambda _laws=(): ())
    motions = shots(OWN)
    found = diagnose(motions[:3], model="contact")
    assert "its own flight acceleration" in found.sentence
    assert found.effects == ()
    assert found.fit_before.effects == found.fit_after.effects == (named("flight_acceleration"),)
    model = from_text(to_text(saved(found.fit_after, ["1", "2", "3"], found)))
    assert model.effects == (named("flight_acceleration"),)
    assert set(model.parameters) == set(model.base_parameters) == {
        "contact_stiffness_n_per_m", "contact_damping_n_s_per_m",
    }  # fmt: skip
    told = foretell(motions[3:], ["4"], model)
    assert told.error_model.displacement_rms_m < 24e-6  # noise of 20 um
    assert told.error_base.displacement_rms_m == pytest.approx(told.error_model.displacement_rms_m, rel=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_the_contact_is_read_through_a_cameras_noise(seed: int) -> None:
    """The lowest sample and an onset lie many frames off; all samples together do not."""
    motion = Camera().motion(40e-6, seed)
    course = read_course(motion.time_s, motion.displacement_m, motion.valid)
    assert course.velocity_in_m_per_s == pytest.approx(-0.17, rel=0.02)
    # Half a sine is not quite the contact: its dashpot draws the touch some 6 ms ahead, a tenth of the contact.
    assert course.touch_time_s == pytest.approx(0.6, abs=0.009)
    assert course.contact_time_s == pytest.approx(np.pi * np.sqrt(MASS_KG / 190.0), rel=0.25)


def test_what_one_law_of_all_shots_bends_is_not_taken_for_flights_of_their_own() -> None:
    """A set that chance made suspect: 20 uN of friction bent the flights of all shots alike, and nothing was named."""
    motions = simulated()
    assert own_flights(averaged_shots(motions), CRITERIA.own_flights) != ()
    found = diagnose(motions)
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    assert found.verdict is Verdict.EFFECT_FOUND and not found.fit_after.shots[0].own_parameters

"""Shots whose flights bend each in its own way: told from laws that all share, and taken along."""

import numpy as np
import pytest

from analysis.diagnosis import diagnose
from analysis.diagnosis.foretold import foretell
from analysis.diagnosis.model_file import from_text, saved, to_text
from analysis.diagnosis.own_flights import own_flights
from analysis.diagnosis.samples import together
from analysis.model.fitting import fit_shots
from analysis.model.starts import read
from analysis.motion import Motion
from tests.analysis.camera import REST_M, Camera

SPEEDS = (0.13, 0.16, 0.19, 0.23)
OWN = ((0.012, -0.02), (-0.015, 0.01), (0.02, 0.018), (-0.01, -0.016))  # m/s^2


def shots(bends: tuple[tuple[float, float], ...], drag: float = 0.0, growing: float = 0.0) -> list[Motion]:
    return [
        Camera(speed, bends=bend, drag=drag, growing=growing).motion(20e-6, seed)
        for seed, (speed, bend) in enumerate(zip(SPEEDS, bends, strict=True))
    ]


def test_bends_that_no_shared_law_gives_are_the_shots_own() -> None:
    assert own_flights(together(shots(OWN))) == ("flight_acceleration",)


@pytest.mark.parametrize("drag", [0.0, 0.12])
def test_a_drag_that_all_shots_share_is_not(drag: float) -> None:
    assert own_flights(together(shots(((0.0, 0.0),) * 4, drag))) == ()


def test_two_shots_cannot_contradict_a_law() -> None:
    assert own_flights(together(shots(OWN)[:2])) == ()


def test_a_shot_fitted_with_its_own_bends_gives_them() -> None:
    motion = Camera(bends=(0.03, -0.02)).motion(5e-6)
    fit = fit_shots([motion], model="contact", effects=("flight_acceleration",))
    assert fit.converged
    for name, true in (("before", 0.03), ("after", -0.02)):
        found = fit.shots[0].own_parameters[f"flight_acceleration.{name}_m_per_s2"]
        assert abs(found.value - true) < 4.0 * found.std < 0.01


def test_what_is_taken_along_hides_nothing_and_foretells_a_shot_of_other_bends() -> None:
    motions = shots(OWN, growing=200.0)
    found = diagnose(motions[:3], model="contact")
    assert "flight acceleration" in found.sentence
    assert "flight_acceleration" not in {effect.name for effect in found.effects}
    model = from_text(to_text(saved(found.fit_after, ["1", "2", "3"], found)))
    assert "flight_acceleration" in model.effects
    assert not any("flight_acceleration" in name for name in model.parameters)
    told = foretell(motions[3:], ["4"], model)
    assert told.error_model.displacement_rms_m < 25e-6
    assert told.error_model.displacement_rms_m < told.error_base.displacement_rms_m


@pytest.mark.parametrize("seed", range(4))
def test_the_contact_is_read_through_a_cameras_noise(seed: int) -> None:
    """The lowest sample and an onset lie many frames off; all samples together do not."""
    motion = Camera().motion(40e-6, seed)
    course = read(motion.time_s, motion.displacement_m, motion.valid)
    assert course.velocity_in_m_per_s == pytest.approx(-0.17, rel=0.02)
    assert course.touch_position_m == pytest.approx(REST_M, abs=1e-3)
    assert course.contact_time_s == pytest.approx(np.pi * np.sqrt(0.0912 / 190.0), rel=0.15)

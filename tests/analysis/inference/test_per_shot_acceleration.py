"""Shots whose flights bend each in its own way: told from laws that all share, and taken along."""

import sys
from dataclasses import replace
from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.collision.effects import effect_named
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.evidence.prediction_errors import evaluate_predictions
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.diagnosis.findings.result import Verdict
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.model.course import read_course
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise import per_shot_acceleration as module
from analysis.inference.noise.per_shot_acceleration import per_shot_nuisances
from analysis.shot.motion import Motion
from tests.analysis.camera import MASS_KG, Camera
from tests.analysis.shots import shots_of
from tests.benchmarks.stories import simulated

SPEEDS = (0.13, 0.16, 0.19, 0.23)
OWN = ((0.012, -0.02), (-0.015, 0.01), (0.02, 0.018), (-0.01, -0.016))  # m/s^2


def shots(bends: tuple[tuple[float, float], ...], drag: float = 0.0, growing: float = 0.0) -> list[Motion]:
    return [
        Camera(speed, bends=bend, drag=drag, growing=growing).motion(20e-6, seed)
        for seed, (speed, bend) in enumerate(zip(SPEEDS, bends, strict=True))
    ]


def test_bends_that_no_shared_law_gives_are_the_shots_own() -> None:
    assert per_shot_nuisances(averaged_shots(shots(OWN)), CRITERIA.own_flights) == (
        effect_named("flight_acceleration"),
    )


@pytest.mark.parametrize("drag", [0.0, 0.12])
def test_a_drag_that_all_shots_share_is_not(drag: float) -> None:
    assert per_shot_nuisances(averaged_shots(shots(((0.0, 0.0),) * 4, drag)), CRITERIA.own_flights) == ()


def test_two_shots_cannot_contradict_a_law() -> None:
    assert per_shot_nuisances(averaged_shots(shots(OWN)[:2]), CRITERIA.own_flights) == ()


def test_a_shot_fitted_with_its_own_bends_gives_them() -> None:
    motion = Camera(bends=(0.012, -0.02)).motion(20e-6)
    fit = fit_shots([motion], model="contact", effects=("flight_acceleration",))
    assert fit.converged
    for name, true in (("before", 0.012), ("after", -0.02)):
        found = fit.shots[0].own_parameters[f"flight_acceleration.{name}_m_per_s2"]
        assert abs(found.value - true) < 4.0 * found.std < 0.002


def test_what_is_taken_along_is_no_finding_and_a_foretold_shot_has_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    # The search itself is tested elsewhere: here nothing is searched but the shots' own bends.
    monkeypatch.setattr(sys.modules["analysis.diagnosis.diagnosis_input"], "trial_effects", lambda _laws=(): ())
    motions = shots(OWN)
    found = diagnose(motions[:3], model="contact")
    assert "Fitted per shot: flight acceleration" in found.sentence
    assert found.effects == ()
    assert found.fit_before.effects == found.fit_after.effects == (effect_named("flight_acceleration"),)
    model = from_text(to_text(saved(found.fit_after, ["1", "2", "3"], found)))
    assert model.effects == (effect_named("flight_acceleration"),)
    assert set(model.parameters) == set(model.base_parameters) == {
        "contact_stiffness_n_per_m", "contact_damping_n_s_per_m",
    }  # fmt: skip
    told = evaluate_predictions(shots_of(motions)[3:], model)
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
    assert per_shot_nuisances(averaged_shots(motions), CRITERIA.own_flights) != ()
    found = diagnose(motions)
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    assert found.verdict is Verdict.EFFECT_FOUND and not found.fit_after.shots[0].own_parameters


def test_a_flight_is_a_line_with_the_accelerations_that_each_law_would_give_it() -> None:
    """Before the touch and some time after the release, of valid samples, thirty at least."""
    time_s = 7.0 + np.arange(400) * 1e-3
    course = Some(touch_time_s=7.15, release_time_s=7.25, contact_time_s=0.1, touch_position_m=2.0)
    place = np.where(time_s < 7.2, 2.0 - 3.0 * (time_s - 7.15), 2.0 + 0.5 * (time_s - 7.25))
    valid = np.ones(400, dtype=bool)
    valid[[0, 1, 20, 300]] = False
    shot: Any = Some(
        course=course, centre_s=time_s, spacing_s=1e-3, valid=valid, displacement_m=place, weight=1.5
    )  # fmt: skip
    first, second = module._flights(shot)
    for flight, part, speed in ((first, slice(2, 147), -3.0), (second, slice(266, 400), 0.5)):
        np.testing.assert_array_equal(flight.displacement_m, place[part])
        np.testing.assert_array_equal(flight.valid, valid[part])
        middle = time_s[part][valid[part]].mean()
        u = time_s[part] - middle
        np.testing.assert_allclose(flight.columns, np.stack([u**0, u, 0.5 * u**2], axis=1), atol=1e-12)
        away = np.interp(middle, time_s, place) - 2.0
        brakes = [-np.sign(speed), -speed, -speed * abs(speed)]
        np.testing.assert_allclose(flight.laws, [1.0, *brakes, away], rtol=1e-9)
        assert flight.weight == 1.5
    valid[:117] = False
    assert [flight.displacement_m.size for flight in module._flights(shot)] == [30, 134]
    valid[117] = False
    assert len(list(module._flights(shot))) == 1


def test_bends_are_fitted_under_the_noise_that_they_leave_and_brakes_only_brake() -> None:
    random = np.random.default_rng(4)
    u = np.linspace(-1.0, 1.0, 200)
    columns = np.stack([u**0, u, 0.5 * u**2], axis=1)
    bends = np.array([0.3, -0.2, 0.5])
    flights = [
        module._Flight(np.ones(200, dtype=bool), columns @ [k, 1.0, bend] + 0.01 * random.standard_normal(200), columns,
                       np.zeros(5), 1.0)
        for k, bend in enumerate(bends)
    ]  # fmt: skip
    own, count = module._log_likelihood(flights, np.eye(3), np.zeros(3, dtype=bool), 1e-3)
    # of white noise alone: each line and bend taken out
    left = [f.displacement_m - columns @ np.linalg.lstsq(columns, f.displacement_m, rcond=None)[0] for f in flights]
    square = sum(float(one @ one) for one in left) / 600
    assert count == 3 and own == pytest.approx(-300 * (np.log(2 * np.pi * square) + 1), abs=1.0)
    law = np.stack([[1.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    shared, acting = module._log_likelihood(flights, law, np.array([False, True]), 1e-3)
    assert acting == 2 and shared < own - 50.0
    brakes, acting = module._log_likelihood(flights, -law, np.array([False, True]), 1e-3)
    assert acting == 1 and brakes < shared - 1.0


@pytest.mark.parametrize(("share", "own"), [(1.01, True), (0.99, False)])
def test_bends_are_the_shots_own_where_laws_would_leave_them_with_less_than_the_chance(
    monkeypatch: pytest.MonkeyPatch, share: float, own: bool
) -> None:
    asked: list[tuple[tuple[int, ...], list[bool]]] = []
    gain = share * 0.5 * chi2.isf(1e-3, 3)

    def likelihood(flights: Any, bends: np.ndarray, one_way: np.ndarray, _spacing_s: float) -> tuple[float, int]:
        asked.append((bends.shape, one_way.tolist()))
        return [(0.0, 5), (gain, 8)][len(asked) - 1]

    monkeypatch.setattr(module, "_log_likelihood", likelihood)
    taken = averaged_shots(shots(OWN))
    assert per_shot_nuisances(taken, 1e-3) == ((effect_named("flight_acceleration"),) if own else ())
    # tilt and gradient may pull either way, friction and drags only brake; a bend may be any
    assert asked == [((8, 5), [False, True, True, True, False]), ((8, 8), [False] * 8)]
    assert per_shot_nuisances([replace(one, wavelength_m=633e-9) for one in taken], 1e-3) == () and len(asked) == 2

"""Flags, the contact's COR and the effects in the settings are those of the shot's present fit."""

from dataclasses import replace

import pytest

from analysis.collision.effects import effect_named
from analysis.collision.effects.row import Effect
from analysis.fitted import fitted_shot
from analysis.fitted.fitted_shot import (
    ReadingsModel,
    can_be_fitted,
    fit_jointly,
    fit_pending,
    fit_shot,
    read_together,
    readings_model,
    readings_model_result,
    unfitted,
    with_fit,
    with_fit_pending,
)
from analysis.shot.consistency import flags_affecting
from analysis.shot.fit import Fit
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.shot import AnalysisError, Shot
from tests.analysis.shots import PAPER_FIT
from tests.app import synthetic


def of_fit(contact_damping_n_s_per_m: float, *flags: str, effects: tuple[Effect, ...] = ()) -> Fit:
    damping = Quantity(contact_damping_n_s_per_m, 1e-4)
    parameters = {**PAPER_FIT.parameters, "contact_damping_n_s_per_m": damping}
    return replace(PAPER_FIT, parameters=parameters, flags=flags, effects=effects)


def contact(shot: Shot) -> float:
    assert shot.impact is not None
    reading = shot.impact.cor_kinetic.contact
    assert isinstance(reading, Quantity)
    return reading.value


def test_a_new_fit_replaces_all_of_the_old_one() -> None:
    shot = replace(synthetic.shot(), flags=("clipped",))
    first = with_fit(shot, of_fit(0.4, "contact_damping_n_s_per_m_at_bound"))
    assert first.flags == ("clipped", "contact_damping_n_s_per_m_at_bound")
    second = with_fit(first, of_fit(0.2, effects=(effect_named("tilt"),)))
    assert second.flags == ("clipped",)
    assert contact(second) > contact(first) + 0.05
    assert second.settings.effects == (effect_named("tilt"),)
    assert with_fit(first, second.fit) == second
    assert second.impact is not None and shot.impact is not None
    others = replace(second.impact, cor_kinetic=shot.impact.cor_kinetic)
    assert others == shot.impact


def test_a_flag_of_the_motion_is_kept_when_the_fit_is_replaced() -> None:
    shot = synthetic.shot()
    assert shot.motion is not None
    shot = replace(shot, motion=replace(shot.motion, flags=("noise_not_known",)), flags=("noise_not_known",))
    assert with_fit(with_fit(shot, of_fit(0.4, "noise_not_known")), of_fit(0.4)).flags == ("noise_not_known",)


def test_a_failed_fit_is_flagged_until_one_succeeds() -> None:
    failed = with_fit(with_fit(synthetic.shot(), of_fit(0.4, "one")), None)
    assert failed.fit is None and failed.flags == ("fit_failed",)
    assert failed.impact is not None and isinstance(failed.impact.cor_kinetic.contact, NotSeen)
    again = with_fit(failed, replace(of_fit(0.4), converged=False))
    assert again.flags == ("fit_not_converged",)


@pytest.mark.parametrize("missing", ["motion", "impact"])
def test_a_shot_without_anything_to_fit_is_unchanged(missing: str) -> None:
    shot = replace(synthetic.shot(), **{missing: None})
    assert fit_shot(shot, ("tilt",)) is shot


def test_a_joint_fit_gives_each_shot_its_own_part() -> None:
    shot = synthetic.shot()
    assert shot.fit is not None
    parts = tuple(replace(shot.fit.shots[0], reduced_chi2=value) for value in (1.5, 2.5))
    mine = replace(shot.fit, shots=parts, reduced_chi2=2.0).of_shot(1)
    assert mine.shots == (parts[1],) and mine.reduced_chi2 == 2.5


def test_vibration_flags_concern_the_fitted_numbers_alone() -> None:
    shot = synthetic.shot()
    assert shot.impact is not None
    shaken = replace(shot, impact=replace(shot.impact, flags=("vibration",)), flags=("vibration",))
    fitted = with_fit(shaken, of_fit(0.4))
    assert "plate_shaken" in flags_affecting("plate_mass_kg", fitted.flags)
    assert flags_affecting("stiffness_slope_n_per_m", fitted.flags) == ()
    assert "plate_shaken" not in with_fit(replace(fitted, impact=shot.impact), of_fit(0.4)).flags


def test_a_shot_that_was_read_awaits_its_fit_where_there_is_something_to_fit() -> None:
    shot = replace(synthetic.shot(), flags=("clipped",))
    waits = with_fit_pending(shot)
    assert waits.flags == ("clipped", "fit_to_follow") and fit_pending(waits) and not fit_pending(shot)
    assert waits.impact is not None and isinstance(waits.impact.cor_kinetic.contact, NotSeen)
    assert with_fit_pending(waits) == waits
    assert with_fit(waits, of_fit(0.4)).flags == ("clipped",)
    driven = replace(shot, impact=None, settings=replace(shot.settings, model="driven"))
    assert can_be_fitted(shot) and can_be_fitted(driven) and with_fit_pending(driven).impact is None
    unwanted = replace(shot, settings=replace(shot.settings, fit=False))
    for other in (replace(shot, impact=None), replace(driven, motion=None), unwanted):
        assert not can_be_fitted(other) and with_fit_pending(other) is other
    failed = unfitted(shot, "too short")
    assert failed.fit is None and failed.fit_problem == "too short" and failed.flags == ("clipped", "fit_failed")
    stopped = unfitted(shot, "given up", stopped=True)
    assert stopped.fit_stopped and not (failed.fit_stopped or with_fit(stopped, of_fit(0.4)).fit_stopped)


def test_a_fit_that_fails_keeps_the_effects_that_were_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> Fit:
        raise AnalysisError("no trajectory")

    monkeypatch.setattr(fitted_shot, "fit_jointly", fails)
    shot = synthetic.shot()
    failed = fit_shot(shot, (effect_named("tilt"),))
    assert failed.settings == replace(shot.settings, effects=(effect_named("tilt"),))
    assert (failed.fit, failed.fit_problem, failed.problem) == (None, "no trajectory", shot.problem)
    driven = replace(shot, impact=None, problem="odd", settings=replace(shot.settings, model="driven"))
    again = fit_shot(driven, ())
    assert (again.problem, again.fit_problem) == ("odd", shot.fit_problem)
    assert fit_shot(replace(driven, problem=None), ()).problem == "no trajectory"


def test_a_fit_is_made_of_the_shots_own_motion_model_and_time(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[object, ...]] = []

    def fits(*given: object) -> Fit:
        asked.append(given)
        return of_fit(0.4, effects=(effect_named("tilt"),))

    monkeypatch.setattr(fitted_shot, "fit_jointly", fits)
    shot = synthetic.shot()
    shot = replace(shot, fit_problem="old", settings=replace(shot.settings, model="clamped", fit_seconds=3.5))
    stop = bool
    found = fit_shot(shot, (effect_named("tilt"),), stop)
    ((shots, *rest),) = asked
    assert rest == ["clamped", (effect_named("tilt"),), stop, 3.5]
    assert [one.motion for one in shots] == [shot.motion]
    assert found.fit_problem is None and found.fit is not None and found.settings.effects == (effect_named("tilt"),)


def test_what_ends_a_fit_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    limits: list[tuple[float, str]] = []
    ending: list[Exception] = []

    def ends(work: object, seconds: float, cancelled: object, words: str) -> Fit:
        limits.append((seconds, words))
        raise ending[-1]

    monkeypatch.setattr(fitted_shot, "run_with_time_limit", ends)
    shot = synthetic.shot()
    for error, said in (
        (AnalysisError("no touch"), "^no touch$"),
        (ZeroDivisionError("by zero"), r"^the model cannot be fitted to this motion \(by zero\)$"),
        (ValueError("x"), r"^the model cannot be fitted to this motion \(x\)$"),
    ):
        ending.append(error)
        with pytest.raises(AnalysisError, match=said):
            fit_jointly([shot, shot], "paper", (), seconds=4.0)
    assert {seconds for seconds, _ in limits} == {16.0}  # twice four for each of two
    assert "after 8 s" in limits[0][1]
    ending.append(KeyError("a fault of the program"))
    with pytest.raises(KeyError):
        fit_jointly([shot], "paper", ())


def test_the_fitted_ones_of_shots_are_read_with_their_part_of_a_joint_fit() -> None:
    one = synthetic.shot()
    two, none = with_fit(one, of_fit(0.4)), replace(one, fit=None)
    assert one.fit is not None
    parts = tuple(replace(one.fit.shots[0], plate_number=number) for number in (0, 1))
    damping = "contact_damping_n_s_per_m"
    joint = replace(of_fit(0.1), shots=parts)
    joint = replace(joint, parameters={**joint.parameters, damping: Quantity(0.3, 0.0)})
    first, unread, second = read_together([one, none, two], joint)
    assert unread is none and first.fit is one.fit and second.fit is two.fit
    assert first.readings_fit is not None and second.readings_fit is not None
    assert contact(first) == pytest.approx(contact(with_fit(one, joint)))
    assert first.readings_fit == joint.on_plate(0) and second.readings_fit == joint.on_plate(1)


def test_readings_that_come_from_a_model_are_named_with_it() -> None:
    shot = with_fit(synthetic.shot(), of_fit(0.4, effects=(effect_named("tilt"),)))
    contact_only = ReadingsModel("paper", (effect_named("tilt"),), ("cor_kinetic.contact",))
    assert readings_model(shot) == contact_only
    assert readings_model_result(contact_only) == {
        "base": "paper", "effects": ["tilt"], "readings": ["cor_kinetic.contact"],
    }  # fmt: skip
    assert shot.impact is not None
    pulse = ("force_peak_n", "force_fwhm_s", "contact_time_s", "deflection_max_m")
    coarse = replace(shot, impact=replace(shot.impact, flags=("read_from_model",)))
    both = readings_model(replace(coarse, readings_fit=of_fit(0.4)))
    assert both == ReadingsModel("paper", (), (*pulse, "cor_kinetic.contact"))
    failed = with_fit(shot, None)
    assert readings_model(failed) is None is readings_model(replace(shot, impact=None))
    assert readings_model(replace(with_fit(coarse, None), fit=of_fit(0.4))) == ReadingsModel("paper", (), pulse)
    assert readings_model(replace(failed, fit=of_fit(0.4))) is None is readings_model_result(None)

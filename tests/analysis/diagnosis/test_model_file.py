"""The model file: what is written comes back, and what is wrong is named."""

import dataclasses
import math
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.findings.model_file import (
    ModelFileError,
    SavedModel,
    drift,
    effect_in_file,
    from_text,
    saved,
    to_text,
)
from analysis.diagnosis.findings.result import Errors
from analysis.drive import LAWS
from analysis.shot.quantity import Quantity

MODEL = SavedModel(
    base="paper",
    effects=(effect_named("coulomb_friction"),),
    parameters={
        "plate_stiffness_n_per_m": Quantity(221.3977, 0.0003),
        "coulomb_friction.force_n": Quantity(9.0e-5, 3.5e-8),
    },
    covariance=np.array([[9e-8, 1e-13], [1e-13, 1.2e-15]]),
    shots=('shot "1"', "shot\\2", "shot\n3 \U0001f4cf\U000e0001"),
    errors={"before": Errors(1e-6, 2e-4, 7e-3, 8e4), "after": Errors(4e-10, 2e-6, 1e-3, 1.0)},
)


def test_what_is_written_comes_back() -> None:
    back = from_text(to_text(MODEL))
    np.testing.assert_array_equal(back.covariance, MODEL.covariance)
    values = {name: (q.value, q.std) for name, q in back.parameters.items()}
    assert values == {name: (q.value, q.std) for name, q in MODEL.parameters.items()}
    other = [field.name for field in dataclasses.fields(MODEL) if field.name not in ("covariance", "parameters")]
    assert [getattr(back, name) for name in other] == [getattr(MODEL, name) for name in other]


def test_an_effect_that_no_diagnosis_named_stays_marked() -> None:
    tried = dataclasses.replace(MODEL, tried=(effect_named("coulomb_friction"),))
    assert "tried" not in to_text(MODEL) and from_text(to_text(tried)).tried == (effect_named("coulomb_friction"),)
    with pytest.raises(ModelFileError, match="tried: 'tilt'"):
        from_text(to_text(dataclasses.replace(MODEL, tried=(effect_named("tilt"),))))


def test_a_name_that_is_no_text_does_no_harm() -> None:
    assert from_text(to_text(dataclasses.replace(MODEL, shots=("shot\udcff",)))).shots == ("shot?",)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('schema = "levimass.model/1"', "schema = 3", "schema"),
        ('base = "paper"', 'base = "glue"', "base"),
        ('effects = ["coulomb_friction"]', 'effects = ["gremlins"]', "gremlins"),
        ("value = 221.3977", 'value = "much"', "plate_stiffness_n_per_m.value"),
        ("[9e-08, 1e-13]", "[9e-08]", "covariance"),
        ("[9e-08, 1e-13]", f"[{'9' * 400}, 1e-13]", "covariance"),
        ("schema =", f"more = {'9' * 5000}\nschema =", "not TOML"),
        ("[errors.before]", "[errors.never]", "errors.never"),
        ("[parameters]", "[parameters", "not TOML"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(old: str, new: str, named: str) -> None:
    text = to_text(MODEL)
    assert old in text
    with pytest.raises(ModelFileError, match=named) as caught:
        from_text(text.replace(old, new))
    assert "\n" not in str(caught.value)


def test_numbers_of_hundreds_of_digits_are_refused_by_name() -> None:
    head = 'schema = "levimass.model/1"\nbase = "paper"\n[parameters]\n'
    with pytest.raises(ModelFileError, match="plate_mass_kg"):
        from_text(f"{head}plate_mass_kg = {{value = {'9' * 400}, std = 1}}")


def test_a_covariance_may_be_missing() -> None:
    model = from_text('schema = "levimass.model/1"\nbase = "paper"\n[parameters]\nx = {value = 1, std = 1}')
    assert model.covariance.shape == (0, 0)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("value = 221.3977", "value = 0.0", "parameters.plate_stiffness_n_per_m.value: 0 is not above zero"),
        ("value = 221.3977", "value = -205.0", "-205 is not above zero"),
        ("value = 221.3977", "value = 1e300", "no value that a rig can have"),
        ("value = 221.3977", "value = 1e-300", "not above zero"),
        ("value = 221.3977", "value = nan", "no value that a rig can have"),
        ("value = 9e-05", "value = inf", "coulomb_friction.force_n.value"),
        ("std = 0.0003", "std = -0.0003", "std: -0.0003 is below zero"),
        ('["coulomb_friction"]', '["coulomb_friction", "coulomb_friction"]', "named twice"),
        ("[9e-08, 1e-13]", "[9e-08, 2e-13]", "not symmetric"),
        ("[9e-08, 1e-13]", "[-9e-08, 1e-13]", "below zero"),
        ("[9e-08, 1e-13]", "[nan, 1e-13]", "not finite"),
        ("1e-13", "1e-9", "a correlation beyond one"),
        ("1e-13", "-1e-9", "a correlation beyond one"),
    ],
)
def test_values_that_no_rig_has_are_refused_as_the_file_is_read(old: str, new: str, named: str) -> None:
    text = to_text(MODEL)
    assert old in text
    with pytest.raises(ModelFileError, match=re.escape(named)):
        from_text(text.replace(old, new))


def test_a_covariance_that_is_none_is_refused_though_each_pair_could_be() -> None:
    parameters = {name: Quantity(1.0, 1.0) for name in ("x", "y", "z")}
    rows = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    wrong = dataclasses.replace(MODEL, effects=(), parameters=parameters, covariance=rows)
    with pytest.raises(ModelFileError, match="below zero"):
        from_text(to_text(wrong))
    np.testing.assert_array_equal(
        from_text(to_text(dataclasses.replace(wrong, covariance=abs(rows)))).covariance, abs(rows)
    )


def test_what_the_data_did_not_tell_may_be_no_number() -> None:
    parameters = {**MODEL.parameters, "plate_mass_kg": Quantity(2e-4, math.nan)}
    covariance = np.full((3, 3), math.nan)
    covariance[:2, :2] = MODEL.covariance
    back = from_text(to_text(dataclasses.replace(MODEL, parameters=parameters, covariance=covariance)))
    np.testing.assert_array_equal(back.covariance, covariance)


@pytest.mark.parametrize("std", [math.inf, math.nan])
def test_a_model_without_any_known_uncertainty_is_read(std: float) -> None:
    parameters = {name: dataclasses.replace(value, std=std) for name, value in MODEL.parameters.items()}
    model = dataclasses.replace(MODEL, parameters=parameters, covariance=np.full_like(MODEL.covariance, std))
    np.testing.assert_array_equal(from_text(to_text(model)).covariance, model.covariance)


def test_how_far_a_new_fit_lies_from_the_saved_model_in_what_both_leave_open() -> None:
    now = {
        "plate_stiffness_n_per_m": Quantity(221.3977 - 0.0015, 0.0004), "coulomb_friction.force_n": Quantity(9e-5, 0.0),
        "another": Quantity(1.0, 1.0),
    }  # fmt: skip
    saved_friction = {**MODEL.parameters, "coulomb_friction.force_n": Quantity(1e-5, 0.0)}  # known exactly, both times
    fit: Any = SimpleNamespace(parameters=now)
    found = drift(dataclasses.replace(MODEL, parameters=saved_friction), fit)
    assert found == {"plate_stiffness_n_per_m": pytest.approx(-3.0)}


def test_what_is_saved_of_a_fit_and_of_the_diagnosis_that_led_to_it() -> None:
    friction, tilt, drift_of_sensor = effects_named(("coulomb_friction", "tilt", "flight_acceleration"))
    parameters = {"plate_stiffness_n_per_m": Quantity(200.0, 0.1)}
    fit: Any = SimpleNamespace(
        model="clamped", effects=(friction, tilt), parameters=parameters, covariance="covariance"
    )

    def diagnosed(effects: tuple[Any, ...] = (), *, converged: bool = True) -> Any:
        before = SimpleNamespace(effects=effects, converged=converged, parameters={"base": 1})
        names = ("before", "after", "held_out_before", "held_out_after")
        errors = {f"error_{name}": name if name != "held_out_before" else None for name in names}
        return SimpleNamespace(fit_before=before, **errors)

    alone = saved(fit, ["one", "two"])
    assert (alone.base, alone.effects, alone.parameters) == ("clamped", (friction, tilt), parameters)
    assert (alone.covariance, alone.shots, alone.errors) == ("covariance", ("one", "two"), {})  # type: ignore[comparison-overlap]
    assert alone.base_parameters == {} and alone.tried == ()
    told = saved(fit, ["one"], diagnosed((drift_of_sensor,)), (tilt, effect_named("adhesion")))
    assert told.errors == {name: name for name in ("before", "after", "held_out_after")}
    assert told.base_parameters == {"base": 1} and told.tried == (tilt,)
    assert saved(fit, [], diagnosed((friction,))).base_parameters == {}  # no base alone
    assert saved(fit, [], diagnosed(converged=False)).base_parameters == {}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ('[parameters]\nx = 3', "parameters.x: value and std are expected"),
        ('[parameters]\nx = {value = true, std = 1}', "x.value: a number is expected"),
        ('[parameters]\nx = {value = 1}', "x.std: a number is expected"),
        ('parameters = 3', "parameters: a table is expected"),
        ('shots = "one"', "shots: a list of names is expected"),
        ('shots = ["one", 2]', "shots: a list of names is expected"),
        ('effects = ["coulomb_friction"]\ntried = ["tilt"]', "tried: 'tilt' is not among the effects"),
        ('[base_parameters]\nplate_mass_kg = {value = 0.0, std = 1}', "base_parameters.plate_mass_kg.value: 0 is not"),
        ('[parameters]\ncontact_damping_n_s_per_m = {value = -0.1, std = 1}', "-0.1 is below zero"),
        ('[errors.before]\ndisplacement_rms_m = 1', "before.velocity_rms_m_per_s: a number is expected"),
        ('errors = {before = 3}', "errors.before: one of before, after, held_out_before, held_out_after is expected"),
    ],
)  # fmt: skip
def test_what_is_no_model_is_refused_by_the_name_of_its_key(change: str, named: str) -> None:
    head = 'schema = "levimass.model/1"\nbase = "paper"\n'
    with pytest.raises(ModelFileError, match=re.escape(named)):
        from_text(head + change)


def test_an_effect_may_take_stiffness_away_and_damping_may_be_nothing() -> None:
    text = 'schema = "levimass.model/1"\nbase = "paper"\neffects = ["bearing_gradient"]\n[parameters]\n'
    for name, value in (("bearing_gradient.stiffness_n_per_m", -3.0), ("contact_damping_n_s_per_m", 0.0)):
        assert from_text(f"{text}'{name}' = {{value = {value}, std = 0}}").parameters[name].value == value


def test_a_drive_has_a_catalogue_of_its_own() -> None:
    friction = effect_in_file("coulomb_friction", "driven")
    assert friction is LAWS["coulomb_friction"] and effect_in_file("coulomb_friction", "paper") is effect_named(
        "coulomb_friction"
    )
    assert effect_in_file("adhesion", "driven") is None and effect_in_file("stribeck_friction", "paper") is None

"""A saved model of two plates on a shot of one of them, and what is said of how well it predicted."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.diagnosis.evidence import prediction_errors as module
from analysis.diagnosis.evidence.prediction_errors import (
    PredictedShot,
    PredictionTest,
    _all,
    _on_its_plate,
    evaluate_predictions,
)
from analysis.diagnosis.findings.model_file import SavedModel
from analysis.diagnosis.findings.result import Errors
from analysis.diagnosis.findings.wording import prediction_words
from analysis.shot.plate import stated_stiffness_n_per_m
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Plate
from analysis.shot.shot import AnalysisError, Cancelled
from tests.analysis.synthetic_collision import Synthetic, motion_of

THIN = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)
NAMES = ("plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m")
SECOND = ("plate_2_stiffness_n_per_m", "plate_2_mass_kg")


def _model(first: float, second: float | None) -> SavedModel:
    """Return a model of one or two plates that are so many times as stiff as THIN states."""
    stated = stated_stiffness_n_per_m(THIN)
    assert stated is not None
    values = dict(zip(NAMES, (first * stated, 2e-4, 1e4), strict=True))
    if second is not None:
        values |= dict(zip(SECOND, (second * stated, 3e-4), strict=True))
    parameters = {name: Quantity(value, 0.0) for name, value in values.items()}
    return SavedModel("paper", (), parameters, np.eye(len(parameters)), (), {})


@pytest.mark.parametrize(
    ("first", "second", "its"),
    [(1.02, 1.9, 0), (1.9, 1.02, 1), (0.5, 1.9, 1), (2.1, 0.5, 1), (0.6, 2.5, 0)],  # nearest as a ratio
)
def test_a_shot_is_predicted_with_the_plate_that_it_states(first: float, second: float, its: int) -> None:
    motion = replace(motion_of(Synthetic()), plate=THIN)
    model = _model(first, second)
    used, base = _on_its_plate(motion, model, model.parameters)
    stiffness, mass = (model.parameters[name].value for name in (SECOND if its else NAMES[:2]))
    for parameters in (used.parameters, base):
        assert set(parameters) == set(NAMES)
        assert parameters[NAMES[0]].value == stiffness and parameters[NAMES[1]].value == mass
        assert parameters[NAMES[2]].value == 1e4  # the contact is the same on both


def test_a_shot_that_states_no_plate_is_predicted_with_the_first() -> None:
    motion, model = motion_of(Synthetic()), _model(1.9, 1.02)
    used, _ = _on_its_plate(motion, model, model.parameters)
    assert used.parameters[NAMES[0]] == model.parameters[NAMES[0]]
    alone = _model(1.9, None)
    assert _on_its_plate(replace(motion, plate=THIN), alone, alone.parameters)[0].parameters == alone.parameters


def _errors(rms_m: float, force_n: float = math.nan, chi2: float = 1.0) -> Errors:
    return Errors(rms_m, 2.0 * rms_m, force_n, chi2)


def test_errors_of_several_shots_are_their_rms_and_what_failed_is_left_out() -> None:
    shots = [
        PredictedShot("a", False, _errors(3e-9, 6.0, 1.0), _errors(1e-9)),
        PredictedShot("b", False, _errors(4e-9, 8.0, 4.0), _errors(2e-9)),
        PredictedShot("c", False, None, None, "no motion"),
    ]
    of_base = _all(shots, "error_base")
    assert of_base.displacement_rms_m == pytest.approx(math.sqrt(12.5) * 1e-9)
    assert of_base.force_rms_n == pytest.approx(math.sqrt(50.0))
    assert of_base.reduced_chi2 == 2.5
    with pytest.raises(AnalysisError, match="no shot could be predicted: no motion"):
        _all(shots[2:], "error_base")


@pytest.mark.parametrize(
    ("base", "model", "words"),
    [
        (_errors(4e-9), _errors(1e-9), "predicted better by 75%: 0.001 µm rms against 0.004 µm of the base model"),
        (_errors(1e-9), _errors(2e-9), "predicted worse by 100%: 0.002 µm"),
        (_errors(math.nan, 8.0), _errors(math.nan, 2.0), "predicted better by 75%: 2 N rms against 8 N"),
        (_errors(0.0), _errors(2e-9), "predicted worse: 0.002 µm"),
    ],
)
def test_the_sentence_says_by_how_much_and_over_how_many(base: Errors, model: Errors, words: str) -> None:
    shot, failed = PredictedShot("1", False, base, model), PredictedShot("2", False, None, None, "too short")
    one, two = (
        prediction_words(PredictionTest("paper", (), base, model, (*shots, failed))) for shots in ([shot], [shot] * 2)
    )
    assert one.startswith(words)
    assert one.endswith("over 1 shot") and two.endswith("over 2 shots")


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("base", ["paper", "driven"])
def test_each_shot_is_predicted_by_base_and_model_and_what_fails_says_why(
    base: str, known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    stopped = False
    model: Any = SimpleNamespace(
        base=base, base_parameters={"known": 1} if known else {}, shots=("b", "z"), effects=("effects",)
    )  # fmt: skip
    failing = {"c": AnalysisError("too short"), "d": np.linalg.LinAlgError("singular")}

    def one(motion: str, of: Any, parameters: Any) -> Any:
        asked.append((motion, parameters))
        if motion in failing:
            raise failing[motion]
        return _errors(3e-9, 3.0), _errors(1e-9, 1.0)

    def fitted(of: Any, name: str, effects: Any, stop: Any) -> Any:
        assert (of, name, effects, stop()) == (shots, base, (), stopped)
        return SimpleNamespace(parameters={"fitted": 1})

    monkeypatch.setattr(module, "fit_jointly", fitted)
    monkeypatch.setattr(module, "_on_its_plate", lambda motion, model, base: (model, base))
    monkeypatch.setattr(module, "_driven" if base == "driven" else "_collision", one)
    shots: Any = [SimpleNamespace(name=name, path=None, motion=name) for name in "abcd"]
    found = evaluate_predictions(shots, model)
    assert asked == [(motion, {"known" if known else "fitted": 1}) for motion in "abcd"]
    assert [(shot.name, shot.took_part, shot.problem) for shot in found.shots] == [
        ("a", False, None), ("b", True, None), ("c", False, "too short"), ("d", False, "singular"),
    ]  # fmt: skip
    assert (found.model, found.effects) == (base, ("effects",))
    assert (found.error_base.force_rms_n, found.error_model.force_rms_n) == (3.0, 1.0)
    assert found.shots[0].error_base == _errors(3e-9, 3.0) and found.shots[3].error_model is None
    stopped = True
    with pytest.raises(Cancelled):
        evaluate_predictions(shots, model, lambda: True)
    with pytest.raises(AnalysisError, match="nothing to foretell"):
        evaluate_predictions([], model)


def test_a_drives_force_is_predicted_by_base_and_by_model(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(module, "prepare_drive", lambda motions: ("prepared", motions))
    monkeypatch.setattr(module, "Table", SimpleNamespace(of=lambda prepared: ("table", prepared)))
    monkeypatch.setattr(module, "prediction_residual_n", lambda *given: asked.append(given) or len(asked))
    monkeypatch.setattr(module, "rms", lambda left: 10.0 * left)
    monkeypatch.setattr(module, "force_noise", lambda motion: 4.0 if motion == "motion" else 0.0)
    given: Any = ("motion", SimpleNamespace(effects=("law",), parameters="whole"), "base")
    bare, whole = module._driven(*given)
    table = ("table", ("prepared", ["motion"]))
    assert asked == [(table, (), "base"), (table, ("law",), "whole")]
    assert (bare.force_rms_n, bare.reduced_chi2, whole.force_rms_n, whole.reduced_chi2) == (10.0, 6.25, 20.0, 25.0)
    assert math.isnan(bare.displacement_rms_m) and math.isnan(bare.velocity_rms_m_per_s)

"""Laws where the catalogue leaves something: which are tried, which effects stay beside them, how fine their curves."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.effects import effects_named
from analysis.diagnosis.learning import beyond_catalogue as module
from analysis.diagnosis.learning import law_learning
from analysis.diagnosis.result import FoundEffect, Verdict
from analysis.diagnosis.verdict.cross_validation import Prediction
from analysis.shot.quantity import Quantity

DRAG, TILT, MODE = effects_named(("viscous_drag", "tilt", "block_mode"))


def prediction(surprise: float) -> Prediction:
    return Prediction((), surprise, 1.0, np.zeros(1), lambda difference: 0.0)


def test_effects_that_predict_better_help() -> None:
    told = {"before": prediction(100.0), "nearest": prediction(50.0), "worse": prediction(150.0), "lost": None}

    def helps(nearest: Any, held: tuple[int, ...] = (1,)) -> Any:
        asked: list[Any] = []

        def predict(fitted: Any, of: Any, floor: Any, stop: Any) -> Any:
            asked.append((fitted.name, of, floor, stop))
            return told[fitted.name]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "predict", predict)
            given: Any = (before, nearest, held, "stop")
            found = module._helps(*given)
        assert all(one[1:] == (held, nearest.noise, "stop") for one in asked)
        return found

    before = SimpleNamespace(name="before", noise="before's", converged=True)
    nearest = SimpleNamespace(name="nearest", noise="its", converged=True)
    assert helps(nearest) == (told["before"], told["nearest"])
    assert helps(nearest, ()) is None and helps(before) is None
    for name, converged in (("worse", True), ("lost", True), ("nearest", False)):
        assert helps(SimpleNamespace(name=name, noise="its", converged=converged)) is None


def beyond(bic: float, verdict: Verdict) -> Any:
    return SimpleNamespace(fitted=SimpleNamespace(bic=bic), verdict=verdict)


def test_the_first_that_explains_all_is_taken_else_the_likeliest(monkeypatch: pytest.MonkeyPatch) -> None:
    partly, learned = Verdict.PARTLY_EXPLAINED, Verdict.LAW_LEARNED
    made: list[Any] = []

    def in_turn(*given: Any) -> Any:
        for one in tried:
            made.append(one)
            yield one

    monkeypatch.setattr(module, "_in_turn", in_turn)
    none: Any = None
    tried = [beyond(5.0, partly), beyond(9.0, learned), beyond(1.0, learned)]
    assert module.beyond_catalogue(none, none, ()) is tried[1] and made == tried[:2]
    tried = [beyond(5.0, partly), beyond(3.0, partly), beyond(4.0, partly)]
    assert module.beyond_catalogue(none, none, ()) is tried[1]
    tried = []
    assert module.beyond_catalogue(none, none, ()) is None


@pytest.mark.parametrize("passed", [True, False])
@pytest.mark.parametrize("explains", [True, False])
def test_an_effect_that_no_longer_pays_beside_a_law_goes(
    passed: bool, explains: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drag brings 9.9 and a tilt 40; without drag the tilt brings 30."""
    bic = {(DRAG, TILT): 100.0, (TILT,): 109.9, (DRAG,): 140.0, (): 139.9}

    class Fit:
        def __init__(self, effects: tuple[Any, ...]) -> None:
            self.effects, self.bic, self.noise = effects, bic[effects], f"noise {len(effects)}"

        def continued(self, stop: Any) -> "Fit":
            return self

        def linearise(self) -> str:
            return "at"

    def without(fitted: Any, effect: Any, stop: Any) -> Any:
        return Fit(tuple(one for one in fitted.effects if one != effect))

    monkeypatch.setattr(module, "without_effect", without)
    monkeypatch.setattr(module, "residual_of", lambda fitted, at: SimpleNamespace(significant=not explains))
    monkeypatch.setattr(module, "predict", lambda fitted, held, noise, stop: (fitted.effects, held, noise))
    monkeypatch.setattr(module, "effect_parameters", lambda fitted: {TILT: {"angle_rad": Quantity(2.0, 1.0)}})
    monkeypatch.setattr(module, "snr", lambda fitted, at, effect: 7.0)
    monkeypatch.setattr(module, "missed_without", lambda fitted, fewer: 6.0)
    monkeypatch.setattr(module, "in_joint_fit", lambda law, fitted, named: (law.form, named))
    laws = (SimpleNamespace(form="linear"),)
    found: Any = SimpleNamespace(
        fitted=Fit((DRAG, TILT)), predictions=("base", "told"), residual="before", explains=True, laws=laws
    )
    effects = [FoundEffect(DRAG, {}, {"snr": 50.0}), FoundEffect(TILT, {}, {"snr": 60.0, "other": 1.0})]
    given: Any = (found, effects, "base", (3,), "stop")
    made: Any = module._together(*given, passed=passed)
    kept = FoundEffect(TILT, {"angle_rad": Quantity(2.0, 1.0)}, {"snr": 6.0, "other": 1.0, "delta_bic": -30.0})
    assert made.fitted.effects == (TILT,)
    assert made.predictions == ("base", ((TILT,), (3,), "noise 1")) and made.laws == (("linear", True),)
    named = passed or explains
    assert (made.effects, list(made.imitations)) == (([kept], []) if named else ([], [kept]))
    assert made.verdict is (Verdict.LAW_LEARNED if explains else Verdict.PARTLY_EXPLAINED)
    monkeypatch.setattr(module, "predict", lambda *_: None)  # where the fit without drag foretells nothing
    again: Any = module._together(*given, passed=passed)
    assert again.predictions == ("base", "told")


def curve(bic: float, at_best: float = 0.0) -> Any:
    return SimpleNamespace(bic=bic, at_best=at_best)


@pytest.mark.parametrize(
    ("bics", "most", "pieces", "best"),
    [
        ({24: 80.0, 48: 60.0, 96: 40.0}, 96, [24, 48, 96], 40.0),
        ({24: 80.0, 48: 60.0, 96: 40.0}, 95, [24, 48], 60.0),
        ({24: 89.9, 48: 80.0}, 96, [24, 48], 89.9),  # ten for twice the knots
        ({24: 90.1}, 96, [24], 100.0),
        ({24: 80.0}, 96, [24, 48], 80.0),  # where nothing can be followed it ends
    ],
)
def test_a_curve_gets_twice_the_knots_while_that_pays(
    bics: dict[int, float], most: int, pieces: list[int], best: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def refine(learned: Any, so_many: int, stop: Any, *, steps: int) -> Any:
        asked.append(so_many)
        if so_many not in bics:
            raise Infeasible("nowhere")
        return curve(bics[so_many])

    monkeypatch.setattr(law_learning, "refine", refine)
    assert law_learning.finer(curve(100.0), most, lambda: False).bic == best and asked == pieces


def test_a_form_may_gain_a_fifth_more_than_its_curve() -> None:
    start: Any = curve(200.0)
    curves = [curve(0.0, 150.0), curve(0.0, 100.0)]
    assert law_learning.forms_may_reach(80.1, curves, start) and not law_learning.forms_may_reach(79.9, curves, start)
    assert law_learning.forms_may_reach(math.inf, curves[:1], start)
    assert not law_learning.forms_may_reach(9e9, [], start)
    for one_body in (True, False):
        data = SimpleNamespace(base=SimpleNamespace(one_body=one_body))
        fit: Any = SimpleNamespace(problem=SimpleNamespace(data=data))
        places = {argument.where for argument in law_learning.arguments_of(fit)}
        assert places == ({"block", "contact"} if one_body else {"block", "plate", "contact"})
    best = [curve(50.0), curve(40.0)]
    assert law_learning._meets(curve(51.9), best) and not law_learning._meets(curve(52.1), best)

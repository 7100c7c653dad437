"""Laws where the catalogue leaves something: which are tried, which effects stay beside them, how fine their curves."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.effects import effects_named
from analysis.diagnosis import explanation
from analysis.diagnosis import laws_outside_catalogue as module
from analysis.diagnosis.evidence.cross_validation import Prediction
from analysis.diagnosis.explanation import Explanation
from analysis.diagnosis.findings.result import FoundEffect, Verdict
from analysis.diagnosis.learning import law_learning
from analysis.diagnosis.learning.law_learning import Discovery
from analysis.inference import base_named
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

    before = SimpleNamespace(name="before", noise="before's")
    nearest = SimpleNamespace(name="nearest", noise="its")
    assert helps(nearest) == (told["before"], told["nearest"])
    assert helps(nearest, ()) is None and helps(before) is None
    for name in ("worse", "lost"):
        assert helps(SimpleNamespace(name=name, noise="its")) is None


def known_of(
    verdict: Verdict, nearest: Any, effects: Any = (), predictions: Any = ("p0", "p1"), imitations: Any = ("imitates",)
) -> Any:
    trail: Any = SimpleNamespace(start=SimpleNamespace(name="before"))
    return Explanation(
        verdict, trail, nearest or trail.start, "at", "after", effects, "left", (1,), predictions, (), imitations  # type: ignore[arg-type]
    )  # fmt: skip


@pytest.mark.parametrize("effects", [(), ("effect",)])
def test_laws_are_learned_beside_what_is_named_or_beside_what_only_imitates(
    effects: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(module, "laws_given_effects", lambda *given: asked.append(("beside", *given)) or "found")
    monkeypatch.setattr(module, "beyond_catalogue", lambda *given: asked.append(("beyond", *given)) or "found")
    known = known_of(Verdict.PARTLY_EXPLAINED if effects else Verdict.UNEXPLAINED, "nearest", effects)
    law: Any = "law"
    made: Any = module.explain_with_laws(known, law, beat=3.0)
    assert made == "found" and asked == [("beside" if effects else "beyond", known, "law", 3.0)]
    assert module.explain_with_laws(known, law) and asked[1][-1] == math.inf
    asked.clear()
    for verdict in (Verdict.ADEQUATE, Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED):
        explained = known_of(verdict, None)
        assert module.explain_with_laws(explained, law) is explained and not asked


def test_without_a_law_what_only_imitates_is_not_told_to_predict(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "laws_given_effects", lambda *_: None)
    monkeypatch.setattr(module, "beyond_catalogue", lambda *_: None)
    law: Any = "law"
    imitated = known_of(Verdict.UNEXPLAINED, "nearest")
    assert module.explain_with_laws(imitated, law).predictions == ("p0", "p0")  # type: ignore[comparison-overlap]
    for known in (
        known_of(Verdict.UNEXPLAINED, None), known_of(Verdict.PARTLY_EXPLAINED, "nearest", ("effect",)),
        known_of(Verdict.UNEXPLAINED, "nearest", predictions=None),
    ):  # fmt: skip
        assert module.explain_with_laws(known, law) is known


@pytest.mark.parametrize("significant", [True, False])
def test_a_fit_with_laws_takes_the_place_of_the_model_after(significant: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explanation, "remainder_of", lambda *given: ("remainder", *given))
    known = known_of(Verdict.UNEXPLAINED, "nearest")
    rest: Any = SimpleNamespace(significant=significant, misfit="misfit")
    anything: Any = ("start", ("law",), "fitted", rest, ("q0", "q1"))
    found, effects, imitations = Discovery(*anything), cast(Any, ["e"]), cast(Any, ["i"])
    made: Any = module._explained(known, (7,), Verdict.LAW_LEARNED, found, effects=effects, imitations=imitations)
    assert (made.verdict, made.after, made.effects, made.laws) == (Verdict.LAW_LEARNED, "fitted", ("e",), ("law",))
    assert (made.imitations, made.held_out, made.predictions) == (("i",), (7,), ("q0", "q1"))
    assert made.remainder == (("remainder", "fitted", "misfit") if significant else None)
    assert (made.trail, made.nearest, made.linearised) == (known.trail, known.nearest, known.linearised)


def beyond(bic: float, verdict: Verdict) -> Any:
    return SimpleNamespace(bic=bic, verdict=verdict)


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
    assert module.beyond_catalogue(none, none, 9.0) is tried[1] and made == tried[:2]
    tried = [beyond(5.0, partly), beyond(3.0, partly), beyond(4.0, partly)]
    assert module.beyond_catalogue(none, none, 9.0) is tried[1]
    tried = []
    assert module.beyond_catalogue(none, none, 9.0) is None


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
    rest = SimpleNamespace(significant=not explains)
    monkeypatch.setattr(
        module, "residual_of", lambda fitted, at: rest if at == "at" and fitted.effects == (TILT,) else None
    )
    monkeypatch.setattr(module, "predict", lambda fitted, held, noise, stop: (fitted.effects, held, noise))
    monkeypatch.setattr(module, "effect_parameters", lambda fitted: {TILT: {"angle_rad": Quantity(2.0, 1.0)}})
    monkeypatch.setattr(module, "snr", lambda fitted, at, effect: 7.0)
    monkeypatch.setattr(module, "missed_without", lambda fitted, fewer: 6.0)
    monkeypatch.setattr(module, "in_joint_fit", lambda law, fitted, named: (law.form, named))
    laws = (SimpleNamespace(form="linear"),)
    found: Any = SimpleNamespace(
        start="start",
        fitted=Fit((DRAG, TILT)),
        predictions=("base", "told"),
        residual="before",
        explains=True,
        laws=laws,
    )
    effects = [FoundEffect(DRAG, {}, {"snr": 50.0}), FoundEffect(TILT, {}, {"snr": 60.0, "other": 1.0})]
    known = known_of(Verdict.UNEXPLAINED, "nearest", *((effects,) if passed else ()), imitations=effects)
    law: Any = SimpleNamespace(held=(3,), stop="stop")
    monkeypatch.setattr(module, "remainder", lambda *given: given)
    base: Any = "base"
    made: Any = module._together(known, law, found, base)
    kept = FoundEffect(TILT, {"angle_rad": Quantity(2.0, 1.0)}, {"snr": 6.0, "other": 1.0, "delta_bic": -30.0})
    assert made.after.effects == (TILT,) and made.remainder == (made.after, rest)
    assert made.predictions == ("base", ((TILT,), (3,), "noise 1")) and made.laws == (("linear", True),)
    named = passed or explains
    assert (made.effects, made.imitations) == (((kept,), ()) if named else ((), (kept,)))
    assert made.verdict is (Verdict.LAW_LEARNED if explains else Verdict.PARTLY_EXPLAINED)
    monkeypatch.setattr(module, "predict", lambda *_: None)  # where the fit without drag foretells nothing
    again: Any = module._together(known, law, found, base)
    assert again.predictions == ("base", "told")


def curve(bic: float, least_form_bic: float = 0.0) -> Any:
    return SimpleNamespace(bic=bic, least_form_bic=least_form_bic)


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
    assert law_learning.forms_may_beat(80.1, curves, start) and not law_learning.forms_may_beat(79.9, curves, start)
    assert law_learning.forms_may_beat(math.inf, curves[:1], start)
    assert not law_learning.forms_may_beat(9e9, [], start)
    for model, places in (("contact", {"block", "contact"}), ("paper", {"block", "plate", "contact"})):
        data = SimpleNamespace(base=base_named(model))
        fit: Any = SimpleNamespace(problem=SimpleNamespace(data=data))
        assert {argument.where for argument in law_learning.arguments_of(fit)} == places
    best = [curve(50.0), curve(40.0)]
    assert law_learning._meets(curve(51.9), best) and not law_learning._meets(curve(52.1), best)


@pytest.mark.parametrize("explains", [True, False])
@pytest.mark.parametrize(("helped", "converged"), [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize("joined", [True, False])
@pytest.mark.parametrize("reach", [True, False])
@pytest.mark.parametrize("nearest_bic", [-20.5, -19.5])
@pytest.mark.parametrize("faint", [True, False])
def test_the_law_alone_two_laws_and_a_law_beside_effects_are_tried_in_turn(
    faint: bool, nearest_bic: float, reach: bool, joined: bool, helped: bool, converged: bool, explains: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Laws without the effects must come below 8, and below 28 above the effects where these help.

    Where the effects leave no more than chance may, laws must come below them.  Effects whose fit has not converged
    join no law and are no explanation, but a law must be as likely as they are.
    """
    asked: list[Any] = []

    class Limit:
        def within(self, what: str, work: Any, otherwise: Any) -> Any:
            asked.append(what)
            return work()

    limit, told, rest = Limit(), [], SimpleNamespace(significant=True, faint=faint)
    first = SimpleNamespace(explains=explains, fitted=curve(-21.0), laws=(), residual=None, predictions=None)
    alone: Any = SimpleNamespace(
        start="start", held=(3,), tell=lambda *what: told.append(what), stop="stop", limit=limit, found=first,
        one_or_two_laws_may_beat=lambda beat: reach and beat == instead,
    )  # fmt: skip
    instead = min(8.0, nearest_bic + (0.0 if faint else 28.0)) if helped else 8.0
    nearest: Any = SimpleNamespace(linearise=lambda: "at", bic=nearest_bic, converged=converged)
    second_bic = -21.0
    seconds: list[Any] = []

    def second_law(*given: Any, beat: float) -> Any:
        seconds.append((*given, beat))
        return SimpleNamespace(**{**vars(first), "fitted": curve(second_bic)})

    monkeypatch.setattr(module, "learn_second_law", second_law)
    monkeypatch.setattr(module, "learn_law", lambda *given, beat: ("law", *given, beat) if joined else None)
    monkeypatch.setattr(module, "conclude", lambda *, explained, **_: explained)
    monkeypatch.setattr(module, "_explained", lambda *given, **more: ("explained", *given[1:], more))
    helps = ("before", "told") if helped else None
    monkeypatch.setattr(module, "_helps", lambda *given: helps if given == helping else None)
    monkeypatch.setattr(module, "_together", lambda *given: ("together", *given))
    monkeypatch.setattr(module, "residual_of", lambda fitted, at: rest if (fitted, at) == (nearest, "at") else None)
    helping = ("start", nearest, (3,), "stop")
    tell = alone.tell
    expected: list[Any] = []
    if reach:
        expected.append(("explained", (3,), explains, SimpleNamespace(**vars(first)), {}))
    known = known_of(Verdict.UNEXPLAINED, nearest, imitations=("effects",))
    helped &= converged
    if helped and joined:
        law = ("law", nearest, (3,), tell, limit, 8.0)
        expected.append(("together", known, alone, law, "before"))
    if helped:
        without_law = Discovery("start", (), nearest, cast(Any, rest), cast(Any, helps))  # type: ignore[arg-type]
        expected.append(("explained", (3,), False, without_law, {"imitations": ("effects",)}))
    assert list(module._in_turn(known, alone, 8.0)) == expected
    assert seconds == ([(first, (3,), tell, limit, instead)] if reach and not explains else [])
    second = ["a second law"] if reach and not explains else []
    assert asked == second + (["a law beside the effects that came nearest"] if helped else [])
    assert [what for what, _ in told] == (["learning a law beside the effects that came nearest"] if helped else [])
    first.fitted, second_bic = curve(instead), instead  # no better than they must be
    assert list(module._in_turn(known, alone, 8.0)) == expected[reach:]
    alone.found = None
    assert list(module._in_turn(known, alone, 8.0)) == expected[reach:]


@pytest.mark.parametrize("foretold", [True, False])
def test_a_law_is_learned_beside_effects_that_passed(foretold: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    limit: Any = SimpleNamespace(within=lambda what, work, otherwise: work())
    found: Any = SimpleNamespace(predictions=("p0", "p1"))
    monkeypatch.setattr(module, "learn_laws", lambda *given, beat: found if given == learning and beat == 8.0 else None)
    monkeypatch.setattr(module, "_together", lambda *given: given)
    monkeypatch.setattr(module, "predict", lambda *given: given if foretold else None)
    named: Any = SimpleNamespace(noise="noise")
    known = known_of(Verdict.PARTLY_EXPLAINED, named, ("effect",))
    law: Any = SimpleNamespace(held=(3,), tell=lambda *what: None, stop="stop", limit=limit)
    learning = (named, (3,), law.tell, limit)
    base = (known.before, (3,), "noise", "stop") if foretold else "p0"
    assert module.laws_given_effects(known, law, 8.0) == (known, law, found, base)  # type: ignore[comparison-overlap]
    assert module.laws_given_effects(known, law, math.inf) is None

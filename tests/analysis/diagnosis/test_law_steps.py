"""On the way to a law: which arguments get curves, which of those finer knots, which forms are fitted and when."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision import Infeasible
from analysis.diagnosis.learning import law_learning as module
from analysis.diagnosis.learning.learned_law import FormFit
from analysis.shot import Cancelled

NAMES = "abcdefghij"


def argument(name: str, where: str = "block") -> Any:
    return SimpleNamespace(name=name, where=where)


def curve(bic: float, name: str = "a", least_form_bic: float | None = None) -> Any:
    return SimpleNamespace(
        bic=bic, least_form_bic=bic if least_form_bic is None else least_form_bic,
        terms=[SimpleNamespace(argument=argument(name))],
        problem="problem", z="z",
    )  # fmt: skip


def calm() -> bool:
    return False


class Screen:
    """Curves of every argument by their criteria: roughly, searched to the end, and with finer knots."""

    def __init__(
        self, patch: pytest.MonkeyPatch, rough: dict[str, float | None], end: dict[str, Any], fine: dict[str, Any]
    ) -> None:
        self.asked: list[Any] = []
        self.told: list[Any] = []

        def screen(before_law: Any, one: Any, pieces: int, stop: Any, *, steps: int) -> Any:
            assert (before_law, pieces, stop, steps) == ("before_law", 12, calm, 3)
            if rough[one.name] is None:
                raise Infeasible("nowhere")
            return curve(rough[one.name], one.name)  # type: ignore[arg-type]

        def fit_terms(problem: Any, z: Any, terms: Any, stop: Any, *, steps: int) -> Any:
            name = terms[-1].argument.name
            assert (problem, z, stop, steps) == ("problem", "z", calm, 4)
            self.asked.append(name)
            if name not in end:
                raise Infeasible("nowhere")
            return curve(*end[name]) if isinstance(end[name], tuple) else curve(end[name], name)

        def finer(learned: Any, most: int, stop: Any) -> Any:
            name = learned.terms[-1].argument.name
            assert (most, stop) == (96, calm)
            self.asked.append(f"finer {name}")
            return curve(*fine[name]) if isinstance(fine.get(name), tuple) else curve(fine.get(name, learned.bic), name)

        patch.setattr(module, "fit_with_motions", lambda start: "before_law")
        patch.setattr(module, "screen", screen)
        patch.setattr(module, "fit_terms", fit_terms)
        patch.setattr(module, "finer", finer)
        arguments = [argument(name) for name in rough]
        patch.setattr(module, "arguments_of", lambda start: arguments)

    def curves(self, start: float = 1000.0, beside: Any = None) -> list[tuple[str, float]]:
        begin: Any = SimpleNamespace(bic=start)
        rough = module.rough_curves(begin, lambda *what: self.told.append(what), calm, beside)
        found = module.refine_contenders(begin, rough, calm)
        return [(one.terms[-1].argument.name, one.bic) for one in found]


def test_arguments_that_may_come_to_the_front_are_searched_on(monkeypatch: pytest.MonkeyPatch) -> None:
    rough = {"a": 500.0, "b": None, "c": 600.0, "d": 749.0, "e": 751.0, "f": 900.0}
    screen = Screen(monkeypatch, rough, {"a": 490.0, "c": 480.0}, {"c": 470.0, "a": 475.0})
    # each gains as much again at most: from 751 no way leads below 500; d is left where it was
    assert screen.curves() == [("c", 470.0), ("a", 475.0)]
    assert sorted(screen.asked[:3]) == ["a", "c", "d"] and sorted(screen.asked[3:]) == ["finer a", "finer c", "finer d"]
    assert sorted(screen.told) == sorted((f"trying a force as a function of {name}", 0.8) for name in rough)
    many = Screen(monkeypatch, {name: 500.0 + k for k, name in enumerate(NAMES)}, {}, {})
    assert [name for name, _ in many.curves()] == ["a", "b", "c"]
    assert sorted(many.asked[:6]) == sorted("abcdef") and len(many.asked) == 9  # six, and three of them finer


def test_curves_that_no_form_may_bring_to_the_front_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = {"a": (900.0, "a", 971.9), "b": (901.0, "b", 972.1)}  # a law must bring 28
    screen = Screen(monkeypatch, {"a": 900.0, "b": 901.0}, ends, {})
    assert screen.curves() == [("a", 900.0)] and "finer b" not in screen.asked
    fine = {"a": (800.0, "a", 790.0), "b": (820.0, "b", 809.9), "c": (820.0, "c", 810.1)}
    screen = Screen(monkeypatch, dict.fromkeys("abc", 900.0), dict.fromkeys("abc", 850.0), fine)
    assert [name for name, _ in screen.curves()] == ["a", "b"]  # ten behind the best curve
    assert Screen(monkeypatch, {"a": None}, {}, {}).curves() == []
    with pytest.raises(Cancelled):
        module.rough_curves("start", lambda *_: None, lambda: True)  # type: ignore[arg-type]

    def stiff(start: Any) -> Any:
        raise Infeasible("drawn stiff")

    monkeypatch.setattr(module, "fit_with_motions", stiff)
    assert module.rough_curves("start", lambda *_: None, calm) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(("least_form_bic", "found"), [(971.9, True), (972.1, False)])
def test_curves_of_a_law_that_is_known_are_not_sought_again(
    least_form_bic: float, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    fine = {"a": (965.0, "a", least_form_bic), "b": (966.0, "b", 980.0)}
    screen = Screen(monkeypatch, {"a": 900.0, "b": 900.0}, {}, fine)
    monkeypatch.setattr(module, "arguments_of", lambda start: [argument("a"), argument("b"), argument("a", "plate")])
    assert screen.curves() == ([("a", 965.0), ("a", 965.0)] if found else [])
    beside: Any = SimpleNamespace(where="block", argument="a")
    screen.told.clear()
    assert len(screen.curves(beside=beside)) == (1 if found else 0)
    assert sorted(screen.told) == [
        ("trying a force as a function of a", 0.8),
        ("trying a force as a function of b", 0.8),
    ]


class Forms:
    """Forms of every curve, by their distance; ``bics`` are the criteria that they come to."""

    def __init__(self, patch: pytest.MonkeyPatch, distances: dict[str, list[float]], bics: dict[str, float]) -> None:
        self.asked: list[Any] = []
        self.told: list[Any] = []
        self.known: list[Any] = []
        self.read: list[Any] = []
        self.ends: dict[str, float] = {}

        def likely_forms(learned: Any, most: int) -> Any:
            assert most == 6
            name = learned.terms[-1].argument.name
            return [SimpleNamespace(name=f"{name}{k}", distance=d) for k, d in enumerate(distances[name])]

        def refined(start: Any, learned: Any, forms: Any, known: Any, stop: Any) -> Any:
            self.asked.append([form.name for form in forms])
            self.known.append([one.bic for one in known])
            return [FormFit(self.fit(bics[form.name], form.name), learned, form) for form in forms if form.name in bics]

        def led_on(one: Any, stop: Any) -> Any:
            self.asked.append(f"on {one.form.name}")
            return FormFit(self.fit(self.ends.get(one.form.name, one.bic), one.form.name), one.learned, one.form)

        patch.setattr(module, "side_by_side", lambda function, items: [function(item) for item in items])  # in order
        patch.setattr(module, "likely_forms", likely_forms)
        patch.setattr(module, "_refined", refined)
        patch.setattr(module, "_converged", led_on)
        patch.setattr(
            module, "refit_resolving_kinks", lambda fitted, stop: self.asked.append(f"kinks {fitted.name}") or fitted
        )
        patch.setattr(module, "residual_of", lambda fitted, at: ("left", fitted.name, at))
        patch.setattr(
            module,
            "predict",
            lambda fitted, held, noise, stop: SimpleNamespace(
                of=(fitted.name, held, noise), predicts_significantly_better=lambda other: other.of[0] == "start"
            ),
        )
        patch.setattr(module, "as_learned", lambda *given: self.read.append(given) or "law")

    @staticmethod
    def fit(bic: float, name: str) -> Any:
        return SimpleNamespace(bic=bic, name=name, noise=f"noise of {name}", linearise=lambda: f"at {name}")

    def learned(self, *curves: Any, beat: float = math.inf) -> Any:
        start = self.fit(1000.0, "start")
        start.problem = SimpleNamespace(data=SimpleNamespace(shots=[1, 2]))
        tell = lambda *what: self.told.append(what)  # noqa: E731
        return module.learn_law(start, (1,), tell, calm, curves=curves, beat=beat)


def test_forms_near_a_curve_are_fitted_first_and_the_others_where_none_meets_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # nearer than four times the nearest and two hundred
    distances = {"a": [100.0, 599.0, 601.0], "b": [0.0, 199.0, 201.0]}
    forms = Forms(monkeypatch, distances, {"a0": 510.0, "a1": 505.0, "b0": 530.0, "b1": 525.0, "b2": 507.0})
    forms.ends = {"a0": 501.0}
    found = forms.learned(curve(500.0), curve(502.0, "b", least_form_bic=514.9))
    assert forms.asked == [
        ["a0", "a1"],  # a1 is as good as the best curve, so that a2 is not fitted
        ["b0", "b1"], ["b2"],  # neither of b's is
        "on a1", "on b2", "on a0", "kinks a0",  # within ten of the best, which a0 becomes
    ]  # fmt: skip
    assert forms.known == [[], [510.0, 505.0], [510.0, 505.0, 530.0, 525.0]]
    assert [what for what, _ in forms.told] == [
        "fitting closed forms to the curve of a",
        "fitting closed forms to the curve of b",
    ]
    assert found.fitted.name == "a0" and found.residual == ("left", "a0", "at a0") and found.laws == ("law",)
    ((start, fits, named, after, held),) = forms.read
    assert start.name == "start" and [one.fitted.name for one in fits] == ["a0", "a1", "b2", "b1", "b0"]
    assert named and after is found.predictions[1] and held == (1,)
    assert [one.of for one in found.predictions] == [(name, (1,), "noise of a0") for name in ("start", "a0")]


def test_curves_behind_what_was_met_are_not_read_and_three_at_most_are(monkeypatch: pytest.MonkeyPatch) -> None:
    forms = Forms(
        monkeypatch, {name: [1.0] for name in "abcd"}, {f"{name}0": 500.0 + k for k, name in enumerate("abcd")}
    )
    forms.learned(curve(500.0, "a"), curve(500.0, "b", 510.1), curve(500.0, "c", 509.9), curve(500.0, "d"))
    assert [one for one in forms.asked if isinstance(one, list)] == [["a0"], ["c0"]]
    nothing = Forms(monkeypatch, {"a": [1.0, 2.0]}, {})
    assert nothing.learned(curve(500.0)) is None and nothing.asked == [["a0", "a1"], []]


def test_forms_are_fitted_beside_the_best_that_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def fit_forms(start: Any, learned: Any, forms: Any, stop: Any, *, beat: float) -> Any:
        asked.append((start, forms, stop, beat))
        return [None, "fit"]

    monkeypatch.setattr(module, "fit_forms", fit_forms)
    learned, known = curve(500.0), [SimpleNamespace(bic=490.0), SimpleNamespace(bic=510.0)]
    given: Any = ("start", learned, ["one", "two"])
    assert module._refined(*given, known, calm) == [FormFit("fit", learned, "two")]  # type: ignore[arg-type]
    module._refined(*given, known[1:], calm)
    assert asked == [("start", [("one",), ("two",)], calm, beat) for beat in (490.0, 500.0)]
    monkeypatch.setattr(module, "with_frame_relinearised", lambda fitted, stop: ("on frame", fitted, stop))
    one: Any = FormFit(SimpleNamespace(continued=lambda stop: ("led on", stop)), learned, "two")  # type: ignore[arg-type]
    assert module._converged(one, calm) == FormFit(("on frame", ("led on", calm), calm), learned, "two")  # type: ignore[arg-type]

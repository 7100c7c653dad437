"""Two laws at once over fits that are given: which pairs of forms are tried, and what two laws must bring."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision import Infeasible
from analysis.diagnosis.learning import two_laws as module
from analysis.diagnosis.learning.law_learning import Discovery

START, CURVES = 1000.0, 900.0
BEST = {(i, j): 890.0 + 5.0 * abs(i - 2) + 3.0 * abs(j - 1) for i in range(3) for j in range(3)}


class Fit:
    def __init__(self, bic: float, pair: Any = None) -> None:
        self.bic, self.pair, self.noise, self.effects = bic, pair, "noise", ("start", "one", "two")

    def continued(self, stop: Any) -> "Fit":
        return Fit(self.bic - 1.0, self.pair)

    def linearise(self) -> str:
        return "at"


def learned(
    monkeypatch: pytest.MonkeyPatch, *, curves_bic: float = CURVES, forms: Any = None, fewer: float = 930.0,
    beats: bool = True, foretold: bool = True, kinks: Any = lambda fitted: fitted, below: float = math.inf,
    also: Any = None,
) -> tuple[Any, list[Any], list[Any]]:  # fmt: skip
    """Return what two laws are learned, the pairs in the order they were tried, and what was read of each law."""
    tried: list[Any] = []
    read: list[Any] = []
    bics = BEST if forms is None else forms

    def fit_forms(start: Any, curves: Any, pairs: Any, stop: Any, *, beat: float) -> list[Any]:
        assert beat == curves.bic
        found = [(int(one[1:]), int(two[1:])) for one, two in pairs]
        tried.extend(found)
        known = curves.bics or bics
        return [Fit(known[pair], pair) if pair in known else None for pair in found]

    def without(fitted: Any, effect: str, stop: Any) -> Any:
        return Fit(fewer, f"without {effect}")

    def foretell(one: Any, *_: Any) -> Any:
        return (
            SimpleNamespace(of=one.pair, predicts_better=lambda before: beats and before.of == "start")
            if foretold
            else None
        )

    curves = SimpleNamespace(bic=curves_bic, bics=None, with_last=lambda which: f"last {which}")
    monkeypatch.setattr(module, "two_curves", lambda *_, beat: [curves, *(also or [])])
    monkeypatch.setattr(module, "likely_forms", lambda c, most: [f"{'ab'[int(c[-1])]}{k}" for k in range(3)])
    monkeypatch.setattr(module, "fit_forms", fit_forms)
    monkeypatch.setattr(module, "refit_resolving_kinks", lambda fitted, stop: kinks(fitted))
    monkeypatch.setattr(module, "without_effect", without)
    monkeypatch.setattr(module, "predict", foretell)
    monkeypatch.setattr(module, "residual_of", lambda fitted, at: "left" if at == "at" and fitted.pair else None)
    monkeypatch.setattr(module, "as_learned", lambda start, fits, *told: read.append((start, fits, *told)) or "law")
    start: Any = Fit(START, "start")
    return module.learn_two(start, (1,), lambda: False, beat=below), tried, read


def test_pairs_of_forms_are_tried_beside_the_best_of_the_other_law(monkeypatch: pytest.MonkeyPatch) -> None:
    found, tried, read = learned(monkeypatch)
    assert tried[:4] == [(0, 0), (0, 1), (1, 0), (1, 1)]  # then all of the first beside the second's best, and reverse
    assert tried[4:] == [(2, 1), (2, 0), (2, 2)]
    assert found.fitted.pair == (2, 1) and found.fitted.bic == 889.0 and found.laws == ("law", "law")
    assert found.residual == "left" and [one.of for one in found.predictions] == ["start", (2, 1)]
    (first, of_first, *told), (second, of_second, *again) = read
    assert told == again == [True, found.predictions[1], (1,)]  # each is named by its form
    assert first.pair == "without one" and second.pair == "without two"
    assert [one.fitted.pair for one in of_first] == [(2, 1), (1, 1), (0, 1)]
    assert [one.fitted.pair for one in of_second] == [(2, 1), (2, 0), (2, 2)]
    assert [(one.form, one.learned, one.place) for one in of_first[:2]] == [("a2", "last 0", -2), ("a1", "last 0", -2)]
    assert [(one.form, one.learned, one.place) for one in of_second[:2]] == [("b1", "last 1", -1), ("b0", "last 1", -1)]
    # those within ten of the best were led on, the others not
    assert [one.fitted.bic for one in of_first] == [889.0, 894.0, 900.0]


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, True),
        ({"curves_bic": 943.9}, True),  # twice 28 below the start
        ({"curves_bic": 944.1}, False),
        ({"forms": {}}, False),
        ({"forms": {(0, 0): 912.9}}, True),  # led on by one, twelve behind the curves
        ({"forms": {(0, 0): 913.1}}, False),
        ({"fewer": 917.1}, True),  # each of them brings 28
        ({"fewer": 916.9}, False),
        ({"beats": False}, False),
        ({"foretold": False}, False),
    ],
)
def test_two_laws_must_each_bring_what_one_must(
    changes: dict[str, Any], found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "forms" in changes:
        changes = changes | {"fewer": 950.0}
    assert (learned(monkeypatch, **changes)[0] is not None) is found


@pytest.mark.parametrize(("nearest", "theirs"), [(894.9, True), (895.1, False)])
def test_of_curves_that_the_shots_do_not_tell_apart_those_with_the_likelier_forms_are_read(
    nearest: float, theirs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The best of the first four pairs in the place of the likelier curves comes to 895."""
    other = SimpleNamespace(bic=905.0, bics={(0, 1): nearest, (2, 1): 880.0}, with_last=lambda which: f"other {which}")
    found, tried, read = learned(monkeypatch, also=[other])
    assert tried[:8] == [(0, 0), (0, 1), (1, 0), (1, 1)] * 2
    assert found.fitted.bic == (879.0 if theirs else 889.0)
    assert [of[0].learned for _, of, *_ in read] == [f"{'other' if theirs else 'last'} {which}" for which in (0, 1)]


@pytest.mark.parametrize(
    ("below", "curves_bic", "found"),
    [(894.9, 900.0, False), (895.1, 900.0, True), (894.0, 893.9, True), (893.8, 893.9, False)],
)
def test_neither_curves_nor_the_nearest_forms_below_what_one_law_leaves_is_the_end(
    below: float, curves_bic: float, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The best of the four nearest pairs of forms comes to 895."""
    laws, tried, _ = learned(monkeypatch, below=below, curves_bic=curves_bic)
    assert (laws is not None) is found and len(tried) == (7 if found else 4)


def test_corners_are_met_last_and_only_in_what_is_going_to_be_said(monkeypatch: pytest.MonkeyPatch) -> None:
    met: list[Any] = []

    def kinks(fitted: Any) -> Any:
        met.append(fitted.pair)
        return Fit(fitted.bic - 3.0, "met")

    assert learned(monkeypatch, fewer=910.0, kinks=kinks)[0] is None and not met
    assert learned(monkeypatch, beats=False, kinks=kinks)[0] is None and not met
    found, _, read = learned(monkeypatch, kinks=kinks)
    assert met == [(2, 1)] and found.fitted.pair == "met" and read[0][1][0].fitted is found.fitted
    assert found.predictions[1].of == "met"  # told again from there
    # what is met may lie behind what went over the corner
    found, _, read = learned(monkeypatch, kinks=lambda fitted: Fit(895.0, "met"), fewer=950.0)
    assert found.fitted.pair == "met" and [of[0].fitted is found.fitted for _, of, *_ in read] == [True, True]


def test_a_second_law_is_added_to_the_first_where_two_at_once_do_not_explain_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def discovery(bic: float, explains: bool, law: Any, predictions: Any) -> Any:
        residual = SimpleNamespace(significant=not explains)
        fitted: Any = SimpleNamespace(bic=bic, converged=True, name=law)
        start: Any = SimpleNamespace(bic=100.0)
        laws: Any = (SimpleNamespace(form="linear" if explains else None, name=law),)
        return Discovery(start, laws, fitted, residual, predictions)  # type: ignore[arg-type]

    first = discovery(60.0, False, "first", ("p0", "p1"))
    second, together = discovery(40.0, True, "second", ("p2", "p3")), discovery(30.0, True, "both", ("p4", "p5"))
    asked: list[Any] = []
    told: list[Any] = []
    below: list[float] = []

    def another(two: Any, of_second: Any, beat: float = math.inf) -> Any:
        asked.clear()
        monkeypatch.setattr(module, "learn_two", lambda *_, beat: below.append(beat) or two)
        monkeypatch.setattr(module, "learn_law", lambda *given, **named: asked.append((given, named)) or of_second)
        monkeypatch.setattr(module, "in_joint_fit", lambda law, fitted, named: (law.name, fitted.name, named))
        told.clear()
        return module.learn_second_law(first, (1,), lambda *what: told.append(what), lambda: False, beat=beat)

    assert another(together, second) is together and not asked
    assert another(together, second, beat=31.0) is together and below == [60.0 - 28.0, 31.0]
    assert told == [("learning two laws at once", 0.86)]
    found = another(replace(together, residual=first.residual), second)
    assert found == Discovery(
        first.start,
        (("first", "second", True), *second.laws),
        second.fitted,
        second.residual,
        ("p0", "p3"),  # type: ignore[arg-type]
    )
    assert told == [("learning two laws at once", 0.86), ("learning a second law", 0.88)]
    assert asked[0][0][0] is first.fitted and asked[0][1] == {"beside": first.laws[0], "beat": math.inf}
    assert another(None, None) is first and another(None, second, beat=19.0) is first and not asked  # gains 40 again
    assert another(None, second, beat=21.0) is not first
    monkeypatch.setattr(module, "learn_law", lambda *_: together)
    monkeypatch.setattr(module, "learn_second_law", lambda *_, beat: ("another", beat))
    given: Any = ("start", (1,), None, None)
    assert module.learn_laws(*given) is together
    monkeypatch.setattr(module, "learn_law", lambda *_: first)
    assert module.learn_laws(*given, beat=5.0) == ("another", 5.0)
    monkeypatch.setattr(module, "learn_law", lambda *_: None)
    assert module.learn_laws(*given) is None


def test_the_pairs_of_curves_likeliest_to_first_order_are_fitted_and_the_best_gets_finer_knots(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Any] = []
    led_on: list[list[float]] = []
    bics = {0: 60.0, 1: None, 2: 50.0, 3: 70.0}

    class Curves:
        def __init__(self, bic: float, order: str = "ab") -> None:
            self.bic, self.order, self.terms = bic, order, ("a", "b")

        def with_last(self, which: int) -> "Curves":
            return Curves(self.bic, self.order[1 - which] + self.order[which])

    def fit_terms(problem: Any, z: Any, terms: Any, stop: Any, *, steps: int, to_the_end: bool) -> Any:
        assert (problem, z, stop, steps, to_the_end) == ("problem", "z", "stop", 3, False)
        asked.append(terms)
        if bics[terms] is None:
            raise Infeasible("nowhere")
        return Curves(bics[terms])

    def converge_contenders(given: Any, rough: list[Curves], stop: Any) -> list[Curves]:
        assert (given, stop) == (start, "stop")
        led_on.append([one.bic for one in rough])
        return [Curves(one.bic - 10.0) for one in rough]

    def finer(learned: Curves, most: int, stop: Any) -> Curves:
        asked.append((learned.order, most, stop))
        return Curves(learned.bic - 1.0, learned.order)

    monkeypatch.setattr(module, "fit_with_motions", lambda start: ("before_law", start))
    monkeypatch.setattr(module, "arguments_of", lambda start: ("arguments", start))
    monkeypatch.setattr(module, "likeliest_pairs", lambda *given: [*range(7)] if given == pairs else [])
    monkeypatch.setattr(module, "fit_terms", fit_terms)
    monkeypatch.setattr(module, "converge_contenders", converge_contenders)
    monkeypatch.setattr(module, "finer", finer)
    monkeypatch.setattr(module, "forms_may_beat", lambda beat, curves, start: beat > curves[0].bic)
    start: Any = SimpleNamespace(problem="problem", z="z", bic=100.0)
    pairs = (("before_law", start), ("arguments", start), 12, "stop")
    stop: Any = "stop"
    found: Any = module.two_curves(start, stop)
    assert [(one.bic, one.order) for one in found] == [(38.0, "ab")] and led_on == [[50.0, 60.0, 70.0]]
    assert sorted(asked[:4]) == [0, 1, 2, 3] and asked[4:] == [("ba", 48, "stop"), ("ab", 48, "stop")]  # each in turn
    assert not module.two_curves(start, stop, beat=39.0) and module.two_curves(start, stop, beat=41.0)
    led_on.clear()  # from 100 to 50 in a few steps, and as much again
    assert not module.two_curves(start, stop, beat=-1.0) and not led_on
    assert not module.two_curves(start, stop, beat=1.0) and led_on
    bics |= {0: 59.9, 3: 60.1}  # within ten of the best, and not
    assert [one.bic for one in module.two_curves(start, stop)] == [38.0, pytest.approx(47.9)]
    bics |= dict.fromkeys(range(4))
    assert module.two_curves(start, stop) == []

"""A law off the catalogue is refused or accepted: its curve, its form, the held-out shots, what else it may be."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import Infeasible
from analysis.diagnosis.evidence.cross_validation import Prediction
from analysis.diagnosis.evidence.identifiability import Separation
from analysis.diagnosis.evidence.residual import Residual
from analysis.diagnosis.learning import law_learning, single_law, two_laws
from analysis.diagnosis.learning.law_learning import Discovery, learn_law
from analysis.diagnosis.learning.learned_law import FormFit
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.search.time_limit import SECONDS, Limit
from tests.analysis.diagnosis.shots import calm

START = 1000.0  # of the criterion, where no law is in the model
NOTHING_LEFT = Residual(0.0, 57.0, 0.03, 1.1)
SHAPE_LEFT = Residual(120.0, 57.0, 0.03, 1.1, size=10.0)
PLACE = SimpleNamespace(name="place", where="block", factor="")


@dataclass(frozen=True)
class Fit:
    """A fit by its criterion."""

    bic: float
    converged: bool = True
    noise: str = "of this fit"

    def linearise(self) -> None:
        """Return nothing: what follows is replaced."""


@dataclass(frozen=True)
class Case:
    """What is found on the way to a law, each by its criterion; as it stands it is accepted."""

    curve: float = 900.0
    form: float = 890.0
    led_on: float | None = None  # the form brought to its end
    surprise: float = 9.0  # of the held-out shots; 10 without the law
    held: tuple[int, ...] = (0, 1, 2)
    beat: float = math.inf

    def law(self, patch: pytest.MonkeyPatch) -> tuple[Discovery | None, list[bool]]:
        """Return what is learned, and whether each law that is told is told with its form."""
        terms = [SimpleNamespace(argument=PLACE)]
        curve = SimpleNamespace(bic=self.curve, least_form_bic=self.curve, terms=terms, problem=None, z=None)
        form = SimpleNamespace(form=SimpleNamespace(name="power"), distance=1.0)
        one = FormFit(cast(Any, Fit(self.form)), cast(Any, curve), cast(Any, form))
        end = one if self.led_on is None else replace(one, fitted=cast(Any, Fit(self.led_on)))
        named: list[bool] = []

        def as_learned(_start: Fit, _fits: list[FormFit], named_by_form: bool, *_: object) -> str:
            named.append(named_by_form)
            return "law"

        def predict(fitted: Fit, held: tuple[int, ...], noise: str, _stop: object) -> Prediction:
            assert held == self.held and noise == "of this fit"
            return Prediction((), 10.0 if fitted.bic == START else self.surprise, 1.0, np.zeros(1), lambda _: 0.0)

        patch.setattr(law_learning, "arguments_of", lambda _start: [PLACE])
        patch.setattr(law_learning, "rough_curves", lambda *_: [curve])
        patch.setattr(law_learning, "fit_terms", lambda *_, **__: curve)
        patch.setattr(law_learning, "finer", lambda learned, *_: learned)
        patch.setattr(law_learning, "likely_forms", lambda *_: [form])
        patch.setattr(law_learning, "_refined", lambda _start, _learned, forms, *_: [one] * len(forms))
        patch.setattr(law_learning, "_converged", lambda _one, _stop: end)
        patch.setattr(law_learning, "refit_resolving_kinks", lambda fitted, _stop: fitted)
        patch.setattr(law_learning, "residual_of", lambda *_: NOTHING_LEFT)
        patch.setattr(law_learning, "predict", predict)
        patch.setattr(law_learning, "as_learned", as_learned)
        start = cast(Any, Fit(START, noise="of the start"))
        return learn_law(start, self.held, lambda _what, _fraction: None, calm, beat=self.beat), named


@pytest.mark.parametrize(
    ("case", "accepted"),
    [
        (Case(), True),
        (Case(curve=971.9, form=965.0), True),  # 28 of the criterion
        (Case(curve=972.1, form=965.0), False),
        (Case(curve=970.0, form=971.9), True),
        (Case(curve=970.0, form=972.1), False),
        (Case(curve=970.0, form=972.1, led_on=971.9), True),
        (Case(surprise=9.9), True),  # likelier held-out shots
        (Case(surprise=10.1), False),
        (Case(held=()), False),  # as of a single shot
        (Case(beat=881.0), True),  # a fifth more than the curve gained
        (Case(beat=879.0), False),
    ],
)
def test_a_law_is_learned_where_curve_form_and_held_out_shots_agree(
    case: Case, accepted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, _ = case.law(monkeypatch)
    assert (found is not None) is accepted


@pytest.mark.parametrize(("behind", "named"), [(11.9, True), (12.1, False)])
def test_a_form_that_is_far_behind_its_curve_is_not_the_law(
    behind: float, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, told = Case(curve=900.0, form=900.0 + behind).law(monkeypatch)
    assert found is not None and told == [named]


def discovery(bic: float = 900.0, residual: Residual = NOTHING_LEFT, *forms: str | None, converged: bool = True) -> Any:
    laws = tuple(SimpleNamespace(effect=None, form=form) for form in forms or ("power",))
    told = tuple(Prediction((), surprise, 1.0, np.zeros(1), lambda _: 0.0) for surprise in (10.0, 9.0))
    fitted = Fit(bic, converged=converged)
    return Discovery(cast(Any, Fit(START)), cast(Any, laws), cast(Any, fitted), residual, told)


@pytest.mark.parametrize(
    ("found", "explains"),
    [
        (discovery(), True),
        (discovery(converged=False), False),
        (discovery(900.0, SHAPE_LEFT), False),
        (discovery(900.0, NOTHING_LEFT, "power", "power"), True),
        (discovery(900.0, NOTHING_LEFT, "power", None), False),
    ],
)
def test_a_law_explains_all_in_forms_that_meet_it_and_leave_nothing(found: Discovery, explains: bool) -> None:
    assert found.explains is explains


def curve(bic: float) -> Any:
    return SimpleNamespace(bic=bic, least_form_bic=bic)


def free_curves() -> Any:
    start: Any = Fit(START)
    rough = law_learning.rough_curves(start, lambda *_: None, calm)
    return law_learning.refine_contenders(start, rough, calm)


def alone(found: Discovery | None, patch: pytest.MonkeyPatch, nearest: float = 50.0, size: float = 100.0) -> SingleLaw:
    """Return a law that the shots show, with its size and how far the nearest row of the catalogue is from it."""
    patch.setattr(single_law, "rough_curves", lambda *_: [curve(895.0)])
    patch.setattr(
        single_law, "refine_contenders", lambda _start, rough, _stop: [curve(880.0)] if rough[0].bic == 895.0 else []
    )
    patch.setattr(single_law, "learn_law", lambda *_, curves: found if curves[0].bic == 880.0 else None)
    patch.setattr(single_law, "separation", lambda *_: Separation(size, {effect_named("cubic_stiffness"): nearest}, {}))
    return SingleLaw(cast(Any, Fit(START)), (0,), lambda _what, _fraction: None, calm, Limit(SECONDS, calm))


@pytest.mark.parametrize(
    ("found", "nearest", "size", "instead"),
    [
        (discovery(871.9), 50.0, 100.0, True),  # 28 of the criterion below the effects' 900
        (discovery(872.1), 50.0, 100.0, False),
        (discovery(800.0, SHAPE_LEFT), 50.0, 100.0, False),
        (discovery(800.0), 50.1, 900.0, True),  # five norms and a twentieth of its size from a row
        (discovery(800.0), 49.9, 900.0, False),
        (None, 50.0, 100.0, False),
    ],
)
def test_a_law_stands_instead_of_effects_where_it_explains_all_and_is_no_row_of_the_catalogue(
    found: Discovery | None, nearest: float, size: float, instead: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = alone(found, monkeypatch, nearest, size)
    assert law.replaces_effects(cast(Any, Fit(900.0)), ()) is instead


@pytest.mark.parametrize(
    ("beat", "two", "reach"),
    [
        (857.0, None, True),  # a fifth more than the curve gained
        (855.0, None, False),
        (855.0, 861.0, True),
        (855.0, 880.0, False),
        (825.0, 853.0, True),
    ],
)
def test_no_form_is_fitted_where_neither_one_curve_nor_two_at_once_may_come_low_enough(
    beat: float, two: float | None, reach: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = alone(discovery(), monkeypatch)
    monkeypatch.setattr(single_law, "two_curves", lambda *_, beat: [] if two is None else [curve(two)])
    assert law.one_or_two_laws_may_beat(beat) is reach


def test_curves_that_gain_too_little_at_first_are_not_led_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """From 895 the way may lead to 790, as far again as it came; two at once may come lower."""
    law = alone(discovery(700.0), monkeypatch)
    led: list[object] = []
    monkeypatch.setattr(single_law, "refine_contenders", lambda *given: led.append(given) or [curve(780.0)])
    monkeypatch.setattr(single_law, "two_curves", lambda *_, beat: [curve(780.0)])
    assert START == 1000.0
    assert not law.replaces_effects(cast(Any, Fit(817.0)), ()) and law.one_or_two_laws_may_beat(789.0) and not led
    assert law.one_or_two_laws_may_beat(791.0) and len(led) == 1


def test_a_law_whose_curve_stays_above_the_effects_is_not_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    law = alone(discovery(), monkeypatch)

    def learned(*_: object, **__: object) -> None:
        raise AssertionError("forms are fitted")

    monkeypatch.setattr(single_law, "learn_law", learned)
    assert not law.replaces_effects(cast(Any, Fit(883.0)), ())  # 28 less is out of reach
    with pytest.raises(AssertionError, match="forms are fitted"):
        law.replaces_effects(cast(Any, Fit(885.0)), ())


def test_shots_of_which_none_is_predicted_from_others_show_no_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    law = replace(alone(discovery(), monkeypatch), held=())
    assert law.curves == [] and law.found is None and not law.one_or_two_laws_may_beat(math.inf)


def test_only_arguments_that_may_still_come_to_the_front_are_searched_to_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beside a leader that gained 100 an argument that gained 51 may still come to the front, one with 49 not."""
    rough = {"place": 900.0, "bend": 949.0, "overlap": 951.0, "plate speed": 1010.0}
    led_on: list[float] = []

    def further(_problem: object, bic: float, *_: object, **__: object) -> Any:
        led_on.append(bic)
        return curve(bic)

    def screened(_ground: object, argument: Any, *_: object, **__: object) -> Any:
        bic = rough[argument.name]
        return SimpleNamespace(bic=bic, least_form_bic=bic, problem=None, z=bic, terms=())

    monkeypatch.setattr(law_learning, "fit_with_motions", lambda _start: None)
    monkeypatch.setattr(law_learning, "screen", screened)
    monkeypatch.setattr(law_learning, "fit_terms", further)
    monkeypatch.setattr(law_learning, "finer", lambda learned, *_: learned)
    arguments = [SimpleNamespace(name=name, where="block") for name in rough]
    monkeypatch.setattr(law_learning, "arguments_of", lambda _start: arguments)
    found = free_curves()
    assert sorted(led_on) == [900.0, 949.0] and [one.bic for one in found] == [900.0]


@pytest.mark.parametrize(("beat", "found"), [(math.inf, True), (881.0, True), (879.0, False)])
def test_two_curves_that_cannot_come_low_enough_get_no_finer_knots(
    beat: float, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair: Any = SimpleNamespace(bic=900.0, least_form_bic=900.0, terms=(1, 2), with_last=lambda _which: pair)
    refined: list[object] = []

    def finer(learned: object, *_: object) -> object:
        refined.append(learned)
        return learned

    monkeypatch.setattr(two_laws, "fit_with_motions", lambda _start: None)
    monkeypatch.setattr(two_laws, "arguments_of", lambda _start: [])
    monkeypatch.setattr(two_laws, "likeliest_pairs", lambda *_: [(1, 2)])
    monkeypatch.setattr(two_laws, "fit_terms", lambda *_, **__: pair)
    monkeypatch.setattr(two_laws, "converge_contenders", lambda _start, rough, _stop: rough)
    monkeypatch.setattr(two_laws, "finer", finer)
    curves = two_laws.two_curves(cast(Any, SimpleNamespace(bic=START, problem=None, z=None)), calm, beat=beat)
    assert curves == ([pair] if found else []) and len(refined) == (2 if found else 0)


def test_where_no_curve_can_be_followed_from_the_fit_there_is_no_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """A contact drawn so stiff by what is missing that no trajectory follows ended the whole diagnosis."""

    def infeasible(_: object) -> None:
        raise Infeasible("too many contacts")

    monkeypatch.setattr(law_learning, "fit_with_motions", infeasible)
    monkeypatch.setattr(law_learning, "arguments_of", lambda _start: [])
    assert free_curves() == []


class Within:
    """A limit of time that notes what it was asked for, and leaves it out where its time is over."""

    def __init__(self, over: bool = False) -> None:
        self.over, self.asked = over, []

    def within(self, what: str, work: Any, otherwise: Any) -> Any:
        """Return the work's result, or what stands for it."""
        self.asked.append(what)
        return otherwise if self.over else work()


@pytest.mark.parametrize("over", [True, False])
def test_one_law_is_learned_within_the_time_and_told_as_half_of_a_diagnosis(
    over: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    told: list[Any] = []
    rough, curves, limit = [curve(895.0)], [curve(880.0)], Within(over)
    start = cast(Any, Fit(START))

    def rough_curves(of: Any, tell: Any, stop: Any) -> Any:
        tell("trying", 0.8)
        asked.append((of, stop))
        return rough

    def refine_contenders(of: Any, given: Any, stop: Any) -> Any:
        asked.append((of, given, stop))
        return curves

    def learn(of: Any, held: Any, tell: Any, stop: Any, *, curves: Any) -> Any:
        tell("reading", 0.84)
        asked.append((of, held, stop, curves))
        return "law"

    monkeypatch.setattr(single_law, "rough_curves", rough_curves)
    monkeypatch.setattr(single_law, "refine_contenders", refine_contenders)
    monkeypatch.setattr(single_law, "learn_law", learn)
    monkeypatch.setattr(
        single_law, "two_curves", lambda of, stop, *, beat: asked.append((of, stop, beat)) or [curve(850.0)]
    )
    law = SingleLaw(start, (0, 2), lambda *what: told.append(what), calm, cast(Any, limit))
    step = "one law in the place of effects"
    assert law.curves == ([] if over else curves)
    assert law.found == (None if over else "law")  # type: ignore[comparison-overlap]
    assert limit.asked == [step] * (1 if over else 3)
    assert told == ([] if over else [("trying", 0.5), ("reading", 0.5)])
    assert asked == ([] if over else [(start, limit), (start, rough, limit), (start, (0, 2), limit, curves)])
    limit.asked.clear()
    asked.clear()
    assert (
        law.one_or_two_laws_may_beat(856.1) is not over and not limit.asked
    )  # one may: a fifth more than its curve gained
    assert law.one_or_two_laws_may_beat(855.9) is not over and limit.asked == ([] if over else [step])
    assert asked == ([] if over else [(start, limit, 855.9)])
    assert not law.one_or_two_laws_may_beat(819.9)


@pytest.mark.parametrize(("bic", "reaches"), [(START - 101.0, True), (START - 99.0, False)])
@pytest.mark.parametrize("can_be_tested", [True, False])
def test_one_step_of_a_law_in_flight_tells_whether_it_may_come_low_enough(
    bic: float, reaches: bool, can_be_tested: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step may bring as much again."""
    asked: list[Any] = []

    def rough_curves(of: Any, tell: Any, stop: Any, **how: Any) -> Any:
        asked.append(how)
        return [curve(START), curve(bic)]

    monkeypatch.setattr(single_law, "rough_curves", rough_curves)
    limit: Any = Within()
    start: Any = SimpleNamespace(bic=START)
    law = single_law.SingleLaw(start, (1,) if can_be_tested else (), lambda *_: None, calm, limit)
    assert law.flight_law_may_beat(START - 200.0) is (reaches and can_be_tested)
    assert asked == ([{"steps": 1, "where": "block"}] if can_be_tested else [])

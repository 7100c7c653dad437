"""Closed forms fitted in the place of curves: how far each is followed, and where it begins."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import FORMS, Infeasible
from analysis.collision.effects import effect_named
from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.diagnosis.learning import form_fits as module
from analysis.diagnosis.learning.closed_forms import Fitting
from analysis.diagnosis.learning.curve_motion import Term
from analysis.diagnosis.learning.form_fits import likeliest
from analysis.inference import Point
from analysis.shot import Cancelled

TILT = effect_named("tilt")


class Short:
    """A short search that came to a criterion, and what it comes to at its end."""

    def __init__(
        self, bic: float, *, converged: bool = True, breaks: bool = False, gains: tuple[float, ...] = (10.0,)
    ) -> None:
        self.bic, self.converged, self.breaks, self.gains = bic, converged, breaks, gains

    def refitted(self, *, evaluations: int, cancelled: Any) -> Any:
        assert (evaluations, cancelled) == (10, calm)
        if self.breaks:
            raise Infeasible("nowhere")
        gain, *further = self.gains
        return Short(self.bic - gain, converged=not further, gains=tuple(further))


def calm() -> bool:
    return False


def fitted(monkeypatch: pytest.MonkeyPatch, *shorts: Short | None, start: float = 1000.0, **more: Any) -> list[Any]:
    """Return the criteria that forms end with, which come to ``shorts`` first."""

    class Problem:
        def fit_once(self, short: Any, *, evaluations: int, cancelled: Any) -> Any:
            assert evaluations == 8
            if short is None:
                raise Infeasible("nowhere")
            return short

    monkeypatch.setattr(module, "_begin", lambda begin, learned, forms: (Problem(), forms))
    given: Any = (SimpleNamespace(bic=start), "learned", shorts, more.pop("stop", calm))
    return [None if one is None else one.bic for one in module.fit_forms(*given, **more)]


def test_forms_that_may_still_come_to_the_front_are_led_to_their_end(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = fitted(monkeypatch, Short(120.0), None, Short(100.0), Short(289.0), Short(291.0))
    assert ends == [110.0, None, 90.0, 279.0, 291.0]  # two hundred behind the best at its end
    open_ended = fitted(monkeypatch, Short(100.0), Short(689.0, converged=False), Short(691.0, converged=False))
    assert open_ended == [90.0, 679.0, 691.0]  # where a search had not ended, three times that
    assert fitted(monkeypatch, Short(100.0, breaks=True), Short(120.0)) == [100.0, 110.0]
    assert fitted(monkeypatch, None, None) == [None, None]
    # beside a criterion that counts, and a fiftieth of what the best explains where that is more
    assert fitted(monkeypatch, Short(100.0), Short(149.0), Short(151.0), beat=-50.0) == [90.0, 139.0, 151.0]
    assert fitted(monkeypatch, Short(100.0), Short(289.0), beat=95.0) == [90.0, 279.0]
    much = fitted(monkeypatch, Short(100.0), Short(389.0), Short(391.0), start=90.0 + 50 * 300.0)
    assert much == [90.0, 379.0, 391.0]
    with pytest.raises(Cancelled):
        fitted(monkeypatch, Short(100.0), stop=lambda: True)


@pytest.mark.parametrize(
    ("begin", "gains", "end"),
    [
        (130.0, (10.0, 10.0, 10.0, 10.0, 10.0), 90.0),  # four stages at most
        (101.0, (1.1, 1.1, 0.9, 9.0), 97.9),  # a stage that brings less than one is the last
        (150.0, (20.0, 7.6, 20.0), 102.4),  # from 122.4 three times 7.6 lead to within ten of 90
        (150.0, (20.0, 7.4, 20.0), 122.6),
    ],
)
def test_a_search_ends_where_it_comes_nearer_too_slowly(
    begin: float, gains: tuple[float, ...], end: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = fitted(monkeypatch, Short(100.0), Short(begin, gains=gains))
    assert ends == [90.0, pytest.approx(end)]


@pytest.mark.parametrize("kinked", [True, False])
@pytest.mark.parametrize("feasible", [True, False])
def test_a_corner_is_met_in_short_steps_at_the_end(
    kinked: bool, feasible: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fit(z: str, *, cancelled: Any) -> Any:
        assert (z, cancelled) == ("z", calm)
        if not feasible:
            raise Infeasible("nowhere")
        return SimpleNamespace(continued=lambda stop: ("led on", stop))

    monkeypatch.setattr(module, "replace", lambda problem, stride: SimpleNamespace(fit=fit) if stride == 0.2 else None)
    effects = [SimpleNamespace(kinked=False), SimpleNamespace(kinked=kinked)]
    one: Any = SimpleNamespace(effects=effects, problem="problem", z="z")
    found: Any = module.refit_resolving_kinks(one, calm)
    assert found == (("led on", calm) if kinked and feasible else one)


def test_a_form_begins_with_its_numbers_where_base_and_starts_give_way_to_it() -> None:
    place, bend = (next(one for one in ARGUMENTS if one.name == name) for name in ("place", "bend"))
    terms = (
        Term(place, Basis((-3e-3, 0.0, 1e-3)), np.zeros(5)), Term(bend, Basis((-1e-3, 0.0, 2e-3)), np.zeros(5)),
    )  # fmt: skip
    forms = {form.name: form for form in FORMS}
    given = (
        Fitting(forms["linear"], {"a": 5.0}, 1.0, np.array([1.0, 2.0])),
        Fitting(forms["exponential"], {"a": 7.0, "b": 3e-4}, 1.0, np.array([10.0, 20.0])),
    )
    unpacked: list[Any] = []
    made: list[Any] = []

    def unpack(z: Any) -> Point:
        unpacked.append(z.tolist())
        return Point("base", "own", ({TILT: {"angle_rad": 1.0}}, {TILT: {"angle_rad": 2.0}}))  # type: ignore[arg-type]

    problem = SimpleNamespace(
        effects=("tilt",), fixed="fixed",
        with_effects=lambda effects, fixed: made.append((effects, fixed)) or SimpleNamespace(pack=lambda point: point),
    )  # fmt: skip
    start: Any = SimpleNamespace(problem=SimpleNamespace(unpack=unpack))
    learned: Any = SimpleNamespace(z=np.array([100.0, 200.0]), terms=terms, problem=problem)
    _, point = module._begin(start, learned, given)
    assert unpacked == [[111.0, 222.0]]
    ((effects, fixed),) = made
    assert effects[0] == "tilt" and fixed == "fixed" and len(effects) == 3
    first, second = (kind.effect for kind in effects[1:])
    for law, term, form, values, span in (
        (first, terms[0], "linear", {"a": 5.0}, 3e-3), (second, terms[1], "exponential", {"a": 7.0, "b": 3e-4}, 2e-3),
    ):  # fmt: skip
        assert law == forms[form].law(term.argument, values, span)
    for shot, angle in enumerate((1.0, 2.0)):
        told = point.values[shot]
        assert list(told) == [TILT, first, second] and told[TILT] == {"angle_rad": angle}
        assert told[first] == {"a": 5.0} and told[second] == {"a": 7.0, "b": 3e-4}
    assert (point.base, point.own) == ("base", "own")


def test_of_forms_that_are_one_function_here_the_one_declared_first_is_the_likeliest() -> None:
    named = {form.name: (SimpleNamespace(form=form),) for form in FORMS}

    def of(bics: dict[str, float]) -> str:
        return likeliest(bics, bics.__getitem__, lambda name: named[name])  # type: ignore[arg-type, return-value]

    assert of({"power, odd": 10.0, "power": 10.05, "linear": 10.2}) == "power"
    assert of({"power, odd": 10.0, "power": 10.15}) == "power, odd"
    assert of({"tanh": 3.0}) == "tanh"

"""Every criterion of a verdict with a case that it refuses and one that it lets pass next to each other."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE
from analysis.collision.effects import effect_named as named_effect
from analysis.collision.effects.row import Effect
from analysis.diagnosis.evidence.cross_validation import Prediction, choose
from analysis.diagnosis.evidence.identifiability import Separation
from analysis.diagnosis.evidence.lack_of_fit import LackOfFit
from analysis.diagnosis.evidence.residual import Residual
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import FoundEffect, Freedom, Verdict
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.verdict import indistinguishable as names
from analysis.diagnosis.verdict.acceptance import accepted_effects, exceeds_residual
from tests.analysis.diagnosis.shots import calm
from tests.analysis.diagnosis.test_acceptance import CALM, TILT, WANDERING, Fit

ADHESION = CATALOGUE["adhesion"]
NOTHING_LEFT = Residual(0.0, 57.0, 0.03, 1.1)
SHAPE_LEFT = Residual(120.0, 57.0, 0.03, 1.1, size=10.0)  # and no freedom that the law lacks
MISFIT_LEFT = replace(NOTHING_LEFT, misfit=LackOfFit(Freedom.PLACE, 104.0, 63.0, 4))
ONE = cast(Any, Fit((TILT,)))


def effect(snr: float, alike: int = 0) -> FoundEffect:
    return FoundEffect(TILT, {}, {"snr": snr}, tuple(CATALOGUE.values())[:alike])


def said(effects: list[FoundEffect], rest: Residual, fit: Any = ONE) -> tuple[int, Verdict]:
    named, verdict = accepted_effects(effects, rest, fit)
    return len(named), verdict


@pytest.mark.parametrize(("alike", "named"), [(0, True), (5, True), (6, False)])
def test_beside_a_rest_more_than_five_look_alikes_are_no_class(alike: int, named: bool) -> None:
    verdict = Verdict.PARTLY_EXPLAINED if named else Verdict.UNEXPLAINED
    assert said([effect(1e3, alike)], SHAPE_LEFT) == (int(named), verdict)
    assert exceeds_residual(effect(1e3, alike), SHAPE_LEFT, CRITERIA.clear_of_rest) is named


@pytest.mark.parametrize(
    ("snr", "rest", "several", "named"),
    [
        (20.5, SHAPE_LEFT, False, True),  # twice what is left
        (19.5, SHAPE_LEFT, False, False),
        (1010.0, SHAPE_LEFT, True, True),  # several imitate what none of them is: a hundred times
        (990.0, SHAPE_LEFT, True, False),
        (1010.0, MISFIT_LEFT, False, True),  # the law is another one: a hundred times, too
        (990.0, MISFIT_LEFT, False, False),
    ],
)
def test_an_effect_stands_clear_of_what_is_left(snr: float, rest: Residual, several: bool, named: bool) -> None:
    effects = [effect(snr)] + [effect(1e5)] * several
    count = len(effects) if named else 0
    assert said(effects, rest) == (count, Verdict.PARTLY_EXPLAINED if named else Verdict.UNEXPLAINED)


@pytest.mark.parametrize(
    ("changed", "verdict"),
    [
        ({}, Verdict.EFFECT_FOUND),
        ({"correlation": 0.16}, Verdict.UNEXPLAINED),
        ({"correlation": 0.14}, Verdict.EFFECT_FOUND),
        ({"ratio": 2.6}, Verdict.UNEXPLAINED),
        ({"ratio": 2.4}, Verdict.EFFECT_FOUND),
        ({"coherence": 56.9}, Verdict.EFFECT_FOUND),
        ({"coherence": 57.1, "size": 6.0}, Verdict.PARTLY_EXPLAINED),
        ({"misfit": LackOfFit(Freedom.PLACE, 62.9, 63.0, 4)}, Verdict.EFFECT_FOUND),
        ({"misfit": LackOfFit(Freedom.PLACE, 63.1, 63.0, 4)}, Verdict.PARTLY_EXPLAINED),
    ],
)
def test_what_is_left_decides_what_is_said(changed: dict[str, Any], verdict: Verdict) -> None:
    named = verdict is not Verdict.UNEXPLAINED
    assert said([effect(1e4)], replace(NOTHING_LEFT, **changed)) == (int(named), verdict)


def test_a_fit_that_did_not_arrive_names_nothing() -> None:
    assert said([effect(1e4)], NOTHING_LEFT) == (1, Verdict.EFFECT_FOUND)
    assert said([effect(1e4)], NOTHING_LEFT, cast(Any, Fit((TILT,), converged=False))) == (0, Verdict.UNEXPLAINED)


def test_where_no_effect_stands_a_rest_makes_the_difference() -> None:
    assert said([], NOTHING_LEFT) == (0, Verdict.ADEQUATE)
    assert said([], SHAPE_LEFT) == (0, Verdict.UNEXPLAINED)


@pytest.mark.parametrize(
    ("surprise", "rms", "apart", "beats"),
    [
        (9.0, 1.0, 0.0, True),
        (11.0, 0.5, 0.0, False),
        (9.0, 1.01, 0.0, True),
        (9.0, 1.03, 0.0, False),
        (9.0, 1.0, 0.49, True),  # two predictions that far apart differ by 2 x 0.49 by chance
        (9.0, 1.0, 0.51, False),
    ],
)
def test_what_earns_a_name_predicts_better_by_more_than_chance(
    surprise: float, rms: float, apart: float, beats: bool
) -> None:
    other = Prediction((), 10.0, 1.0, np.zeros(4), lambda difference: float(difference @ difference))
    told = Prediction((), surprise, rms, np.full(4, 0.5 * apart), other.squared)
    assert told.predicts_significantly_better(other) is beats
    assert told.predicts_better(other) is (beats or apart > 0.0)


@pytest.mark.parametrize(("remainder", "near"), [(0.0, ("a", "b")), (2.0, ("a", "b", "c"))])
def test_look_alikes_are_those_that_stand_nearer_than_five_norms_and_what_is_left(
    remainder: float, near: tuple[str, ...]
) -> None:
    far = Separation(50.0, {"d": 7.1, "b": 4.9, "c": 5.1, "a": 1.0}, {})
    assert far.too_close(remainder) == near


class Likely(Fit):
    """A fit of the names by its criterion and its likelihood."""

    def __init__(self, effects: tuple[Effect, ...], bic: float, log_likelihood: float) -> None:
        super().__init__(effects)
        object.__setattr__(self, "_likely", (bic, log_likelihood))

    @property
    def bic(self) -> float:
        """Get the criterion."""
        return float(cast(Any, self)._likely[0])

    @property
    def log_likelihood(self) -> float:
        """Get ln L."""
        return float(cast(Any, self)._likely[1])


@pytest.mark.parametrize(
    ("behind", "less_likely", "named"),
    [
        (5.9, 20.0, True),
        (6.1, 20.0, False),
        (20.0, 5.9, True),  # fewer parameters make no effect the true one
        (20.0, 6.1, False),
    ],
)
def test_what_was_fitted_in_the_place_and_is_nearly_as_likely_is_named_beside(
    behind: float, less_likely: float, named: bool
) -> None:
    best, other = Likely((TILT,), 0.0, 0.0), Likely((ADHESION,), behind, -less_likely / 2)
    trail = Trail(cast(Any, Fit(())), (), calm)
    for one in (best, other):
        trail.fits[frozenset(one.effects)] = cast(Any, one)
    far = Separation(50.0, {ADHESION: 40.0}, {})
    found, lead = names.indistinguishable_effects(cast(Any, best), TILT, SHAPE_LEFT, far, trail)
    assert found == ((ADHESION,) if named else ())
    assert lead == behind


@pytest.mark.parametrize(("distance", "named"), [(4.9, True), (5.1, False)])
@pytest.mark.parametrize("rest", [NOTHING_LEFT, SHAPE_LEFT])
def test_what_is_near_to_first_order_is_named_beside(distance: float, named: bool, rest: Residual) -> None:
    far = Separation(50.0, {ADHESION: distance + rest.size}, {})
    trail = Trail(cast(Any, Fit(())), (), calm)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Trail, "of", lambda _trail, _names: None)  # it was never fitted
        found, _ = names.indistinguishable_effects(cast(Any, Fit((TILT,))), TILT, rest, far, trail)
    assert found == ((ADHESION,) if named else ())


@pytest.mark.parametrize(
    ("speeds", "held"),
    [((0.3,), ()), ((0.3, 0.1), (1,)), ((0.3, 0.1, 0.2), (0, 1, 2)), ((0.5, 0.1, 0.3, 0.2, 0.4), (0, 1, 2))],
)
def test_of_many_shots_the_slowest_a_middle_one_and_the_fastest_are_held_out(
    speeds: tuple[float, ...], held: tuple[int, ...]
) -> None:
    data = SimpleNamespace(shots=[SimpleNamespace(course=SimpleNamespace(velocity_in_m_per_s=-v)) for v in speeds])
    assert choose(cast(Any, data)) == held


def test_criteria_ask_more_of_many() -> None:
    assert [CRITERIA.size_of_one(n) for n in (1, 2, 3, 4)] == [5.0, 12.0, 30.0, 30.0]
    assert CRITERIA.fall(1) == 10.0 and CRITERIA.fall(10) == pytest.approx(10.0 + 2.0 * np.log(10.0))
    assert CRITERIA.fall(1, wandering=True) == 22.0


def test_a_frame_that_moves_is_no_path_that_wanders() -> None:
    """Only beside a wandering path does one number gain more by chance."""
    trail = Trail(cast(Any, SimpleNamespace(effects=())), (), calm)
    assert [trail.least_fall(floor) for floor in (CALM, replace(CALM, site=(0.0,)), WANDERING)] == [10.0, 10.0, 22.0]


class Line(Likely):
    """A fit of a line, led on to its end or not."""

    def continued(self, _stop: object) -> "Line":
        """Return its end."""
        return ENDS[self.effects]


ENDS: dict[Any, Any] = {}


@pytest.mark.parametrize(
    ("ends", "converged", "wave", "starts", "fewer", "named"),
    [
        ((-13.0, -14.0), True, True, True, True, False),  # both ends are 25 and more behind
        ((-13.0, -12.0), True, True, True, True, True),  # one of them is not
        ((-12.0, -13.0), True, True, True, True, True),
        ((-13.0, None), True, True, True, True, False),  # from where it imitates the effect it leads nowhere
        ((-13.0, -14.0), False, True, True, True, True),  # a search that did not end says nothing
        ((-13.0, -14.0), True, False, True, True, True),  # no line
        ((-13.0, -14.0), True, True, False, True, True),
        ((-13.0, -14.0), True, True, True, False, True),
    ],
)
def test_a_line_that_is_far_behind_when_it_is_fitted_is_no_other_name(
    ends: tuple[float, float | None], converged: bool, wave: bool, starts: bool, fewer: bool, named: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    line = CATALOGUE["frame_vibration"] if wave else CATALOGUE["coulomb_friction"]
    best, kept = Likely((TILT, ADHESION), 0.0, 0.0), []
    found, instead = Line((ADHESION, line), 50.0, -50.0), Line((line, ADHESION), 50.0, -50.0)
    ENDS.clear()
    for one, end in ((found, ends[0]), (instead, ends[1])):
        if end is not None:
            made = Line(one.effects, -2 * end, end)
            object.__setattr__(made, "converged", converged)
            ENDS[one.effects] = made
    asked: list[Any] = []
    less = Fit((ADHESION,))
    kind = SimpleNamespace(effect=line)
    trail: Any = SimpleNamespace(
        fits={}, of=lambda effects: found if set(effects) == {ADHESION, line} else None, stop="stop", keep=kept.append,
        catalogue=(SimpleNamespace(effect=TILT), kind), linearised=lambda fit: ("linear", fit),
    )  # fmt: skip
    monkeypatch.setattr(names, "without", lambda one, effect, of: less if fewer and effect is TILT else None)
    monkeypatch.setattr(names, "imitates_by_coincidence", lambda *_: False)
    monkeypatch.setattr(
        names, "fitted_instead", lambda *given: asked.append(given) or (instead if ends[1] is not None else None)
    )
    far = Separation(50.0, {line: 1.0}, {line: ({},)} if starts else {})
    told, lead = names.indistinguishable_effects(cast(Any, best), TILT, NOTHING_LEFT, far, trail)
    assert told == ((line,) if named else ()) and lead is None
    if wave and starts and fewer:
        assert asked == [(best, ("linear", less), far, None, "stop", kind)]
        assert kept == [ENDS[found.effects]] + ([ENDS[instead.effects]] if ends[1] is not None else [])
    else:
        assert not asked and not kept
    # beside something that is left nothing is fitted
    assert names.indistinguishable_effects(cast(Any, best), TILT, SHAPE_LEFT, far, trail)[0] == (line,)
    monkeypatch.setattr(names, "imitates_by_coincidence", lambda rival, other, *_: rival is found and other is line)
    assert names.indistinguishable_effects(cast(Any, best), TILT, NOTHING_LEFT, far, trail)[0] == ()


def test_the_runner_up_is_the_likeliest_with_one_effect_exchanged() -> None:
    wider = CATALOGUE.get("frame_vibration_with_plate") or named_effect("frame_vibration_with_plate")
    vibration, friction = CATALOGUE["frame_vibration"], CATALOGUE["coulomb_friction"]
    best = Likely((vibration, TILT), 0.0, 0.0)
    trail = Trail(cast(Any, Fit(())), (), calm)
    for effects, bic in (
        ((friction, TILT), 30.0), ((ADHESION, TILT), 40.0), ((vibration, ADHESION), 3.0), ((friction,), 1.0),
        ((friction, ADHESION), 2.0), ((wider, TILT), 1.0),
    ):  # fmt: skip
        trail.fits[frozenset(effects)] = cast(Any, Likely(effects, bic, -bic / 2))
    far = Separation(50.0, {}, {})
    # neither where two are exchanged, nor where the other one is, nor what holds the effect
    assert names.indistinguishable_effects(cast(Any, best), vibration, SHAPE_LEFT, far, trail) == ((), 30.0)
    assert names.indistinguishable_effects(cast(Any, best), TILT, SHAPE_LEFT, far, trail) == ((ADHESION,), 3.0)

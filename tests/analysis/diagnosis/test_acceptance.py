"""What an effect must be to be named."""

import math
from dataclasses import dataclass, replace
from typing import Any, cast

import pytest

from analysis.collision.effects import effect_named
from analysis.collision.effects.row import Effect
from analysis.diagnosis.evidence.lack_of_fit import LackOfFit
from analysis.diagnosis.evidence.residual import Residual
from analysis.diagnosis.findings.result import FoundEffect, Freedom, Verdict
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.verdict import acceptance
from analysis.inference.noise.floor import Floor
from tests.analysis.diagnosis.shots import calm

TILT = effect_named("tilt")
CALM = Floor(1e-10, (0.0, 0.0), (1e-2, 1e-2), 5e-5)
WANDERING = Floor(1e-10, (1e-10, 0.0), (1e-2, 1e-2), 5e-5)


@dataclass(frozen=True)
class Fit:
    """What the gates look at."""

    effects: tuple[Effect, ...]
    noise: Floor = CALM
    converged: bool = True
    worth: float = 200.0  # of the criterion, each of its effects

    @property
    def bic(self) -> float:
        """Get the criterion."""
        return -self.worth * len(self.effects)


def effect(snr: float) -> FoundEffect:
    return FoundEffect(TILT, {}, {"snr": snr}, ())


@pytest.mark.parametrize(("floor", "accepted"), [(CALM, True), (replace(CALM, site=(0.0,)), True), (WANDERING, False)])
def test_beside_a_wandering_path_an_effect_does_more_than_the_next_freedom(floor: Floor, accepted: bool) -> None:
    rest = Residual(0.0, 57.0, 0.03, 1.1, misfit=LackOfFit(Freedom.PLACE, 56.0, 63.0, 4))
    effects, verdict = acceptance.accepted_effects([effect(10.4)], rest, cast(Any, Fit((TILT,), floor)))
    assert bool(effects) is accepted
    assert verdict is (Verdict.EFFECT_FOUND if accepted else Verdict.UNEXPLAINED)


@pytest.mark.parametrize(("snr", "verdict"), [(60.0, Verdict.PARTLY_EXPLAINED), (17.0, Verdict.UNEXPLAINED)])
def test_what_passed_beside_a_rest_is_told_as_partly_explained(snr: float, verdict: Verdict) -> None:
    rest = Residual(20.0, 15.0, 0.03, 1.1, size=16.0)
    assert rest.significant
    effects, said = acceptance.accepted_effects([effect(snr)], rest, cast(Any, Fit((TILT,))))
    assert said is verdict
    assert bool(effects) is (verdict is Verdict.PARTLY_EXPLAINED)


def kept(sizes: dict[Effect, float], worth: float, monkeypatch: pytest.MonkeyPatch) -> tuple[Effect, ...]:
    """Return which effects of these sizes and this worth each are not too faint."""
    monkeypatch.setattr(acceptance, "snr", lambda _fit, _at, effect: sizes[effect])
    monkeypatch.setattr(acceptance, "missed_without", lambda *_: 100.0)
    monkeypatch.setattr(Trail, "linearised", lambda _trail, _fit: None)
    monkeypatch.setattr(
        acceptance,
        "without",
        lambda fit, gone, *_: Fit(tuple(one for one in fit.effects if one != gone), worth=fit.worth),
    )
    every = Fit(tuple(sizes), worth=worth)
    return acceptance.without_faint_effects(cast(Any, every), Trail(cast(Any, Fit(())), (), calm))[0].effects


@pytest.mark.parametrize(("least", "left"), [(11.0, 1), (20.0, 2), (40.0, 3)])
def test_the_more_effects_the_more_each_must_stand_out(
    least: float, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = {effect_named("plate_damping"): 90.0, effect_named("sensor_drift"): max(least, 11.5), TILT: least}
    assert len(kept(sizes, 200.0, monkeypatch)) == left


@pytest.mark.parametrize(("worth", "left"), [(85.0, 1), (100.0, 2)])
def test_each_of_several_pays_more_than_what_mends_a_misfit(
    worth: float, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(kept({effect_named("adhesion"): 92.0, effect_named("plate_motion"): 13.0}, worth, monkeypatch)) == left


def lacking(
    norms: float, width: int = 4, samples: int = 7200, coherence: float = 0.0, correlation: float = 0.03
) -> Any:
    """Return a residual with use for a freedom of so many noise norms, where chance may do 20."""
    misfit = LackOfFit(Freedom.PLACE, norms**2 + width, 20.0, width)
    return Residual(coherence, 57.0, correlation, 1.1, misfit=misfit, samples=samples)


LEAST_OF_A_LAW = math.sqrt(28.0 + math.log(7200))  # of so many samples, in noise norms


@pytest.mark.parametrize(
    ("rest", "faint"),
    [
        (lacking(0.99 * LEAST_OF_A_LAW), True),
        (lacking(1.01 * LEAST_OF_A_LAW), False),  # a law might be learned from it
        (lacking(4.4, samples=200), True),  # sqrt(2 n) is 20 there, 4.47 norms squared
        (lacking(4.6, samples=200), False),  # more than a chi^2 of so many samples scatters
        (lacking(4.5, coherence=58.0), False),  # all shots share it
        (lacking(4.5, correlation=0.2), False),  # no noise at all
        (lacking(3.0), False),  # chance does that: nothing is missed
    ],
)
def test_a_trace_is_less_than_the_noise_vouches_for_and_than_a_law_must_be(rest: Residual, faint: bool) -> None:
    assert rest.faint is faint
    for nothing_pays, effects in ((True, []), (False, []), (True, [effect(8.0)])):
        _, verdict = acceptance.accepted_effects(effects, rest, cast(Any, Fit(())), nothing_pays=nothing_pays)
        explained = not rest.significant or (faint and nothing_pays and not effects)
        assert (verdict in (Verdict.ADEQUATE, Verdict.EFFECT_FOUND)) is explained


@pytest.mark.parametrize(("worth", "nothing"), [(1.0, True), (200.0, False)])
def test_an_effect_pays_on_the_way_or_none_does(worth: float, nothing: bool) -> None:
    trail = Trail(cast(Any, Fit((), worth=worth)), (), calm)
    trail.keep(cast(Any, Fit((TILT,), worth=worth)))
    assert trail.nothing_pays is nothing

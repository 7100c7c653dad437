"""A ripple finer than the averaged samples is asked at the record's rate; the frame's sway follows the parameters."""

from dataclasses import dataclass, replace
from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.search import full_rate
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.search.full_rate import at_full_rate
from analysis.inference.fit.problem import Problem
from analysis.inference.model.samples import FINE_RATE_HZ, RATE_HZ
from analysis.inference.noise.site import STILL_FRAME
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots

RIPPLE = "cyclic_error"


def test_a_ripple_too_weak_for_averaged_samples_is_seen_at_the_records_rate() -> None:
    motions = shots({RIPPLE: {"amplitude_m": 1.5e-10, "order": 2.0}})
    before = base_fit(motions)
    found = at_full_rate(before, Trail(before, list(KINDS.values()), calm), motions)
    assert found is not None
    best, _ = found
    assert best.effects == (effect_named(RIPPLE),)
    assert best.problem.data.shots[0].spacing_s == pytest.approx(1 / FINE_RATE_HZ)
    assert before.problem.data.shots[0].spacing_s == pytest.approx(1 / RATE_HZ)
    clean = shots({})
    alone = base_fit(clean)
    assert at_full_rate(alone, Trail(alone, list(KINDS.values()), calm), clean) is None


@dataclass(frozen=True)
class _Data:
    site: object
    base: object = None
    shots: tuple[object, ...] = ()


def test_without_a_found_effect_the_sway_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plate that seems to have moved far then tells of an effect that is missing, and must not absorb it."""
    monkeypatch.setattr(full_rate, "with_frame_relinearised", lambda *_: pytest.fail("nothing is fitted anew"))
    start: Any = Some()
    trail: Any = Some(start=start, stop=calm)
    assert full_rate.with_frame_response_updated(start, trail) == (start, trail)


def test_what_remains_to_be_fitted_at_the_records_rate_ends_when_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search that is begun after that computes where it begins, and no more."""
    motions = shots({RIPPLE: {"amplitude_m": 1e-9, "order": 2.0}}, count=2)
    best = base_fit(motions)
    before = replace(best, z=best.z + 30.0 * np.sqrt(np.diag(best.inverse)))  # with a way to go
    asked: list[bool] = []
    computed: list[int] = []
    refit, search, square = full_rate.refit, Problem.search, Problem.square

    def fitted(*arguments: Any) -> Any:
        found = refit(*arguments)
        asked.append(True)
        return found

    def begun(*arguments: Any, **options: Any) -> Any:
        computed.append(0)
        return search(*arguments, **options)

    def counted(*arguments: Any) -> Any:
        computed[-1] += 1
        return square(*arguments)

    monkeypatch.setattr(full_rate, "refit", fitted)
    monkeypatch.setattr(Problem, "search", begun)
    monkeypatch.setattr(Problem, "square", counted)
    at_full_rate(before, Trail(before, [KINDS[RIPPLE]], lambda: bool(asked)), motions)
    _refitted, *after = computed
    assert len(after) >= 2 and set(after) == {1}
    computed.clear()
    at_full_rate(before, Trail(before, [KINDS[RIPPLE]], calm), motions)
    assert max(computed) > 1


def fit_of(*effects: Any, site: Any = None, rate: int = 5) -> Any:
    shot = Some(wavelength_m=633e-9, factor=rate, plate="plate")
    data = replace(_Data(site, "base", (shot, shot)))
    return Some(effects=effects, problem=Some(data=data), noise="noise", point="point of " + str(len(effects)))


class Rate:
    """Stands in for what a look at the record's own rate asks."""

    def __init__(self, patch: pytest.MonkeyPatch, **more: Any) -> None:
        self.asked: list[Any] = []
        start = more.get("start", fit_of())
        kinds = more.get("kinds", (KINDS["tilt"], KINDS[RIPPLE]))
        self.trail: Any = Some(catalogue=kinds, start=start, stop="stop")
        self.listed = more.get("listed", [Some(start="first"), Some(start="second")])
        self.fine, self.promising = more.get("fine", 1), more.get("promises", True)
        for name, made in {
            "averaged_shots": lambda motions, rate: [Some(factor=self.fine)] if rate == FINE_RATE_HZ else None,
            "with_plates": lambda shots, plates: (shots, plates),
            "without": lambda best, effect, trail: fit_of() if best.effects == (effect,) else None,
            "_promises": self.promises,
            "on_site": lambda shots, site, base, point: (shots, site, base, point),
            "_beside": lambda bare, data: Some(scores=lambda ripple: self.listed, data=data),
            "refit": lambda at, ripple, start, stop: ("refitted", at.data, ripple.effect, start, stop),
            "_anew": lambda finest, trail: (finest, trail),
        }.items():
            patch.setattr(full_rate, name, made)

    def promises(self, ripple: Any, bare: Any, shots: Any, trail: Any) -> bool:
        assert ripple is KINDS[RIPPLE] and trail is self.trail
        self.asked.append((bare.effects, shots))
        return bool(self.promising)

    def look(self, best: Any) -> Any:
        return at_full_rate(best, self.trail, "motions")  # type: ignore[arg-type]


@pytest.mark.parametrize("found", [True, False])
def test_a_ripple_is_fitted_at_the_records_rate_from_where_it_scores_best(
    found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ripple that was found at the averaged rate is taken out first, and measured anew."""
    rate = Rate(monkeypatch)
    best = fit_of(effect_named(RIPPLE)) if found else fit_of(effect_named("tilt"))
    finest, trail = rate.look(best)
    _, data, effect, start, stop = finest
    assert trail is rate.trail and effect is effect_named(RIPPLE) and (start, stop) == ("first", "stop")
    bare = () if found else (effect_named("tilt"),)
    ((asked, shots),) = rate.asked
    assert asked == bare and shots[1] == ("plate", "plate")
    assert data.shots == (shots, None, "base", f"point of {len(bare)}")


@pytest.mark.parametrize(
    "more",
    [
        {"kinds": (KINDS["tilt"],)}, {"start": fit_of(effect_named(RIPPLE))}, {"fine": 5}, {"promises": False},
        {"listed": []},
    ],
)  # fmt: skip
def test_there_is_no_look_where_no_ripple_may_be_seen(more: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """None is tried, the model has it, the record is no finer, it promises nothing, or it has no score."""
    assert Rate(monkeypatch, **more).look(fit_of()) is None
    blind = fit_of()
    blind.problem.data.shots[1].wavelength_m = None
    assert Rate(monkeypatch).look(blind) is None
    lost = Rate(monkeypatch)
    monkeypatch.setattr(full_rate, "refit", lambda *_: None)
    assert lost.look(fit_of()) is None and lost.asked


def test_noise_beside_other_data_is_learned_from_the_residual_there() -> None:
    asked: list[Any] = []

    class Problem:
        def __init__(self, data: Any) -> None:
            self.data = data

        def residual_m(self, z: Any) -> Any:
            return "left", z

        def learn_noise(self, left: Any, start: Any) -> Any:
            asked.append((left, start))
            return "learned", 0.0

        def with_noise(self, noise: Any) -> Any:
            return Some(linearise=lambda z: (noise, z, self.data))

    data: Any = _Data("site")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(full_rate, "replace", lambda problem, *, data: Problem(data))
        best: Any = Some(problem="problem", noise="noise", z="z")
        found: Any = full_rate._beside(best, data)
    assert found == ("learned", "z", data) and asked == [(("left", "z"), "noise")]


@pytest.mark.parametrize(("worth", "promises"), [(20.1, True), (19.9, False)])
def test_a_ripple_promises_to_pay_with_all_that_is_slow_taken_off(
    worth: float, promises: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the fit leaves but for the frame's most likely motion, and the plate's, is no ripple's."""
    coarse_s = np.linspace(0.0, 1.0, 11)
    valid = coarse_s < 0.75
    left = np.full(11, 30.0)
    sway = Some(plate_displacement_m=lambda plate: 100.0 * plate[0] * coarse_s)
    coarse = Some(centre_s=coarse_s, valid=valid, plate=(2.0,), sway=sway)
    coarse.without_frame_motion = lambda noise, given: 10.0 * coarse_s + 1e6 * ~valid if given is left else None
    fine_s = np.linspace(0.0, 0.7, 50)

    @dataclass(frozen=True)
    class Shot:
        centre_s: Any
        displacement_m: Any

    made: list[Any] = []

    def beside(best: Any, data: Any) -> Any:
        made.append(data)
        score = Some(worth=lambda size: worth if size == 7 else 0.0)
        return Some(scores=lambda ripple: [score] if ripple == "ripple" else [], left=np.zeros(7))

    monkeypatch.setattr(full_rate, "_beside", beside)
    best: Any = Some(problem=Some(data=_Data("site", "base", (coarse,))), residual_m=[left], noise="noise")
    trail: Any = Some(least_fall=lambda noise: 20.0 if noise == "noise" else 0.0)
    given: Any = ("ripple", best, [Shot(fine_s, np.full(50, 1000.0))], trail)
    assert full_rate._promises(*given) is promises
    (data,) = made
    assert data.site is STILL_FRAME and data.base == "base"
    np.testing.assert_allclose(
        data.shots[0].displacement_m, 1000.0 - (30.0 - 10.0 * fine_s) + 200.0 * fine_s, atol=1e-9
    )
    coarse.plate = (0.0,)
    full_rate._promises(*given)
    np.testing.assert_allclose(made[1].shots[0].displacement_m, 1000.0 - (30.0 - 10.0 * fine_s), atol=1e-9)
    coarse.plate, coarse.sway = (2.0,), None
    full_rate._promises(*given)
    np.testing.assert_allclose(made[2].shots[0].displacement_m, 1000.0 - (30.0 - 10.0 * fine_s), atol=1e-9)


def test_a_trail_of_other_data_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    start = Some(effects=(), bic=100.0, problem="problem of start", z="z")
    old: Any = Trail(start, (), calm)  # type: ignore[arg-type]
    old.removed_from_bic[frozenset([effect_named("tilt")])] = 60.0
    best: Any = Some(effects=(effect_named("tilt"),), bic=50.0, problem=Some(data="fine data"))
    again = Some(effects=(), bic=90.0)

    def at(fitted: Any, data: Any, stop: Any) -> Any:
        assert (fitted, data, stop) == (start, "fine data", calm)
        return again

    monkeypatch.setattr(full_rate, "_at", at)
    monkeypatch.setattr(full_rate, "prune", lambda fitted, trail: asked.append(trail) or ("pruned", fitted))
    monkeypatch.setattr(full_rate, "converge", lambda fitted, trail: ("polished", fitted))
    found, trail = full_rate._anew(best, old)
    assert found == ("polished", ("pruned", best)) and asked == [trail] and trail is not old  # type: ignore[comparison-overlap]
    assert (
        trail.start is again
        and trail.of([effect_named("tilt")]) is best
        and not trail.removed_from_bic
        and old.removed_from_bic
    )
    assert old.fits == {frozenset(): start}
    monkeypatch.setattr(full_rate, "with_frame_relinearised", lambda fitted, stop: best if stop is calm else None)
    monkeypatch.setattr(full_rate, "_anew", lambda fitted, trail: (fitted, "anew", trail))
    other: Any = Some()
    assert full_rate.with_frame_response_updated(other, old) == (best, "anew", old)
    assert full_rate.with_frame_response_updated(best, old) == (best, old)

"""One round of forward selection over scores and fits that are given: which effects are fitted, and how far."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import WIDER_EFFECTS, Infeasible
from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search import forward_selection as module
from analysis.diagnosis.search.forward_selection import Trail
from analysis.inference import Point
from analysis.shot import Cancelled
from tests.analysis.diagnosis.shots import KINDS, calm

NAMES = (
    "viscous_drag", "tilt", "coulomb_friction", "quadratic_drag", "plate_damping", "adhesion", "block_mode",
    "sensor_drift", "cubic_stiffness", "contact_exponent",
)  # fmt: skip
DRAG, TILT, FRICTION, SQUARE, DAMPING, ADHESION, MODE, DRIFT, CUBIC, EXPONENT = EVERY = effects_named(NAMES)


class Fit:
    """A fit by its criterion, and what a longer search makes of it."""

    def __init__(self, bic: float, *effects: Any, **more: Any) -> None:
        self.bic, self.effects, self.converged = bic, effects, more.get("converged", True)
        self.log_likelihood = -bic / 2
        self.noise: Any = SimpleNamespace(
            site=more.get("site", ()), coloured=more.get("coloured", False), wander=()
        )  # fmt: skip
        self.unlearned_noise, self.longer = "unlearned", more.get("longer", 0.0)

    def __repr__(self) -> str:
        return f"Fit({self.bic}, {[one.name for one in self.effects]})"

    def refitted(self, *, evaluations: int, cancelled: Any) -> "Fit":
        assert (evaluations, cancelled) == (16, calm)
        return Fit(self.bic - self.longer, *self.effects)


def score(effect: Any, gain: float, start: Any = 1) -> Any:
    return SimpleNamespace(kind=SimpleNamespace(effect=effect), gain=gain, start=start)


class Round:
    """A round from ``here``, in which effects score so much and come to so much when they are fitted."""

    def __init__(
        self, patch: pytest.MonkeyPatch, here: Fit, gains: dict[Any, float], bics: dict[Any, float] | None = None, *,
        power: float = 1.4, starts: int = 3, under: dict[Any, float] | None = None,
    ) -> None:  # fmt: skip
        self.here, self.tried, self.free, self.both, self.longer = here, [], [], [], 0.0
        self.start = Fit(1000.0)
        self.trail = Trail(self.start if here.effects else here, [KINDS[name] for name in NAMES], calm)  # type: ignore[arg-type]
        bics = bics or {}

        def under_noise(noise: Any) -> Any:
            assert noise == "unlearned"
            return SimpleNamespace(listed=under or {}, left=at.left)

        at: Any = SimpleNamespace(listed=gains, left=np.full(100, math.sqrt(power)), under=under_noise)

        def ranked(at: Any, free: Any, trail: Any) -> Any:
            self.free.append([kind.effect for kind in free])
            order = sorted(at.listed, key=lambda one: -at.listed[one])
            return [[score(one, at.listed[one], k) for k in range(starts)] for one in order]

        def refitted(at: Any, tried: Any, stop: Any) -> Any:
            assert stop is calm
            self.tried += [(one.kind.effect, one.start) for one in tried]
            effects = here.effects
            return [
                Fit(bics[one.kind.effect], *effects, one.kind.effect, longer=self.longer)
                if one.kind.effect in bics and one.start in (0, "opposite") else None
                for one in tried
            ]  # fmt: skip

        def both(here: Any, fitted: Any, start: Any, stop: Any) -> Any:
            self.both.append(fitted)
            return None

        patch.setattr(Trail, "linearised", lambda trail, fitted: at)
        patch.setattr(module, "_ranked", ranked)
        patch.setattr(module, "_refitted", refitted)
        patch.setattr(module, "distinct_starts", lambda listed: listed)
        patch.setattr(
            module, "opposite", lambda one: score(one.kind.effect, one.gain, "opposite") if one.start == 0 else None
        )
        patch.setattr(module, "with_both_effects", both)

    def best(self, **how: Any) -> Any:
        return module.add_best_effect(self.here, self.trail, **how)  # type: ignore[arg-type]

    def effects(self) -> list[Any]:
        return list(dict.fromkeys(effect for effect, _ in self.tried))


def test_effects_that_promise_a_fall_are_fitted_the_first_two_from_two_places(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = dict(zip(EVERY, (90.0, 80.0, 8.1, 7.9, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0), strict=True))
    later = Round(monkeypatch, Fit(500.0, EXPONENT), gains)
    later.best()
    assert later.tried == [(DRAG, 0), (DRAG, 1), (TILT, 0), (TILT, 1), (FRICTION, 0)]
    assert later.free == [list(EVERY[:-1])] and not later.trail.scores and not later.trail.compared
    first = Round(monkeypatch, Fit(500.0), gains)
    first.best(first=True)
    assert first.effects() == list(EVERY[:5])  # the first round compares
    assert {one: scored.gain for one, scored in first.trail.scores.items()} == gains
    assert all(scored.start == 0 for scored in first.trail.scores.values()) and first.trail.compared
    faint = Round(monkeypatch, Fit(500.0), dict.fromkeys(EVERY, 7.9))
    faint.best(first=True)
    assert len(faint.effects()) == 2
    narrow = Round(monkeypatch, Fit(500.0), gains)
    narrow.best(first=True, width=3)
    assert len(narrow.effects()) == 3
    none = Round(monkeypatch, Fit(500.0), {})
    assert none.best(first=True) is None and none.trail.compared and not none.tried


@pytest.mark.parametrize(("power", "converged", "count"), [(1.51, True, 8), (1.49, True, 5), (1.49, False, 8)])
def test_far_above_the_noise_more_are_fitted_whatever_they_promise(
    power: float, converged: bool, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    strong = Round(monkeypatch, Fit(500.0, converged=converged), dict.fromkeys(EVERY, 9.0), power=power)
    strong.best(first=True)
    assert len(strong.effects()) == count
    little = Round(monkeypatch, Fit(500.0, EXPONENT, converged=converged), dict.fromkeys(EVERY[:9], 1.0), power=power)
    little.best()
    assert len(little.effects()) == (8 if count == 8 else 0)


def test_on_a_moving_frame_the_first_effects_are_also_tried_turned_round(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = {DRAG: 90.0, TILT: 7.9}
    moving = Round(monkeypatch, Fit(500.0, site=(1.0,)), gains)
    moving.best(first=True)
    assert moving.tried == [(DRAG, 0), (DRAG, 1), (TILT, 0), (TILT, 1), (DRAG, "opposite")]
    later = Round(monkeypatch, Fit(500.0, EXPONENT, site=(1.0,)), gains)
    later.best()
    assert later.tried == [(DRAG, 0), (DRAG, 1)]


def test_where_noise_was_learned_those_are_fitted_too_that_score_best_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    under = {DRAG: 9.0, ADHESION: 8.0, CUBIC: 7.0, DRIFT: 6.0}
    coloured = Round(monkeypatch, Fit(500.0, coloured=True), {DRAG: 90.0}, under=under)
    coloured.best(first=True)
    assert coloured.tried == [(DRAG, 0), (DRAG, 1), (ADHESION, 0), (CUBIC, 0)]  # three, of which one is there
    assert coloured.free[0] == coloured.free[1] == list(EVERY)
    white = Round(monkeypatch, Fit(500.0), {DRAG: 90.0}, under=under)
    white.best(first=True)
    assert white.effects() == [DRAG]


def test_an_effect_that_pays_alone_is_also_added_from_where_it_was_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    later = Round(monkeypatch, Fit(500.0, EXPONENT), {DRAG: 90.0, TILT: 80.0, MODE: 70.0})
    pays, little = Fit(900.0, DRAG), Fit(1000.0 - later.trail.least_fall() + 0.1, TILT)
    for one in (pays, little):
        later.trail.keep(one)  # type: ignore[arg-type]
    later.best()
    assert later.both == [pays]
    first = Round(monkeypatch, Fit(1000.0), {DRAG: 90.0})
    first.trail.keep(pays)  # type: ignore[arg-type]
    first.best(first=True)
    assert not first.both


def test_the_likeliest_fits_are_led_on_and_all_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within forty of the best, five at most; the second of a residual far above the noise in any case."""
    bics = dict(zip(EVERY[:8], (100.0, 139.9, 140.1, 120.0, 121.0, 122.0, 123.0, 200.0), strict=True))
    gains = {effect: 99.0 - k for k, effect in enumerate(EVERY[:8])}
    strong = Round(monkeypatch, Fit(500.0), gains, bics, power=2.0)
    strong.longer = 50.0
    best = strong.best(first=True)
    assert best.bic == 50.0 and best.effects == (DRAG,)
    kept = {next(iter(key)): fit.bic for key, fit in strong.trail.fits.items() if key}
    led_on = {DRAG: 50.0, SQUARE: 70.0, DAMPING: 71.0, ADHESION: 72.0, MODE: 73.0}
    assert kept == bics | led_on
    far = {DRAG: 100.0, TILT: 190.0, FRICTION: 191.0}
    for power, second in ((2.0, 140.0), (1.0, 190.0)):
        two = Round(monkeypatch, Fit(500.0), dict.fromkeys(far, 99.0), far, power=power)
        two.longer = 50.0
        two.best(first=True)
        assert two.trail.of([TILT]).bic == second and two.trail.of([FRICTION]).bic == 191.0  # type: ignore[union-attr]
    overtaken = Round(monkeypatch, Fit(500.0), dict.fromkeys(far, 99.0), {DRAG: 100.0, TILT: 101.0})
    overtaken.longer = 2.0
    monkeypatch.setattr(Fit, "refitted", lambda self, **_: Fit(self.bic - 5.0 * (TILT in self.effects), *self.effects))
    assert overtaken.best(first=True).effects == (TILT,)


def test_short_fits_end_at_what_those_before_them_have_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    bics: dict[Any, Any] = {0: 50.0, 1: None, 2: 40.0, 3: 60.0, 4: 10.0}
    asked: list[Any] = []

    def refit(at: Any, kind: Any, start: Any, stop: Any, *, least_bic: float) -> Any:
        assert (at, kind, stop) == ("at", f"kind {start}", calm)
        asked.append((start, least_bic))
        return None if bics[start] is None else Fit(bics[start])

    monkeypatch.setattr(module, "refit", refit)
    tried: Any = [SimpleNamespace(kind=f"kind {k}", start=k) for k in range(5)]
    at: Any = "at"
    found = module._refitted(at, tried, calm)
    assert [None if one is None else one.bic for one in found] == list(bics.values())
    assert sorted(asked) == [
        (0, math.inf),
        (1, 50.0),
        (2, 50.0),
        (3, 40.0),
        (4, 40.0),
    ]  # the first alone, then in pairs
    listed = [[SimpleNamespace(worth=lambda size, w=w: w * size, w=w)] for w in (3.0, 9.0, 5.0)]
    asked_for: list[Any] = []
    screened: Any = SimpleNamespace(
        left=np.ones(4), screen=lambda free, stop, *, to_join: asked_for.append((free, stop, to_join)) or listed
    )
    trail: Any = SimpleNamespace(stop=calm)
    free: Any = "free"
    assert [one[0].w for one in module._ranked(screened, free, trail)] == [9.0, 5.0, 3.0]  # type: ignore[attr-defined]
    assert asked_for == [("free", calm, CRITERIA.least_fall)]


def trail_of(*fits: Fit) -> Trail:
    made = Trail(fits[0], (), calm)  # type: ignore[arg-type]
    for one in fits[1:]:
        made.keep(one)  # type: ignore[arg-type]
    return made


def test_a_fit_without_an_effect_is_the_known_one_where_that_is_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else one is made: a known one may have stopped in another valley, and far off it is in one."""
    made: list[Any] = []

    def fewer(fitted: Any, effect: Any, stop: Any) -> Any:
        made.append((fitted, effect, stop))
        return new

    monkeypatch.setattr(module, "without_effect", fewer)
    start, two = Fit(900.0), Fit(100.0, DRAG, TILT)

    def without(known: Fit | None) -> Any:
        made.clear()
        trail = trail_of(start, *([known] if known else []))
        found: Any = module.without(two, DRAG, trail)  # type: ignore[arg-type]
        again: Any = module.without(two, DRAG, trail)  # type: ignore[arg-type]
        assert again is found and len(made) <= (1 if known or new else 2)
        return found

    new: Fit | None = Fit(300.0, TILT)
    near = Fit(129.0, TILT)
    assert without(near) is near and not made
    far, unsure = Fit(601.0, TILT), Fit(120.0, TILT, converged=False)
    assert without(far) is new and without(unsure) is unsure and made == [(two, DRAG, calm)]
    trail = trail_of(start, far)
    for fitted, times in ((two, 1), (Fit(71.0, DRAG, TILT), 1), (Fit(69.0, DRAG, TILT), 2)):  # better by thirty
        module.without(fitted, DRAG, trail)  # type: ignore[arg-type]
        assert len([one for one in made if one[0] is not two]) == times - 1
    better = Fit(299.0, TILT, converged=False)
    assert without(better) is better and made  # the likelier of both
    new = None
    assert without(far) is far and without(None) is None
    one: Any = Fit(100.0, DRAG)
    assert module.without(one, DRAG, trail_of(start)) is start  # type: ignore[comparison-overlap]


@pytest.mark.parametrize("feasible", [True, False])
def test_an_effect_is_taken_out_with_the_numbers_that_the_others_have(feasible: bool) -> None:
    asked: list[Any] = []

    def fitted(z: Any, *, anew: bool, cancelled: Any) -> Any:
        asked.append((z, anew, cancelled))
        if not feasible:
            raise Infeasible("nowhere")
        return "fitted"

    bare = SimpleNamespace(pack_effective=lambda point: point, fit=fitted)
    full: Any = SimpleNamespace(
        problem=SimpleNamespace(without_effect=lambda effect: bare if effect is DRAG else None),
        effective=Point("base", "own", ({DRAG: "d", TILT: "t"},)),  # type: ignore[arg-type]
    )
    found: Any = module.without_effect(full, DRAG, calm)
    assert found == ("fitted" if feasible else None)
    assert asked == [(Point("base", "own", ({TILT: "t"},)), True, calm)]  # type: ignore[arg-type]


def test_pairs_of_effects_that_were_fitted_alone_are_fitted_together_once(monkeypatch: pytest.MonkeyPatch) -> None:
    (row,) = WIDER_EFFECTS.values()
    narrow = effect_named(row.widens)
    trail = trail_of(
        Fit(900.0), Fit(100.0, DRAG), Fit(110.0, TILT), Fit(120.0, narrow), Fit(130.0, row), Fit(140.0, MODE),
        Fit(50.0, DRAG, TILT), Fit(895.0, CUBIC),
    )  # fmt: skip
    asked: list[Any] = []

    def together(one: Any, other: Any, start: Any, stop: Any) -> Any:
        assert (start, stop) == (trail.start, calm)
        asked.append((one.effects[0], other.effects[0]))
        return None if MODE in other.effects else Fit(ends.get(asked[-1], 80.0), *one.effects, *other.effects)

    ends = {(TILT, row): 60.0}
    monkeypatch.setattr(module, "with_both_effects", together)
    monkeypatch.setattr(module, "converge", lambda fitted, trail: ("polished", fitted))
    found: Any = module.best_untried_pair(trail)
    # the four likeliest that pay; drag and tilt are known together, and the wider holds the narrow
    assert sorted(asked, key=str) == sorted([(DRAG, narrow), (DRAG, row), (TILT, narrow), (TILT, row)], key=str)
    assert found[0] == "polished" and found[1].bic == 60.0
    assert module.best_untried_pair(trail_of(Fit(900.0), Fit(100.0, DRAG))) is None
    assert (
        module.best_untried_pair(trail_of(Fit(900.0), Fit(100.0, DRAG), Fit(110.0, TILT), Fit(0.0, DRAG, TILT))) is None
    )


def test_a_search_begins_again_at_the_two_likeliest_effects_that_were_not_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Any] = []
    ends = {ADHESION: 70.0, MODE: 90.0}

    def climbed(first: Any, trail: Any, most: int, width: int) -> Any:
        asked.append((first, most, width))
        return Fit(ends[first[1].effects[0]])

    monkeypatch.setattr(module, "add_effects", climbed)
    monkeypatch.setattr(module, "converge", lambda fitted, trail, *, from_white: ("polished", fitted, from_white))
    alone = [Fit(100.0 + k, one) for k, one in enumerate((DRAG, ADHESION, MODE, CUBIC))]
    trail, best = trail_of(Fit(900.0), *alone), Fit(80.0, DRAG, TILT)
    found: Any = module.restart_from_other_effects(best, trail)  # type: ignore[arg-type]
    assert found.bic == 70.0
    assert asked == [(("polished", one, True), CRITERIA.most_effects - 1, 3) for one in alone[1:3]]
    asked.clear()
    ends[CUBIC] = 60.0
    assert module.restart_from_other_effects(best, trail, 3).bic == 60.0 and len(asked) == 3  # type: ignore[arg-type]
    ends[ADHESION] = 81.0
    assert module.restart_from_other_effects(best, trail) is best  # type: ignore[comparison-overlap, arg-type]


@pytest.mark.parametrize(
    ("bics", "most", "beat", "left"),
    [
        ((1000.0, 900.0, 800.0, 700.0, 600.0), 3, math.inf, 3),
        ((1000.0, 900.0, 800.0, 700.0, 600.0), 2, math.inf, 2),
        ((1000.0, 900.0, 884.1, 700.0), 3, math.inf, 1),  # 10 + 2 ln 20 of so long a catalogue
        ((1000.0, 900.0, 883.9, 700.0), 3, math.inf, 3),
        ((1000.0, 900.0, None), 3, math.inf, 1),
        # after the first round as much again twice, after the second once
        ((1000.0, 900.0, 800.0, 700.0), 3, 601.0, 3),
        ((1000.0, 900.0, 800.0, 700.0), 3, 599.0, 1),
        ((1000.0, 900.0, 850.0, 700.0), 3, 699.0, 2),
    ],
)
def test_effects_join_one_at_a_time_while_each_pays(
    bics: tuple[float | None, ...], most: int, beat: float, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    fits = [None if bic is None else Fit(bic, *EVERY[:k]) for k, bic in enumerate(bics)]
    asked: list[Any] = []

    def extended(here: Any, trail: Any, *, first: bool, width: int) -> Any:
        asked.append((first, width))
        return fits[len(here.effects) + 1]

    monkeypatch.setattr(module, "add_best_effect", extended)
    monkeypatch.setattr(module, "replace_by_wider", lambda here, trail: here)
    monkeypatch.setattr(module, "_polished_first", lambda fitted, trail: fitted)
    monkeypatch.setattr(module, "prune", lambda fitted, trail: fitted)
    monkeypatch.setattr(module, "converge", lambda fitted, trail: fitted)
    trail = Trail(fits[0], [KINDS["tilt"]] * 20, calm, beat=beat)  # type: ignore[arg-type]
    assert len(module.add_effects(fits[0], trail, most, 5).effects) == left  # type: ignore[arg-type]
    assert asked[0] == (True, 5) and all(one == (False, 5) for one in asked[1:])


def test_a_trail_stops_where_it_is_asked_to() -> None:
    trail = Trail(Fit(1.0), (), lambda: True)  # type: ignore[arg-type]
    with pytest.raises(Cancelled):
        trail.raise_if_cancelled()
    trail.stop = calm
    trail.raise_if_cancelled()


@pytest.mark.parametrize(
    ("bic", "coloured", "chi2", "anew"),
    [
        (399.0, True, 111.0, True),
        (401.0, True, 111.0, False),
        (399.0, False, 111.0, False),
        (399.0, True, 109.0, False),
    ],
)
def test_a_search_is_made_anew_from_white_noise_where_the_learned_noise_may_hide_something(
    bic: float, coloured: bool, chi2: float, anew: bool
) -> None:
    asked: list[Any] = []

    class Polished(Fit):
        samples = 100

        def chi2(self, noise: Any) -> float:
            return {"unlearned": chi2}[noise]

        def refitted(self, *, evaluations: int, anew: bool, cancelled: Any) -> "Polished":  # type: ignore[override]
            asked.append(("on", evaluations, anew, cancelled))
            return self if self.bic == bic - 7.0 else Polished(bic, DRAG, coloured=coloured)

        def from_white(self, *, evaluations: int, cancelled: Any) -> "Polished":
            asked.append(("white", evaluations, cancelled))
            return Polished(bic - 7.0, DRAG)

    trail, begin = trail_of(Fit(900.0)), Polished(500.0, DRAG)
    found: Any = module.converge(begin, trail, from_white=True)  # type: ignore[arg-type]
    assert found.bic == (bic - 7.0 if anew else bic) and trail.of([DRAG]) is found
    on = ("on", 60, True, calm)
    assert asked == [on, ("white", 60, calm), on] if anew else [on]
    asked.clear()
    module.converge(begin, trail)  # type: ignore[arg-type]
    assert asked == [on]


@pytest.mark.parametrize(("bic", "taken"), [(80.0, True), (95.0, False)])
def test_a_wider_effect_takes_the_place_where_it_pays(bic: float, taken: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    trial = Fit(bic, MODE)
    monkeypatch.setattr(module, "wider_fits", lambda here, effect, stop: [trial] if effect is DRAG else [])
    monkeypatch.setattr(module, "converge", lambda fitted, trail: Fit(fitted.bic - 1.0, *fitted.effects))
    trail = trail_of(Fit(900.0), here := Fit(100.0, TILT, DRAG))
    found: Any = module.replace_by_wider(here, trail)  # type: ignore[arg-type]
    assert (found.bic == bic - 1.0) is taken and (found is here) is not taken
    assert trail.of([MODE]) is trial  # type: ignore[comparison-overlap]

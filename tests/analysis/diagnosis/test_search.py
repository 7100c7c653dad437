"""The search under one noise, where it begins, and what it hands to each of its steps, over fits that are given."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import WIDER_EFFECTS, Infeasible
from analysis.collision.effects import effects_named
from analysis.diagnosis import catalogue_search as search
from analysis.diagnosis.catalogue_search import Search, SearchResult
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search import forward_selection
from analysis.inference import Point
from analysis.inference.noise.site import STILL_FRAME
from tests.analysis.diagnosis.shots import KINDS

DRAG, TILT, ARM = effects_named(("viscous_drag", "tilt", "viscoelastic_arm"))


def fit(bic: float, *effects: Any, **more: Any) -> Any:
    return SimpleNamespace(bic=bic, effects=effects, **more)


class Start(tuple[Any, ...]):
    """A fit from which a search starts; its problem is what is asked whether the frame moves far."""

    problem = "problem"


def trail_of(start: Any, *, compared: bool = True) -> Any:
    return SimpleNamespace(
        start=start, compared=compared, nothing_pays=True, linearised=lambda fitted: ("linear", fitted),
        added=lambda fitted: [one for one in fitted.effects if one not in start.effects],
        within=lambda what, work, otherwise: work(),
    )  # fmt: skip


def question(catalogue: Any = (), accepted: Any = (), **more: Any) -> Any:
    return SimpleNamespace(shots="shots", begin="given", catalogue=catalogue, accepted=accepted, stop="stop", **more)


@pytest.mark.parametrize("rounds", [0, 2])
@pytest.mark.parametrize("significant", [True, False])
def test_a_search_goes_on_where_rounds_are_left_and_something_is(
    rounds: int, significant: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    best, trail = fit(5.0), trail_of(fit(9.0))
    left = SimpleNamespace(significant=significant, leaves_something=lambda *, nothing_pays: ("left", nothing_pays))
    monkeypatch.setattr(search, "residual_of", lambda fitted, at: left if at == ("linear", fitted) else None)
    monkeypatch.setattr(search, "add_effects", lambda *given: given)
    searched = SearchResult(best, trail, rounds)
    assert searched.leaves_something == ("left", True)
    ended: Any = searched.to_convergence()
    goes_on = bool(rounds) and significant
    assert ended == (SearchResult((best, trail, rounds), trail) if goes_on else searched)  # type: ignore[arg-type]


def test_two_effects_that_hide_each_other_take_the_place_where_they_are_likelier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searched = SearchResult(fit(5.0), trail_of(fit(9.0)), 1)
    for pair, taken in ((None, False), (fit(5.0), False), (fit(4.9), True)):
        monkeypatch.setattr(
            search, "best_untried_pair", lambda trail, pair=pair: pair if trail is searched.trail else "other"
        )
        found = searched.with_pairs()
        assert (found.best is pair) is taken and (found is searched) is not taken and found.rounds == 1


MOVING: Any = SimpleNamespace(moves=True, resembles=lambda effect: effect in (TILT, ARM))


class Stage:
    """Stands in for all that a search asks; ``fits`` are its best with and without accelerations of each shot's own."""

    def __init__(self, patch: pytest.MonkeyPatch, *, along: tuple[str, ...] = (), **more: Any) -> None:
        self.asked: list[Any] = []
        self.first: Any = fit(50.0, DRAG)
        self.best: Any = fit(40.0, DRAG, TILT)
        self.plain: Any = fit(45.0, DRAG)
        self.start = fit(90.0)
        self.compared = {True: True, False: True} | more.get("compared", {})
        self.pays = more.get("pays", True)

        def search_from_base(trail: Any, given: Any, most: int) -> Any:
            beside = trail.start[1][4]
            names = [kind.effect.name for kind in trail.catalogue]
            options = {"most": most, "limit": trail.limit, "beat": trail.beat}
            self.asked.append(("search_from_base", trail.start, given, names, trail.stop, options))
            best = (self.first if most == 1 else self.best) if beside or not along else self.plain
            return best, trail_of(self.start, compared=self.compared[bool(beside)])

        patch.setattr(
            search,
            "Trail",
            lambda start, catalogue, stop, *, limit, beat=math.inf: SimpleNamespace(
                start=start, catalogue=catalogue, stop=stop, limit=limit, beat=beat
            ),
        )
        patch.setattr(search, "joint_data", lambda *given: SimpleNamespace(shots=("shots", given)))
        patch.setattr(
            search, "per_shot_nuisances", lambda shots, chance: along if chance == CRITERIA.own_flights else None
        )
        patch.setattr(search, "base_fit", lambda data, *given: ("base", data.shots, *given))
        patch.setattr(search, "accept", lambda base, *given: Start(("accepted", base, *given)))
        patch.setattr(search, "frame_moves_far", lambda problem: problem == "problem" and more.get("far", False))
        patch.setattr(search, "with_frame_relinearised", lambda start, stop: ("anew", *start[1:], stop))
        patch.setattr(search, "search_from_base", search_from_base)
        patch.setattr(search, "nearly_as_likely", lambda first, trail: [fit(51.0, TILT), first])
        patch.setattr(
            search,
            "with_frame_response_updated",
            lambda fitted, trail: (fit(fitted.bic - 1.0, *fitted.effects, swayed=True), trail),
        )
        patch.setattr(
            search,
            "add_effects",
            lambda here, trail, most: self.asked.append(("add_effects", here, most)) or self.climbed(here),
        )
        patch.setattr(search, "_nuisances_pay", lambda best, nuisances, stop: self.pays and nuisances == along)
        self.climbed = more.get("climbed", lambda here: self.best)

    def tell(self, *what: Any) -> None:
        self.asked.append(what)

    def search(self, *, accepted: Any = (), limit: Any = None) -> Search:
        catalogue = [KINDS[name] for name in ("viscous_drag", "tilt", "viscoelastic_arm")]
        return Search(question(catalogue, accepted, progress=self.tell, limit=limit))


def test_at_rest_the_whole_catalogue_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(monkeypatch)
    searched = stage.search(limit="limit").under(STILL_FRAME, most=2, beat=7.0)
    data = ("shots", ("shots", "given", STILL_FRAME))
    told, (_, start, given, names, stop, options) = stage.asked
    assert told == ("scoring the catalogue", 0.15)
    assert start[:2] == ("accepted", ("base", data, "given", "stop", ())) and start[3:] == ((), "stop")
    assert (given, stop) == ("given", "stop") and names == ["viscous_drag", "tilt", "viscoelastic_arm"]
    assert options == {"most": 2, "limit": "limit", "beat": 7.0}
    assert searched.best is stage.best
    assert searched.rounds == CRITERIA.most_effects - 2
    assert stage.search().under(STILL_FRAME).rounds == 0  # fewer were found than might have been
    assert stage.search(accepted=(DRAG,)).under(STILL_FRAME) and stage.asked[-1][1][0] == "anew"


def test_on_a_moving_frame_its_motion_is_no_finding_and_its_response_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(monkeypatch)
    searched = stage.search(accepted=(TILT,)).under(MOVING, most=3)
    *_, (_, start, _, names, _, options), added = stage.asked
    assert names == ["viscous_drag", "tilt"]  # which the model has, though it resembles a frame
    assert start[1][1] == ("shots", ("shots", "given", MOVING)) and start[0] == "anew" and start[-1] == "stop"
    assert options == {"most": 1, "limit": None, "beat": math.inf}  # plates seem to move where an effect is missing
    assert added[1].bic == 49.0 and added[1].effects == (DRAG,) and added[2] == 2  # likelier by the frame's response
    assert (searched.best.bic, searched.best.swayed) == (39.0, True)
    still = Stage(monkeypatch, climbed=lambda here: here)
    assert still.search().under(MOVING).best.bic == 49.0
    far = Stage(monkeypatch, far=True)
    far.search().under(MOVING)
    assert far.asked[-2][1][0] == "anew"  # where the frame moves far, what the base model leaves may be its response
    none = Stage(monkeypatch)
    none.first = fit(60.0)
    monkeypatch.setattr(search, "nearly_as_likely", lambda first, trail: [first])
    assert none.search().under(MOVING).best.bic == 59.0 and none.asked[-1][0] == "search_from_base"


@pytest.mark.parametrize(
    ("plain", "pays", "compared", "own"),
    [
        (40.1, True, {}, True),
        (39.9, True, {}, False),  # without them it is likelier
        (40.1, False, {}, False),  # given the effects they do not pay
        (39.9, False, {False: False}, True),  # a search that was cut off replaces none that was not
        (39.9, False, {False: False, True: False}, False),
    ],
)
def test_accelerations_of_each_shots_own_stay_where_they_pay(
    plain: float, pays: bool, compared: dict[bool, bool], own: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Stage(monkeypatch, along=("own",), pays=pays, compared=compared)
    stage.plain = fit(plain, DRAG)
    searched = stage.search().under(STILL_FRAME)
    assert searched.best is (stage.best if own else stage.plain)
    with_them, without = (one for one in stage.asked if one[0] == "search_from_base")
    assert with_them[1][1][4] == ("own",) and without[1][1][4] == ()


@pytest.mark.parametrize("better", [True, False])
def test_a_fit_may_be_likelier_without_a_building(better: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    def fitted(z: Any, *, cancelled: Any) -> Any:
        assert (z, cancelled) == ("z", "stop")
        return fit(99.0 if better else 100.0)

    made: list[Any] = []
    monkeypatch.setattr(search, "joint_data", lambda *given: given)
    monkeypatch.setattr(search, "white_floor", lambda *given: given)
    monkeypatch.setattr(search, "replace", lambda problem, **new: made.append((problem, new)) or fit(0.0, fit=fitted))
    noise = SimpleNamespace(spacing_s=2e-5)
    best: Any = fit(
        100.0, DRAG, residual_m=[np.array([3.0, -4.0]), np.array([0.0, 5.0])], problem="problem", noise=noise, z="z"
    )
    one = Search(question())
    assert one.likelier_without_frame_motion(best) is better
    ((problem, new),) = made
    assert problem == "problem" and new["data"] == ("shots", "given", STILL_FRAME)
    assert new["noise"] == (pytest.approx(math.sqrt(50.0 / 4)), 2e-5)
    assert not one.likelier_without_frame_motion(fit(100.0))  # there is nothing that bends flights


@pytest.mark.parametrize(("bic", "pay"), [(99.9, False), (100.1, True), (None, True)])
def test_nuisances_pay_where_the_fit_without_them_is_less_likely(bic: float | None, pay: bool) -> None:
    kinds = [SimpleNamespace(effect=effect) for effect in (DRAG, TILT)]
    asked: list[Any] = []

    def fitted(z: Any, *, cancelled: Any) -> Any:
        asked.append((z, cancelled))
        if bic is None:
            raise Infeasible("nowhere")
        return fit(bic)

    bare = SimpleNamespace(pack=lambda point: point, fit=fitted)
    problem = SimpleNamespace(
        effects=kinds, fixed="fixed", with_effects=lambda these, fixed: asked.append((list(these), fixed)) or bare
    )
    point = Point("base", "own", ({DRAG: "d", TILT: "t"}, {DRAG: "e", TILT: "u"}))  # type: ignore[arg-type]
    best: Any = fit(100.0, problem=problem, point=point)
    assert search._nuisances_pay(best, (TILT,), "stop") is pay  # type: ignore[arg-type]
    assert asked == [(kinds[:1], "fixed"), (Point("base", "own", ({DRAG: "d"}, {DRAG: "e"})), "stop")]  # type: ignore[arg-type]


def test_effects_that_the_model_has_join_the_base_but_for_those_that_others_hold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(search, "joined", lambda *given: given)
    monkeypatch.setattr(search, "contained_effects", lambda effects: {DRAG} if TILT in effects else set())
    catalogue = [KINDS[name] for name in ("viscous_drag", "tilt")]
    given: Any = ("base", catalogue)
    assert search.accept(*given, (DRAG,), "stop") == ("base", catalogue[:1], "stop")  # type: ignore[arg-type]
    assert search.accept(*given, (DRAG, TILT), "stop") == ("base", catalogue[1:], "stop")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no effect is called 'viscoelastic_arm'; there are viscous_drag, tilt"):
        search.accept(*given, (ARM,), "stop")  # type: ignore[arg-type]


@pytest.mark.parametrize(("again", "twice"), [(98.9, True), (99.1, False), (None, False)])
def test_where_effects_led_the_base_to_a_better_minimum_the_search_begins_there(
    again: float | None, twice: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    before: Any = fit(100.0, converged=True)
    better = None if again is None else fit(again)
    asked: list[Any] = []

    def add_effects(here: Any, trail: Any, most: int) -> Any:
        asked.append((here, trail.start, most))
        return f"best of {len(asked)}"

    def trail_from(start: Any) -> Any:
        return SimpleNamespace(start=start, of=lambda effects: better if effects == () else None, begun_at=trail_from)

    monkeypatch.setattr(search, "add_effects", add_effects)
    monkeypatch.setattr(search, "_from_the_guess", lambda trail: ("from the guess", trail))
    start: Any = SimpleNamespace(left=1.01 * CRITERIA.drawn_far)
    trail = trail_from(before)
    best, ended = search.search_from_base(trail, start, 2)
    assert best == ("best of 2" if twice else "best of 1")
    assert asked == [(one, one, 2) for one in ([before, better] if twice else [before])]
    assert ended.start is (better if twice else before)
    before.converged = False
    assert search.search_from_base(trail, start, 2) == ("from the guess", trail)
    start.left = 0.99 * CRITERIA.drawn_far
    assert search.search_from_base(trail, start, 2)[0] in ("best of 2", "best of 3", "best of 4")


@pytest.mark.parametrize("ends", [{1.0: 80.0, 0.01: 70.0}, {1.0: 60.0, 0.01: 70.0}, {0.01: 99.0}, {1.0: 101.0}, {}])
def test_from_the_readings_the_likeliest_of_two_climbs_is_taken_or_else_that_of_the_base(
    ends: dict[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A contact as it was read, and one a hundred times softer with a tenth of the damping."""
    shots = [SimpleNamespace(course=SimpleNamespace(own=np.array([1.0, 2.0, 3.0])))] * 2
    guess = np.array([7.0, 8.0, 100.0, 50.0])
    packed: list[Any] = []

    def fit_once(point: Point, *, evaluations: int, cancelled: Any) -> Any:
        packed.append(point)
        assert (evaluations, cancelled) == (1, "stop")
        softer = point.base[2] / 100.0
        np.testing.assert_allclose(point.base, [7.0, 8.0, 100.0 * softer, 50.0 * (1.0 if softer == 1.0 else 0.1)])
        if softer not in ends:
            raise Infeasible("nowhere")
        return fit(500.0, softer=softer)

    data = SimpleNamespace(base=SimpleNamespace(contact_at=[2, 3]), shots=shots)
    problem = SimpleNamespace(
        data=data, with_softened_contact=lambda point: point, pack=lambda point: point, fit_once=fit_once
    )
    before: Any = fit(100.0, problem=problem, point=SimpleNamespace(values="values"))
    monkeypatch.setattr(search, "first_guesses", lambda *given: [guess])
    trail: Any = SimpleNamespace(start=before, stop="stop", begun_at=lambda start: ("begun at", start))

    def from_the_base(there: Any, given: Any) -> Any:
        return "from the base" if given is trail else there

    monkeypatch.setattr(
        search,
        "add_effects",
        lambda there, given: from_the_base(there, given) if there is before else fit(ends[there.softer], DRAG),
    )
    found: Any = search._from_the_guess(trail)
    least = min((bic for bic in ends.values() if bic < 100.0), default=None)
    if least is None:
        assert found == ("from the base", trail)
    else:
        assert found[0].bic == least and found[1] == ("begun at", before)
    assert len(packed) == 2 and np.array_equal(packed[0].own, [[1.0, 2.0, 3.0]] * 2) and packed[0].values == "values"
    monkeypatch.setattr(search, "add_effects", from_the_base)  # where no effect joins
    assert search._from_the_guess(trail) == ("from the base", trail)


@pytest.mark.parametrize("allowed", [True, False])
@pytest.mark.parametrize("feasible", [True, False])
def test_a_wider_effect_takes_the_place_of_its_narrow_one_with_its_numbers(allowed: bool, feasible: bool) -> None:
    (row,) = WIDER_EFFECTS.values()
    (narrow,) = forward_selection.contained_effects([row, TILT])
    kept = KINDS["tilt"]
    made: list[Any] = []

    def fitted(z: Any, *, cancelled: Any) -> Any:
        made.append((z, cancelled))
        if not feasible:
            raise Infeasible("nowhere")
        return "fitted"

    problem = SimpleNamespace(pack_effective=lambda point: point, fit=fitted)
    here: Any = SimpleNamespace(
        problem=SimpleNamespace(
            data=SimpleNamespace(base=SimpleNamespace(allows=lambda effect: allowed)),
            effects=[KINDS[narrow.name], kept],
            with_effects=lambda effects, fixed: made.append((list(effects), fixed)) or problem,
            without_effect=lambda effect: SimpleNamespace(fixed=("fixed", effect)),
        ),
        effective=Point("base", "own", ({TILT: {"angle_rad": 1.0}, narrow: {"frequency_hz": 77.0}},)),  # type: ignore[arg-type]
    )
    found = forward_selection.wider_fits(here, narrow, "stop")  # type: ignore[arg-type]
    assert forward_selection.wider_fits(here, TILT, "stop") == []  # type: ignore[arg-type]
    if not allowed:
        assert found == [] == made
        return
    assert found == (["fitted"] if feasible else [])
    (kinds, fixed), (point, stop) = made
    assert [kind.effect for kind in kinds] == [row, TILT] and fixed == ("fixed", narrow) and stop == "stop"
    values = dict(kinds[0].starts[0]) | {"frequency_hz": 77.0}
    assert (point.base, point.own, point.values) == ("base", "own", ({TILT: {"angle_rad": 1.0}, row: values},))

"""What a search found is refused or passed: by held-out shots, by what it leaves over, by chance, by lack of fit."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.collision.effects import CATALOGUE
from analysis.collision.effects.row import Effect
from analysis.diagnosis.evidence import lack_of_fit
from analysis.diagnosis.evidence.cross_validation import Prediction
from analysis.diagnosis.evidence.lack_of_fit import NO_MISFIT, LackOfFit, largest_misfit
from analysis.diagnosis.evidence.residual import Residual
from analysis.diagnosis.findings.result import Freedom
from analysis.diagnosis.search import forward_selection
from analysis.diagnosis.search.forward_selection import Trail, prune
from analysis.diagnosis.verdict import acceptance, indistinguishable
from analysis.diagnosis.verdict.acceptance import settle, without_unpredictive_effects
from analysis.diagnosis.verdict.indistinguishable import PerShotCost, imitates_by_coincidence
from analysis.inference import Fitted, joined
from analysis.inference.noise.floor import Floor
from analysis.shot import Floats
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots
from tests.analysis.diagnosis.test_acceptance import CALM, TILT, WANDERING, Fit

HELD = (1,)
ADHESION, LINE = CATALOGUE["adhesion"], CATALOGUE["frame_vibration"]
NOTHING_LEFT = Residual(0.0, 57.0, 0.03, 1.1)
SHAPE_LEFT = Residual(120.0, 57.0, 0.03, 1.1, size=10.0)
START = Fit(())
ONE, OTHER, BOTH = Fit((TILT,)), Fit((ADHESION,)), Fit((TILT, ADHESION))


def trail() -> Any:
    return Trail(cast(Any, START), (), calm)


def no_difference(difference: Floats) -> float:
    return 0.0


def predicted(surprise: float) -> Prediction:
    return Prediction((), surprise, 1.0, np.zeros(1), no_difference)


@pytest.mark.parametrize(
    ("worth", "fitted", "left"),
    [(200.0, True, BOTH.effects), (1.0, True, ONE.effects), (1.0, False, BOTH.effects)],
    ids=["both pay", "one does not pay", "neither can be left out"],
)
def test_of_two_effects_the_one_that_does_not_pay_is_taken_out_where_the_rest_can_be_fitted(
    worth: float, fitted: bool, left: tuple[Effect, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    without = {TILT: Fit((ADHESION,), worth=worth), ADHESION: Fit((TILT,), worth=1.5 * worth)}
    monkeypatch.setattr(forward_selection, "without", lambda _, effect, trail: without[effect] if fitted else None)
    assert prune(cast(Any, Fit(BOTH.effects, worth=worth)), trail()).effects == left


@pytest.fixture
def foretold(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Floor]]:
    """Return a function that sets each fit's surprise on the held-out shot and returns the floors compared under."""

    def set_to(surprises: dict[tuple[Effect, ...], float | None]) -> list[Floor]:
        floors: list[Floor] = []

        def predict(fit: Fit, held: tuple[int, ...], floor: Floor, _stop: object) -> Prediction | None:
            assert held == HELD
            floors.append(floor)
            surprise = surprises[tuple(sorted(fit.effects, key=lambda effect: effect.key))]
            return None if surprise is None else predicted(surprise)

        def without(fit: Fit, effect: Effect, _trail: Trail) -> Fit:
            return Fit(tuple(other for other in fit.effects if other != effect))

        monkeypatch.setattr(acceptance, "predict", predict)
        monkeypatch.setattr(acceptance, "without", without)
        return floors

    return set_to


@pytest.mark.parametrize(("surprise", "passes"), [(9.9, True), (10.1, False)])
def test_one_effect_makes_the_held_out_shots_likelier(
    surprise: float, passes: bool, foretold: Callable[..., list[Floor]]
) -> None:
    floors = foretold({(): 10.0, (TILT,): surprise})
    best, told = without_unpredictive_effects(cast(Any, Fit((TILT,), WANDERING)), HELD, trail())
    assert best.effects == ((TILT,) if passes else ())
    assert told == (predicted(10.0), predicted(surprise if passes else 10.0))
    assert floors == [WANDERING, WANDERING]


@pytest.mark.parametrize(
    ("alone", "left"),
    [
        ({(TILT,): 9.0, (ADHESION,): 9.0}, (TILT, ADHESION)),  # neither does as well as both
        ({(TILT,): 8.0, (ADHESION,): 9.0}, (TILT,)),  # better without the other
        ({(TILT,): 9.0, (ADHESION,): 8.0}, (ADHESION,)),
        ({(TILT,): 11.0, (ADHESION,): 8.0}, (ADHESION,)),
    ],
)
def test_each_of_two_effects_pays_on_the_held_out_shots(
    alone: dict[tuple[Effect, ...], float], left: tuple[Effect, ...], foretold: Callable[..., list[Floor]]
) -> None:
    foretold({(): 10.0, (ADHESION, TILT): 8.5, **alone})
    best, told = without_unpredictive_effects(cast(Any, BOTH), HELD, trail())
    assert best.effects == left
    assert told == (predicted(10.0), predicted(8.5 if len(left) == 2 else 8.0))


def test_where_no_effect_of_two_pays_nothing_is_left(foretold: Callable[..., list[Floor]]) -> None:
    foretold({(): 10.0, (ADHESION, TILT): 12.0, (TILT,): 11.0, (ADHESION,): 11.0})
    found = trail()
    assert without_unpredictive_effects(cast(Any, BOTH), HELD, found) == (
        found.start,
        (predicted(10.0), predicted(10.0)),
    )


def test_where_nothing_can_be_foretold_nothing_is_claimed_of_it(foretold: Callable[..., list[Floor]]) -> None:
    foretold({(): 10.0, (TILT,): None})
    assert without_unpredictive_effects(cast(Any, ONE), HELD, trail()) == (cast(Any, ONE), None)
    assert without_unpredictive_effects(cast(Any, ONE), (), trail()) == (cast(Any, ONE), None)


class Stages:
    """Stands in for what ``settle`` asks one after the other: each lets pass until a test says otherwise."""

    def __init__(self, patch: pytest.MonkeyPatch, left: dict[Any, Residual], other: Fit) -> None:
        self.left, self.asked, self.firsts = left, 0, 0
        self.hides: tuple[Effect, ...] | None = None
        self.paid: dict[Any, Any] = {}
        self.bright: dict[Any, Any] = {}
        self.instead: dict[Any, Any] = {}
        self.clean: dict[Any, Any] = {}

        def restart_from_other_effects(_best: Fit, _trail: Trail, firsts: int) -> Fit:
            self.asked += 1
            self.firsts = firsts
            return other

        def with_look_alikes_tried(best: Fit, at: object, *_: object) -> tuple[Fit, object, dict[str, object]]:
            return self.instead.get(best, best), at, {}

        def alternative_without_misfit(
            best: Fit, at: object, rest: Residual, *_: object
        ) -> tuple[Fit, object, Residual]:
            clean = self.clean.get(best, best)
            return clean, at, rest if clean is best else left[clean]

        patch.setattr(acceptance, "without_unpredictive_effects", lambda best, *_: (self.paid.get(best, best), None))
        patch.setattr(acceptance, "without_faint_effects", lambda best, *_: (self.bright.get(best, best), None))
        patch.setattr(acceptance, "with_look_alikes_tried", with_look_alikes_tried)
        patch.setattr(acceptance, "residual_of", lambda best, _at: left[best])
        patch.setattr(acceptance, "alternative_without_misfit", alternative_without_misfit)
        patch.setattr(acceptance, "separations_of", lambda *_: {})
        patch.setattr(acceptance, "restart_from_other_effects", restart_from_other_effects)
        hides = property(lambda best: best.effects == self.hides)
        patch.setattr(Fit, "wanders_only_in_contact", hides, raising=False)


def settled(found: Trail, judged: Residual | None = None) -> Any:
    return settle(cast(Any, ONE), found, HELD, lambda _what, _fraction: None, judged)


@pytest.mark.parametrize("stage", ["paid", "bright", "instead"])
def test_what_one_stage_refuses_does_not_stand(stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = Stages(monkeypatch, {ONE: NOTHING_LEFT, START: NOTHING_LEFT}, ONE)
    assert settled(trail()).best == ONE
    getattr(stages, stage)[ONE] = START
    assert settled(trail()).best == START
    assert stages.asked == 0


LIKELIER, AS_LIKELY = Fit((ADHESION,), worth=201.5), Fit((ADHESION,), worth=200.5)


@pytest.mark.parametrize(
    ("rest", "other", "taken"),
    [
        (SHAPE_LEFT, LIKELIER, True),
        (SHAPE_LEFT, AS_LIKELY, False),  # by no more than where a search happens to stop
        (NOTHING_LEFT, LIKELIER, False),  # nothing asks for another way
    ],
)
def test_another_way_is_taken_where_something_is_left_and_it_is_likelier(
    rest: Residual, other: Fit, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stages = Stages(monkeypatch, {ONE: rest, other: NOTHING_LEFT}, other)
    assert settled(trail()).best == (other if taken else ONE)
    assert (stages.asked, stages.firsts) == ((0, 0) if rest is NOTHING_LEFT else (1, 2))


@pytest.mark.parametrize(("other", "taken"), [(LIKELIER, True), (AS_LIKELY, False)])
def test_a_wander_that_flights_do_not_show_asks_for_another_way(
    other: Fit, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stages = Stages(monkeypatch, {ONE: NOTHING_LEFT, other: NOTHING_LEFT}, other)
    stages.hides = ONE.effects
    assert settled(trail()).best == (other if taken else ONE)
    assert (stages.asked, stages.firsts) == (1, 4)  # it takes up most of what either of two effects does alone


@pytest.mark.parametrize(
    ("learned", "in_flight", "moves", "hides"),
    [
        (WANDERING, CALM, False, True),
        (WANDERING, WANDERING, False, False),
        (CALM, CALM, False, False),
        (WANDERING, CALM, True, False),
    ],
)
def test_a_path_that_wanders_does_so_in_flight_as_well(
    learned: Floor, in_flight: Floor, moves: bool, hides: bool
) -> None:
    data = SimpleNamespace(site=SimpleNamespace(moves=moves), noise_of_flights=in_flight)
    problem: Any = SimpleNamespace(data=data, with_noise=lambda noise: problem, noise=learned)
    fitted = Fitted(problem, np.zeros(1), 0.0, (), np.eye(1), True)
    assert fitted.wanders_only_in_contact is hides


@pytest.mark.parametrize(
    ("stands", "left", "taken"),
    [
        (Fit((LINE,), worth=150.0), NOTHING_LEFT, True),  # less likely, but it explains all
        (Fit((LINE,), worth=150.0), SHAPE_LEFT, False),
        (Fit((LINE,), worth=250.0), SHAPE_LEFT, True),
        (START, NOTHING_LEFT, False),  # nothing at all explains nothing
    ],
)
def test_what_stands_of_another_way_explains_more(
    stands: Fit, left: Residual, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = trail()
    stages = Stages(monkeypatch, {ONE: SHAPE_LEFT, stands: left}, LIKELIER)
    stages.paid[LIKELIER] = found.start if stands is START else stands
    assert settled(found).best == (stands if taken else ONE)


@pytest.mark.parametrize(("rest", "clean"), [(SHAPE_LEFT, True), (NOTHING_LEFT, False)])
def test_a_rival_that_leaves_nothing_takes_the_place_of_what_leaves_something(
    rest: Residual, clean: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stages = Stages(monkeypatch, {ONE: rest, OTHER: NOTHING_LEFT}, ONE)
    stages.clean[ONE] = OTHER
    stands = settled(trail())
    assert stands.best == (OTHER if clean else ONE) and not stands.residual.significant
    assert stands.predicted == ONE  # by which the held-out shots were predicted


def test_what_is_known_to_be_left_counts_for_the_fit_that_left_it_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    stages = Stages(monkeypatch, {ONE: SHAPE_LEFT, START: SHAPE_LEFT}, ONE)
    assert settled(trail(), NOTHING_LEFT).residual is NOTHING_LEFT
    stages.paid[ONE] = START
    assert settled(trail(), NOTHING_LEFT).residual is SHAPE_LEFT


@pytest.mark.parametrize(("surprise", "may"), [(9.9, True), (10.1, False)])
def test_what_is_named_instead_is_foretold_better_than_nothing(
    surprise: float, may: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    Stages(monkeypatch, {ONE: NOTHING_LEFT, OTHER: NOTHING_LEFT}, ONE)
    monkeypatch.setattr(
        acceptance, "without_unpredictive_effects", lambda best, *_: (best, (predicted(10.0), predicted(5.0)))
    )
    monkeypatch.setattr(acceptance, "predict", lambda *_: predicted(surprise))
    monkeypatch.setattr(
        acceptance,
        "with_look_alikes_tried",
        lambda best, at, _trail, foretells: (OTHER if foretells(OTHER) else best, at, {}),
    )
    assert settled(trail()).best == (OTHER if may else ONE)


SHARED, OWN = TILT, CATALOGUE["plate_motion"]


class Shown(Fit):
    """A fit with a chi^2."""

    def chi2(self, _floor: Floor) -> float:
        """Return minus its worth."""
        return -self.worth


@pytest.mark.parametrize(
    ("rival", "instead", "nats", "rival_chi2", "refused"),
    [
        (OWN, SHARED, 12.6, 0.0, True),  # 2 x 12.6 > 5^2
        (OWN, SHARED, 12.4, 0.0, False),
        (OWN, SHARED, 13.6, -2.0, True),  # a better chi^2 counts for the rival
        (OWN, SHARED, 13.4, -2.0, False),
        (SHARED, SHARED, 20.0, 0.0, False),  # one number of all shots is no coincidence in each
        (OWN, OWN, 20.0, 0.0, False),
        (OWN, SHARED, None, 0.0, False),
    ],
)
def test_numbers_of_every_shot_that_fall_where_one_number_foretells_them_are_chance(
    rival: Effect,
    instead: Effect,
    nats: float | None,
    rival_chi2: float,
    refused: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    theirs, ours = Shown((rival, LINE), worth=-rival_chi2), Shown((instead,), worth=0.0)
    cost = {theirs: None if nats is None else nats + 3.0, ours: 3.0}

    def per_shot_cost(fitted: Shown, _effect: Effect) -> PerShotCost | None:
        known = cost[fitted]
        return None if known is None else PerShotCost(known, np.ones(1))

    monkeypatch.setattr(indistinguishable, "per_shot_cost", per_shot_cost)
    assert imitates_by_coincidence(cast(Any, theirs), rival, cast(Any, ours), instead) is refused
    assert not imitates_by_coincidence(None, rival, cast(Any, ours), instead)


def lacking(
    gains: dict[str, tuple[float, int, Floor]],
    monkeypatch: pytest.MonkeyPatch,
    slow: float = 1.0,
    in_contact: bool = False,
) -> LackOfFit:
    """Return the worst of shapes with these gains, widths and floors beside them, of one shot without effects."""
    kinks, *laws = gains
    data = SimpleNamespace(shots=[SimpleNamespace(course=SimpleNamespace(velocity_in_m_per_s=-0.3))], count=4)
    problem = SimpleNamespace(data=data, free_parameters=(), offset=7, size=7, arrow=lambda _blocks: None)
    monkeypatch.setattr(lack_of_fit, "_kinks", lambda _shot: kinks)
    monkeypatch.setattr(lack_of_fit, "free_laws", lambda *_: {name: [name] for name in laws})
    monkeypatch.setattr(lack_of_fit, "shared", lambda columns: columns[0])
    monkeypatch.setattr(lack_of_fit, "gain", lambda _fitted, _at, shape: gains[shape])
    fitted = SimpleNamespace(problem=problem, point=None, wanders_only_in_contact=in_contact)
    at = cast(Any, SimpleNamespace(lines=()))
    return largest_misfit(cast(Any, fitted), at, at, slow)


@pytest.mark.parametrize(("last", "missed"), [(5e-4, None), (5.5e-4, Freedom.EFFECT_PER_SHOT)])
def test_an_effect_that_is_another_one_in_one_shot_is_missed_as_that(last: float, missed: Freedom | None) -> None:
    first, other = (shots({"viscous_drag": {"coefficient_n_s_per_m": c}}) for c in (5e-4, last))
    fitted = joined(base_fit((*first[:2], other[2])), [KINDS["viscous_drag"]], calm)
    at = fitted.linearise()
    found = largest_misfit(fitted, at, at)
    assert (found.shape if found.significant else None) is missed


@pytest.mark.parametrize(
    ("floor", "in_contact", "times"), [(CALM, False, 1.0), (WANDERING, False, 3.0), (WANDERING, True, 1.0)]
)
@pytest.mark.parametrize("slow", [1.0, 1.7])
@pytest.mark.parametrize(("share", "missed"), [(1.01, True), (0.99, False)])
def test_a_freedom_is_missed_where_it_gains_more_than_chance(
    share: float, missed: bool, slow: float, floor: Floor, in_contact: bool, times: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A wander that the flights do not show is no noise, beside which chance would gain more."""
    limit = times * slow * float(chi2.isf(3e-3 / 3, 4))  # of three shapes each has a third of the chance
    found = lacking(
        {"kinks": (0.0, 9, CALM), "place": (share * limit, 4, floor), "speed": (0.0, 5, CALM)},
        monkeypatch,
        slow,
        in_contact,
    )
    assert found.shape == "place" and found.width == 4
    assert found.significant is missed
    assert Residual(0.0, 57.0, 0.03, 1.1, misfit=found).significant is missed


def test_the_freedom_is_named_that_exceeds_its_limit_most(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = {"kinks": (90.0, 60, CALM), "place": (60.0, 4, CALM), "speed": (70.0, 4, WANDERING)}
    assert lacking(gains, monkeypatch).shape == "place"


def test_shapes_that_the_fit_has_already_are_not_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lacking({"kinks": (0.0, 0, CALM), "place": (0.0, 0, CALM)}, monkeypatch) is NO_MISFIT
    assert not NO_MISFIT.significant

"""Which look-alikes of an effect are fitted in its place, where they begin, and when one is told to be chance."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.evidence.identifiability import Separation
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search import competing_models as module
from analysis.diagnosis.search.competing_models import _close, _known, _nearest, _of_one_line, _ring_alike
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.verdict import indistinguishable
from analysis.diagnosis.verdict.indistinguishable import imitates_by_coincidence
from analysis.inference.model.free_parameters import trial_effect
from analysis.inference.screen.screening import Score
from analysis.shot import Cancelled
from tests.analysis.diagnosis.shots import KINDS, calm

DRAG, FRICTION, SQUARE, TILT, MODE, SECOND, SUPPORT, MOTION, DRIFT = effects_named(
    (
        "viscous_drag", "coulomb_friction", "quadratic_drag", "tilt", "block_mode", "second_plate_mode",
        "support_compliance", "plate_motion", "sensor_drift",
    )
)  # fmt: skip


def test_the_two_nearest_the_twins_and_what_rings_alike_are_fitted() -> None:
    assert set(FRICTION.look_alikes) == {"viscous_drag", "sensor_drift"}
    far = Separation(10.0, {TILT: 1.0, SQUARE: 2.0, MODE: 3.0, DRIFT: 5.9, DRAG: 6.1}, {})
    found = [kind.effect for kind in _nearest(FRICTION, far, tuple(KINDS.values()))]
    assert found == [TILT, SQUARE, DRIFT]  # drag leaves more than six tenths of the effect
    lone = Separation(10.0, {MODE: 9.0, SUPPORT: 9.5, TILT: 9.9}, {})
    assert [kind.effect for kind in _nearest(SECOND, lone, tuple(KINDS.values()))] == [SUPPORT]
    assert _ring_alike(SECOND, SUPPORT) and not _ring_alike(SECOND, MODE) and not _ring_alike(DRAG, FRICTION)
    assert _nearest(SECOND, lone, (KINDS["tilt"],)) == []


@pytest.mark.parametrize(("frequency_hz", "close"), [(970.1, True), (969.0, False), (1029.0, True), (1031.0, False)])
def test_a_line_is_the_same_within_three_hundredths(frequency_hz: float, close: bool) -> None:
    assert _close({"frequency_hz": frequency_hz}, 1000.0) is close

    def known(values: dict[str, float], converged: bool, wanted: float | None) -> bool:
        fit = SimpleNamespace(point=SimpleNamespace(values=[{MODE: values}]), converged=converged)
        trail: Any = SimpleNamespace(of=lambda effects: fit if set(effects) == {DRAG, MODE} else None)
        fewer: Any = SimpleNamespace(effects=(DRAG,))
        return _known(trail, fewer, KINDS["block_mode"], wanted) is fit

    line = {"frequency_hz": frequency_hz}
    assert known(line, False, 1000.0) is close and known(line, True, None) and not known(line, False, None)
    assert known({"angle": 1.0}, True, 1000.0) and not known({"angle": 1.0}, False, 1000.0)
    none: Any = SimpleNamespace(of=lambda effects: None)
    fewer: Any = SimpleNamespace(effects=())
    assert _known(none, fewer, KINDS["block_mode"], None) is None


def test_a_line_in_the_place_of_another_begins_at_its_frequency() -> None:
    def start(frequency_hz: float) -> Any:
        return ({"mass_kg": 1e-5, "frequency_hz": frequency_hz, "damping_ratio": 0.01},) * 2

    scores = [SimpleNamespace(start=start(hertz)) for hertz in (500.0, 980.0, 1005.0, 1028.0, 1040.0)]
    at: Any = SimpleNamespace(scores=lambda kind: scores)
    nearest, strong = _of_one_line(at, KINDS["block_mode"], start(1.0), 1000.0)
    assert nearest == start(1005.0)
    assert strong == ({"mass_kg": pytest.approx(1e-4), "frequency_hz": 1000.0, "damping_ratio": 0.01},) * 2
    inverse = _of_one_line(at, KINDS["second_plate_mode"], start(1.0), 1000.0)[1]
    assert inverse[0]["mass_kg"] == pytest.approx(1e-6)  # a lighter mode is a stronger one
    away: Any = SimpleNamespace(scores=lambda kind: scores[:1])
    assert _of_one_line(away, KINDS["frame_vibration"], start(1.0), 1000.0) == [start(1.0)]


@pytest.mark.parametrize(
    ("bic", "converged", "effects", "noise", "predicts", "taken"),
    [
        (119.0, True, {DRAG, TILT}, True, True, True),
        (121.0, True, {DRAG, TILT}, True, True, False),  # twenty behind
        (119.0, False, {DRAG, TILT}, True, True, False),
        (119.0, True, {SQUARE, TILT}, True, True, False),  # two others
        (119.0, True, {DRAG}, True, True, False),
        (119.0, True, {DRAG, TILT}, False, True, False),
        (119.0, True, {DRAG, TILT}, True, False, False),
    ],
)
def test_an_alternative_that_leaves_noise_is_taken(
    bic: float, converged: bool, effects: set[Any], noise: bool, predicts: bool, taken: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    best: Any = SimpleNamespace(effects=(DRAG, FRICTION), bic=100.0)
    other: Any = SimpleNamespace(bic=bic, converged=converged)
    left = SimpleNamespace(significant=not noise)
    monkeypatch.setattr(module, "residual_of", lambda fitted, at: left)
    trail: Any = SimpleNamespace(
        fits={frozenset(effects): other}, raise_if_cancelled=lambda: None, linearised=lambda fit: "other at"
    )
    given: Any = (best, "at", "residual", trail, lambda fit: predicts)
    found: Any = module.alternative_without_misfit(*given)
    assert found == ((other, "other at", left) if taken else (best, "at", "residual"))


def test_numbers_of_every_shot_are_chance_where_one_number_makes_the_shots_likelier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nats = {MOTION: 20.0, DRAG: 5.0, TILT: None}
    monkeypatch.setattr(
        indistinguishable,
        "per_shot_cost",
        lambda _, one: None if nats[one] is None else SimpleNamespace(nats=nats[one]),
    )

    def of(chi2: float) -> Any:
        return SimpleNamespace(noise="best", chi2=lambda noise: {"best": chi2}[noise])

    limit = CRITERIA.separation**2 - 2 * 15.0
    assert imitates_by_coincidence(of(100.0 + limit + 0.1), MOTION, of(100.0), DRAG)
    assert not imitates_by_coincidence(of(100.0 + limit - 0.1), MOTION, of(100.0), DRAG)
    far = of(1e6)
    assert not imitates_by_coincidence(None, MOTION, far, DRAG) and not imitates_by_coincidence(
        far, DRAG, of(0.0), MOTION
    )
    assert not imitates_by_coincidence(far, DRAG, of(0.0), TILT) and not imitates_by_coincidence(
        far, MOTION, of(0.0), TILT
    )


def fit_of(bic: float, *effects: Any, wander: tuple[Any, ...] = ()) -> Any:
    return SimpleNamespace(bic=bic, effects=effects, noise=SimpleNamespace(wander=wander))


def test_a_trail_keeps_the_best_fit_of_every_set_of_effects() -> None:
    start = fit_of(100.0, DRAG)
    trail = Trail(start, tuple(KINDS.values()), calm)
    assert trail.of([DRAG]) is start and trail.nothing_pays
    least = trail.least_fall()
    assert least == pytest.approx(CRITERIA.fall(len(KINDS)))
    for bic in (90.0, 80.0, 85.0):
        trail.keep(fit_of(bic, DRAG, TILT))
    trail.keep(fit_of(70.0, SQUARE, DRAG))
    trail.keep(fit_of(1.0, TILT, SQUARE))
    trail.keep(fit_of(50.0, DRAG, TILT, SQUARE))
    found = trail.of((TILT, DRAG))
    assert found is not None and found.bic == 80.0 and trail.of((MODE,)) is None
    assert [fit.bic for fit in trail.alone()] == [70.0, 80.0]
    assert trail.added(fit_of(0.0, TILT, DRAG, MODE)) == [TILT, MODE]
    assert trail.pays(fit_of(100.0 - least - 0.1), start) and not trail.pays(fit_of(100.0 - least + 0.1), start)
    wandering = fit_of(100.0 - least - 0.1, wander=((1.0, 2.0),))
    assert not trail.pays(wandering, start) and trail.pays(fit_of(88.0 - least - 0.1, wander=((1.0, 2.0),)), start)
    assert trail.least_fall(wandering.noise) == pytest.approx(least + 12.0)
    assert not trail.nothing_pays
    linear: Any = SimpleNamespace(problem="p", z="z")
    given: Any = SimpleNamespace(problem="p", z="z", linearise=lambda near: ("anew", near))
    trail.last = linear
    assert trail.linearised(given) is linear
    given.z = "other"
    assert trail.linearised(given) == ("anew", linear)


def test_work_of_a_search_ends_with_the_limit_of_its_time() -> None:
    trail = Trail(fit_of(0.0), (), calm)
    assert trail.within("this", lambda: trail.stop, calm) is calm  # no limit

    class Limit:
        def within(self, what: str, work: Any, otherwise: Any) -> Any:
            return what, work(), otherwise

    limit: Any = Limit()
    trail.limit = limit
    assert trail.within("this", lambda: trail.stop, "else") == ("this", limit, "else")  # type: ignore[comparison-overlap]
    assert trail.stop is calm


def test_an_effect_as_it_is_tried() -> None:
    mode = trial_effect(MODE)
    assert mode.amplitude == ("mass_kg",) and not mode.own and len(mode.shared) == 3 and not mode.inverse
    assert mode.times({"mass_kg": 2.0, "frequency_hz": 7.0}, 3.0) == {"mass_kg": 6.0, "frequency_hz": 7.0}
    assert trial_effect(SECOND).times({"mass_kg": 6.0}, 3.0) == {"mass_kg": 2.0}
    (cyclic,) = effects_named(("cyclic_error",))
    tried = trial_effect(cyclic)
    assert tried.fixed_in({"amplitude_m": 1.0, "order": 2.0, "phase_rad": 0.1}) == {"order": 2.0}
    assert tried.starts == tuple({"amplitude_m": 1e-9, "order": o, "phase_rad": 0.0} for o in (1.0, 2.0))
    assert [p.name for p in tried.own] == ["phase_rad"] and [p.name for p in tried.shared] == ["amplitude_m"]
    swing = trial_effect(MOTION)
    assert swing.amplitude == ("velocity_m_per_s", "displacement_m") and swing.shared == ()
    assert np.isclose(len(mode.starts), len(MODE.parameters[1].grid))


class Tried:
    """A fit of friction and tilt, in whose place others of these criteria may be fitted."""

    def __init__(
        self, patch: pytest.MonkeyPatch, near: dict[Any, list[Any]], known: dict[Any, float], new: dict[Any, float]
    ) -> None:
        self.asked: list[Any] = []
        self.kept: list[Any] = []
        start = fit_of(500.0)
        self.best = fit_of(100.0, FRICTION, TILT)
        values = {FRICTION: {"force_n": 1.0}, TILT: {"frequency_hz": 77.0}}
        self.best.point = SimpleNamespace(values=[values])
        self.trail: Any = SimpleNamespace(
            start=start, stop="stop", catalogue="catalogue", keep=self.kept.append,
            added=lambda fitted: [one for one in fitted.effects if one not in start.effects],
            linearised=lambda fitted: ("linear", fitted.bic),
        )  # fmt: skip

        def instead(best: Any, at: Any, far: Any, frequency_hz: Any, stop: Any, kind: Any, *, also: Any) -> Any:
            assert also is None
            self.asked.append((at, far, frequency_hz, stop, kind.effect))
            assert best is self.best
            return self.fit(new[kind.effect], kind.effect) if kind.effect in new else None

        def without(best: Any, effect: Any, trail: Any) -> Any:
            return None if effect not in near else fit_of(300.0, *(one for one in best.effects if one is not effect))

        def known_fit(trail: Any, fewer: Any, kind: Any, frequency_hz: Any) -> Any:
            return self.fit(known[kind.effect], kind.effect) if kind.effect in known else None

        patch.setattr(module, "separation", lambda best, at, one, catalogue, stop: (at, one, catalogue, stop))
        patch.setattr(module, "_nearest", lambda effect, far, catalogue: [KINDS[one.name] for one in near[effect]])
        patch.setattr(module, "without", without)
        patch.setattr(module, "_known", known_fit)
        patch.setattr(module, "fitted_instead", instead)

    @staticmethod
    def fit(bic: float, *effects: Any) -> Any:
        found = fit_of(bic, *effects)
        found.refitted = lambda *, evaluations, cancelled: fit_of(bic - 1.0, *effects, wander=(evaluations, cancelled))
        return found

    def tried(self, *, predicts: bool = True) -> Any:
        return module.with_look_alikes_tried(self.best, "at", self.trail, lambda fitted: predicts)  # type: ignore[arg-type]


def test_every_look_alike_is_fitted_once_and_the_likeliest_takes_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    near = {FRICTION: [DRAG, SQUARE, DRIFT], TILT: [MODE]}
    tried = Tried(monkeypatch, near, {DRAG: 90.0}, {SQUARE: 95.0, MODE: 80.0})
    best, at, far = tried.tried()
    assert best.bic == 79.0 and best.effects == (MODE,) and best.noise.wander == (60, "stop")
    assert at == ("linear", 79.0) and far == {MODE: (at, MODE, "catalogue", "stop")}
    first, second = (("at", one, "catalogue", "stop") for one in (FRICTION, TILT))
    assert tried.asked == [
        (("linear", 300.0), first, None, "stop", SQUARE), (("linear", 300.0), first, None, "stop", DRIFT),
        (("linear", 300.0), second, 77.0, "stop", MODE),
    ]  # fmt: skip
    assert [one.bic for one in tried.kept] == [90.0, 95.0, 80.0, 79.0]


@pytest.mark.parametrize(("bic", "predicts", "taken"), [(98.9, True, True), (99.1, True, False), (98.9, False, False)])
def test_a_look_alike_takes_the_place_where_it_is_likelier_and_predicts(
    bic: float, predicts: bool, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = Tried(monkeypatch, {TILT: [MODE]}, {}, {MODE: bic})  # without friction nothing can be fitted
    best, at, far = tried.tried(predicts=predicts)
    assert (best is not tried.best) is taken
    if not taken:
        assert at == "at" and list(far) == [FRICTION, TILT] and far[TILT] == ("at", TILT, "catalogue", "stop")


@pytest.mark.parametrize(
    ("alone", "wander", "bic", "taken"),
    [(True, (), 119.9, True), (True, (), 120.1, False), (True, "some", 119.9, False), (False, (), 119.9, False)],
)
def test_a_fit_whose_noise_wanders_only_in_contact_is_repeated_from_white_noise(
    alone: bool, wander: Any, bic: float, taken: bool
) -> None:
    again = SimpleNamespace(bic=bic)
    best: Any = SimpleNamespace(noise=SimpleNamespace(wander=wander))
    one: Any = SimpleNamespace(
        wanders_only_in_contact=alone, bic=120.0, from_white=lambda *, evaluations, cancelled: again
    )
    assert module._without_wander(best, one, lambda: False) is (again if taken else one)


def test_only_a_simpler_look_alike_is_searched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, damping, lag = effects_named(("viscoelastic_arm", "plate_damping", "demodulation_lag"))
    tried = Tried(monkeypatch, {arm: [damping, lag]}, {damping: 99.5, lag: 99.6}, {})
    tried.best = fit_of(100.0, arm)
    tried.best.point = SimpleNamespace(values=[{arm: {"stiffness_n_per_m": 1.0}}])
    monkeypatch.setattr(module, "_without_wander", lambda best, one, stop: Tried.fit(one.bic - 50.0, *one.effects))
    best, _, _ = tried.tried()
    assert best.effects == (damping,) and [one.bic for one in tried.kept] == [49.5, 99.6, 48.5]


def test_in_the_place_of_an_effect_another_begins_where_it_imitates_it_best(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    ends: dict[Any, Any] = {}

    class Problem:
        def __init__(self, noise: Any = None) -> None:
            self.noise = noise

        def with_noise(self, noise: Any) -> "Problem":
            return Problem(noise)

        def fit(self, z: Any, *, evaluations: int, cancelled: Any) -> Any:
            return z, evaluations, cancelled, self.noise

    def refitted(at: Any, kind: Any, start: Any, stop: Any, *, least_bic: float) -> Any:
        asked.append((at, kind, start, stop, least_bic))
        bic = ends.get(start[0].get("frequency_hz"))
        return None if bic is None else SimpleNamespace(bic=bic, z=("z", bic), problem=Problem())

    monkeypatch.setattr(module, "refit", refitted)
    drag, mode = KINDS["viscous_drag"], KINDS["block_mode"]
    line = {"mass_kg": 1e-5, "frequency_hz": 990.0, "damping_ratio": 0.01}
    far = Separation(9.0, {}, {DRAG: ({"coefficient_n_s_per_m": 3.0},), MODE: (line,)})
    best: Any = SimpleNamespace(bic=100.0, noise=SimpleNamespace(site=()))
    at: Any = SimpleNamespace(scores=lambda kind: [SimpleNamespace(start=(line | {"frequency_hz": 1010.0},))])

    def instead(kind: Any, frequency_hz: float | None = None, stop: Any = calm) -> Any:
        asked.clear()
        return module.fitted_instead(best, at, far, frequency_hz, stop, kind)

    ends[None] = 249.9
    assert instead(drag) == (("z", 249.9), 16, calm, None)
    assert asked == [(at, drag, far.starts[DRAG], calm, 100.0)]
    assert instead(drag, 1000.0) is not None and len(asked) == 1  # no line: its frequency is none of its own
    ends[None] = 250.1
    assert instead(drag).bic == 250.1  # hopeless: left as it is
    ends.clear()
    assert instead(drag) is None
    ends[1010.0], ends[1000.0] = 120.0, 110.0
    assert instead(mode, 1000.0)[0] == ("z", 110.0)  # the likelier of two places to begin
    assert [one[2][0]["frequency_hz"] for one in asked] == [1010.0, 1000.0]
    assert instead(mode) is None and [one[2] for one in asked] == [(line,)]
    best.noise = SimpleNamespace(site=(1.0,))  # a building's noise keeps its shape
    assert instead(mode, 1000.0)[3] is best.noise
    with pytest.raises(Cancelled):
        instead(drag, None, lambda: True)
    # a time or a range may have several maxima: also where it scores best
    adhesion, imitation = KINDS["adhesion"], {"force_n": 1e-6, "range_m": 1e-5}
    scored = [({"force_n": 1e-6, "range_m": range_m},) for range_m in (1e-4, 3e-5, 3e-6)]
    at.scores = lambda kind: [Score(kind, start, 50.0 - place, 2) for place, start in enumerate(scored)]
    far.starts[adhesion.effect] = (imitation,)
    assert instead(adhesion) is None and [one[2] for one in asked] == [(imitation,), *scored[:2]]

"""How far rivals stay off after shots not yet taken, over sums of squares whose least is known."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.collision import Infeasible
from analysis.collision.effects import effects_named
from analysis.collision.effects.row import Effect
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.planning import distances as planned
from analysis.planning.distances import Distances, Pair, nearest
from analysis.planning.next_shot import NextShot
from analysis.planning.predictions import Information
from analysis.shot import Cancelled

SLOW, FAST = (NextShot(speed, 0.0, 0.012, 0.03) for speed in (0.2, 0.4))
PAIR: Pair = (0, 1)
AT_HAND, EACH = 40, 25


def _squares(seed: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what a rival with two parameters leaves of so many samples, and its columns."""
    random = np.random.default_rng(seed)
    return random.normal(0.0, 3.0, samples), random.normal(0.0, 1.0, (samples, 2))


def _informs(left: np.ndarray, columns: np.ndarray, coincidence: float = 0.0) -> Information:
    return Information(columns.T @ columns, columns.T @ left, float(left @ left), coincidence)


def _least(*parts: tuple[np.ndarray, np.ndarray]) -> float:
    """Return the least sum of squares over all parts together, solved as one."""
    left, columns = (np.concatenate(which) for which in zip(*parts, strict=True))
    return float(np.sum((left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]) ** 2))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31), own=st.floats(0.0, 30.0), shots=st.lists(st.sampled_from((SLOW, FAST)), max_size=4))
def test_a_rivals_distance_is_what_all_shots_together_leave_it_beyond_the_members_own(
    seed: int, own: float, shots: list[NextShot]
) -> None:
    known, slow, fast = (_squares(seed + k, size) for k, size in enumerate((AT_HAND, EACH, EACH)))
    says = {SLOW: {PAIR: _informs(*slow, 2.0)}, FAST: {PAIR: _informs(*fast, 5.0)}}
    distances = Distances({PAIR: _informs(*known, 1.0)}, says, {0: own, 1: 1e6})
    taken = [slow if shot is SLOW else fast for shot in shots]
    coincidence = 1.0 + sum(2.0 if shot is SLOW else 5.0 for shot in shots)
    expected = math.sqrt(max(0.0, _least(known, *taken) + coincidence - own))
    assert distances.pair_distances(tuple(shots))[PAIR] == pytest.approx(expected, rel=1e-8)
    assert distances.penalty(PAIR, tuple(shots)) == pytest.approx(coincidence)


def test_no_rival_is_nearer_than_nothing() -> None:
    known = _squares(1, AT_HAND)
    distances = Distances({PAIR: _informs(*known)}, {}, {0: _least(known) + 10.0})
    assert distances.pair_distances(()) == {PAIR: 0.0}


@pytest.mark.parametrize("order", [(5.0, 2.0, 9.0), (9.0, 5.0, 2.0), (2.0, 9.0, 5.0)])
def test_the_nearest_rival_counts_whichever_comes_first(order: tuple[float, ...]) -> None:
    of_first = {(0, rival): value for rival, value in enumerate(order, 1)}
    assert nearest(of_first | {(1, 0): 7.0}) == {0: 2.0, 1: 7.0}
    assert nearest({}) == {}


@pytest.mark.parametrize(("before", "searched"), [(0.9, False), (1.1, True)])
def test_rivals_with_a_grid_are_searched_anew_where_all_seemed_far_enough(
    before: float, searched: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[Effect]] = []

    def rivals(_fitted: Any, _member: Effect, others: list[Effect], *_: Any) -> list[SimpleNamespace]:
        asked.append(others)
        return [SimpleNamespace(effect=effect, chi2=20.0) for effect in others]

    for name in ("blank_shot", "predict", "fit_as_if_taken"):
        monkeypatch.setattr(planned, name, lambda *_: None)
    monkeypatch.setattr(planned, "rivals", rivals)
    effects = effects_named(("viscous_drag", "tilt", "block_mode"))  # the last alone has a grid to be searched
    members = [SimpleNamespace(effect=effect, fitted=None) for effect in effects]
    comparison = cast(Any, SimpleNamespace(members=members, floor=None))
    known = {(0, 1): before * CRITERIA.separation, (0, 2): 9.0 * CRITERIA.separation}
    distances = Distances({}, {}, {0: 4.0})
    found = planned.search_rivals_again(comparison, (SLOW,), known, distances, lambda: False)
    assert asked == ([[effects[2]]] if searched else [])
    assert found == (known | {(0, 2): 4.0} if searched else known)


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Let fits be their names, and what they predict the name of the shot."""
    monkeypatch.setattr(planned, "side_by_side", lambda of, some: [of(one) for one in some])
    monkeypatch.setattr(planned, "blank_shot", lambda shot, fitted: shot)
    monkeypatch.setattr(planned, "predict", lambda fitted, shot: (fitted, shot))
    return monkeypatch


def compared(*misfits: float, likely: int | None = None) -> Any:
    """Return a comparison of members with these misfits, fits "0", "1", ... and effects of their own."""
    effects = effects_named(("viscous_drag", "tilt", "block_mode", "plate_motion"))
    members = [
        SimpleNamespace(effect=effects[k], fitted=str(k), misfit=misfit, penalty=float(k))
        for k, misfit in enumerate(misfits)
    ]
    return SimpleNamespace(
        members=members, floor="floor", likely=members[:likely], has_penalty=lambda effect: effect.own
    )


def test_rivals_are_fitted_again_but_for_those_three_times_as_far_as_the_nearest(plain: pytest.MonkeyPatch) -> None:
    def of(distance: float) -> Information:
        return Information(np.eye(1), np.zeros(1), distance**2, 0.0)

    asked: list[Any] = []

    def again(rival: str, shown: Any, floor: str, stop: Any) -> float:
        assert floor == "floor" and [one[1] for one in shown] == [SLOW, FAST]
        asked.append((rival, shown[0][0]))
        if rival == "2":
            raise Infeasible("no motion")
        return 30.0 if rival == "3" else 1.0

    plain.setattr(planned, "refitted_chi2", again)
    nothing = {shot: dict.fromkeys([(0, 1), (0, 2), (0, 3), (1, 0)], of(0.0)) for shot in (SLOW, FAST)}
    nothing[FAST] = nothing[FAST] | {(0, 3): Information(np.eye(1), np.zeros(1), 0.0, 7.0)}
    present = {(0, 1): of(10.0), (0, 2): of(2.9), (0, 3): of(2.0), (1, 0): of(90.0)}
    distances = Distances(present, nothing, {0: 0.0, 1: 0.5})
    found = planned.refitted(compared(0.0, 0.0, 0.0, 0.0), (SLOW, FAST), distances, lambda: False)
    # the last pays seven for its own values
    assert distances.pair_distances((SLOW, FAST))[0, 3] == pytest.approx(math.sqrt(11.0))
    assert found[0, 1] == 10.0 and found[0, 2] == math.inf
    assert found[0, 3] == pytest.approx(math.sqrt(30.0 + 7.0)) and found[1, 0] == pytest.approx(math.sqrt(0.5))
    assert asked == [("2", "0"), ("3", "0"), ("0", "1")]
    with pytest.raises(Cancelled):
        planned.refitted(compared(0.0, 0.0, 0.0, 0.0), (SLOW, FAST), distances, lambda: True)


def test_every_shot_is_screened_for_every_true_member_and_rival(plain: pytest.MonkeyPatch) -> None:
    def information(rival: str, shown: Any, floor: str) -> Information:
        true, shot = shown
        if shot is LOST:
            raise Infeasible("no motion")
        return Information(np.eye(1), np.zeros(1), 100.0 * int(rival) + 10.0 * int(true) + shot.speed_m_per_s)

    LOST = NextShot(0.9, 0.0, 0.012, 0.03)
    plain.setattr(planned, "information_of", information)
    plain.setattr(
        planned, "present_information", lambda fitted, floor: Information(np.eye(1), np.zeros(1), int(fitted))
    )
    plain.setattr(planned, "per_shot_cost", lambda fitted, effect: SimpleNamespace(prior_width=f"of {fitted}"))
    plain.setattr(
        planned,
        "shot_penalty",
        lambda fitted, effect, scatter, shown, floor: 0.5 if scatter == f"of {fitted}" else 99.0,
    )
    told: list[float] = []
    comparison = compared(1.0, 2.0, 3.0, 4.0, likely=2)
    found = planned.screen_shots(comparison, [SLOW, LOST, FAST], told.append, lambda: False)
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0]) and list(found.each) == [SLOW, FAST]
    pairs = [(a, b) for a in (0, 1) for b in range(4) if a != b]
    assert list(found.present_information) == pairs and found.members == (0, 1) and found.own_misfit == {0: 1.0, 1: 2.0}
    for a, b in pairs:
        known = found.present_information[a, b]
        assert (known.chi2, known.penalty) == (b, float(b))
        for shot in (SLOW, FAST):
            one = found.each[shot][a, b]
            # the last member alone has values of its own in every shot
            assert (one.chi2, one.penalty) == (100.0 * b + 10.0 * a + shot.speed_m_per_s, 0.5 if b == 3 else 0.0)
    assert found.without([(0, 1), (0, 2), (0, 3)]).members == (1,)
    with pytest.raises(Cancelled):
        planned.screen_shots(comparison, [SLOW], told.append, lambda: True)

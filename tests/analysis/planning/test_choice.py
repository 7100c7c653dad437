"""Which sequence of shots a plan chooses, and what it says of it, over distances that are given."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.planning import plan as planning
from analysis.planning import shot_log
from analysis.planning.distances import Distances, nearest
from analysis.planning.next_shot import NextShot
from analysis.planning.plan import SURE, Plan, _best, _chosen, _inseparable_from, _ranked, _separable, _worth
from analysis.planning.predictions import Information
from analysis.planning.shot_log import PlannedStep, PlanningState, next_step, plan_next
from tests.analysis.shots import shots_of

FAR = CRITERIA.separation
A, B, C, D = (NextShot(speed, added, 0.01, 0.02) for speed, added in ((0.1, 0.0), (0.2, 0.0), (0.3, 0.0), (0.3, 0.05)))
DRAG, TILT, MODE, FRICTION = effects_named(("viscous_drag", "tilt", "block_mode", "coulomb_friction"))


def squared(value: float) -> Information:
    """Return the information of a shot that adds so much of chi^2, and nothing on the parameters."""
    return Information(np.eye(1), np.zeros(1), value)


def distances(each: dict[NextShot, dict[tuple[int, int], float]], now: float = 0.0) -> Distances:
    pairs = {pair for values in each.values() for pair in values}
    of = {shot: {pair: squared(value**2) for pair, value in values.items()} for shot, values in each.items()}
    return Distances(dict.fromkeys(sorted(pairs), squared(now)), of, dict.fromkeys({a for a, _ in pairs}, 0.0))


def test_a_sequence_is_worth_its_worst_member_of_those_that_any_can_separate() -> None:
    found = {(A,): {0: FAR, 1: 3.0, 2: 1.0}, (B,): {0: 4.0, 1: FAR + 1, 2: FAR - 0.01}}
    assert _worth(found, found[A,]) == 3.0 and _worth(found, found[B,]) == 4.0
    assert _worth({(A,): {0: 1.0, 1: 4.9}}, {0: 1.0, 1: 4.9}) == 4.9  # where none can, its best


def test_the_cheapest_sure_sequence_is_chosen_else_the_best_that_separates() -> None:
    sure = FAR + SURE
    assert _best({(A,): {0: sure - 0.01}, (A, B): {0: sure}, (A, A, B): {0: 99.0}}, 0.0) == (A, B)
    assert _best({(A,): {0: sure}, (B,): {0: sure + 1.0}, (D,): {0: 99.0}}, 0.0) == (B,)
    assert _best({(A,): {0: sure}, (D,): {0: sure + 1.0}}, 0.05) == (D,)  # whose weights are on the block
    assert _best({(A,): {0: FAR}, (A, B): {0: sure - 0.01}, (B,): {0: FAR - 0.01}}, 0.0) == (A, B)
    assert _best({(A,): {0: FAR - 0.01}}, 0.0) is None and _best({}, 0.0) is None


def test_sequences_are_ranked_by_effort_where_they_are_sure_and_by_worth_where_not() -> None:
    pair = (0, 1)
    of = distances({A: {pair: 3.0}, B: {pair: FAR + SURE + 0.1}, C: {pair: 6.0}, D: {pair: 90.0}})
    assert _ranked(of, 1, 0.0) == [(B,), (D,), (C,), (A,)]
    assert _ranked(of, 1, 0.05) == [(D,), (B,), (C,), (A,)]
    two = _ranked(of, 2, 0.0)
    assert [sorted(one, key=repr) for one in two[:6]] == [[B, B], [B, C], [C, C], [A, B], [A, C], [D, D]]
    assert len(two) == 10 and two[6] == (B, D) and two[-1] == (A, A)  # weights are put on once, before the last
    assert _ranked(of, 2, 0.05)[:2] == [(D, D), (D, B)]
    # of many shots those that do well for some member: eight shared among the members, and one more for each
    many = [NextShot(0.01 * k, 0.0, 0.01, 0.02) for k in range(1, 30)]
    of_two = distances({s: {(0, 2): s.speed_m_per_s, (1, 2): 1.0 - s.speed_m_per_s} for s in many})
    assert {one for pair_of in _ranked(of_two, 2, 0.0) for one in pair_of} == {*many[:5], *many[-5:]}
    assert len(_ranked(of_two, 1, 0.0)) == 29


def chosen(of: Distances, most: int, monkeypatch: pytest.MonkeyPatch, factor: float = 1.0, again: float = 1.0) -> Any:
    """Return the choice where refitting multiplies every first-order distance, and the rivals' grids do once more."""
    tried: list[tuple[NextShot, ...]] = []

    def refitted(_comparison: Any, shots: Any, pairs: Distances, _stop: Any) -> Any:
        tried.append(shots)
        return {pair: factor * value for pair, value in pairs.pair_distances(shots).items()}

    monkeypatch.setattr(planning, "refitted", refitted)
    monkeypatch.setattr(
        planning, "search_rivals_again", lambda _c, _s, known, *_: {pair: again * d for pair, d in known.items()}
    )
    told: list[float] = []
    none: Any = None
    sequence, found = _chosen(none, of, most, 0.0, told.append, lambda: False)
    return sequence, found, tried, told


def test_one_shot_that_is_sure_is_enough_and_no_other_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    of = distances({A: {(0, 1): 7.0}, B: {(0, 1): 30.0}})
    assert chosen(of, 3, monkeypatch) == ((B,), {(B,): {(0, 1): 30.0}}, [(B,)], [0.0])


def test_more_shots_are_tried_until_they_are_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    of = distances({A: {(0, 1): 4.5}})
    sequence, found, tried, told = chosen(of, 3, monkeypatch)
    assert sequence == (A, A, A) and tried == [(A,), (A, A), (A, A, A)] and told == pytest.approx([0.0, 1 / 3, 2 / 3])
    assert found[sequence][0, 1] == pytest.approx(4.5 * math.sqrt(3))
    # with two at most they separate, but not surely; and a refit that finds the rivals nearer leaves none
    assert chosen(of, 2, monkeypatch)[0] == (A, A)
    assert chosen(of, 2, monkeypatch, factor=0.7)[0] is None
    assert chosen(of, 3, monkeypatch, again=0.5)[0] is None
    # what is not promising to first order is not refitted, but for one sequence of the longest
    assert chosen(distances({A: {(0, 1): 1.0}}), 2, monkeypatch)[2] == [(A, A)]


def test_three_sequences_of_a_length_are_refitted(monkeypatch: pytest.MonkeyPatch) -> None:
    of = distances({shot: {(0, 1): value} for shot, value in ((A, 5.4), (B, 5.3), (C, 5.2), (D, 5.1))})
    assert chosen(of, 1, monkeypatch)[2] == [(A,), (B,), (C,)]


def test_pairs_that_no_sequence_separates_are_set_aside_until_one_separates_all_others() -> None:
    of = distances({A: {(0, 1): 9.0, (0, 2): 4.5, (1, 0): 9.0, (2, 0): 0.1}})
    asked: list[set[tuple[int, int]]] = []

    def choose(left: Distances) -> Any:
        pairs = set(left.present_information)
        asked.append(pairs)
        reached = {pair: {(0, 1): 9.0, (0, 2): 4.5, (1, 0): 9.0, (2, 0): 0.1}[pair] for pair in pairs}
        return ((A,) if min(reached.values()) >= FAR else None), {(A,): reached}

    left, never, sequence, found = _separable(of, 1, choose)
    assert asked == [{(0, 1), (0, 2), (1, 0)}, {(0, 1), (1, 0)}]  # first what is hopeless to first order
    assert never == {(0, 2), (2, 0)} and sequence == (A,) and set(found[A,]) == set(left.present_information)
    # where no pair is ever separated all are tried together, once
    none = distances({A: {(0, 1): 0.1, (1, 0): 0.1}})
    asked.clear()
    left, never, sequence, _ = _separable(none, 1, lambda pairs: (asked.append(set(pairs.members)), (None, {}))[1])  # type: ignore[func-returns-value, arg-type]
    assert (left is none, never, sequence, len(asked)) == (True, {(0, 1), (1, 0)}, None, 1)
    effects = (DRAG, TILT, MODE)
    assert _inseparable_from(effects, {(0, 2), (0, 1), (2, 0)}) == {DRAG: (TILT, MODE), MODE: (DRAG,)}


def test_pairs_out_of_reach_to_first_order_are_those_that_no_sequence_of_so_many_separates() -> None:
    of = distances({A: {(0, 1): 2.4, (1, 0): 0.1}, B: {(0, 1): 0.1, (1, 0): 2.2}})
    # of three shots 2.4 sqrt 3 = 4.2 and 2.2 sqrt 3 = 3.8; four fifths of five are promising
    assert of.inseparable_pairs(3) == {(1, 0)} and of.inseparable_pairs(2) == {(0, 1), (1, 0)}
    assert of.inseparable_pairs(4) == frozenset()


def of_plan(**changes: Any) -> Plan:
    made = Plan((A,), (DRAG, TILT, MODE), 1.234, {DRAG: 8.0, TILT: 6.66}, {DRAG: 8.0, TILT: 6.66}, 8.0, ())
    return replace(made, **changes)


def test_a_plan_in_words_and_in_a_file() -> None:
    drag, tilt, mode = (effect.short_words for effect in (DRAG, TILT, MODE))
    plain = of_plan()
    assert (
        plain.words == f"One shot at 0.1 m/s would tell {drag}, {tilt} and {mode} apart by 6.7 noise norms (now 1.2)."
    )
    assert of_plan(members=(DRAG,)).words.startswith(f"One shot at 0.1 m/s would tell {drag} apart")
    open_one = of_plan(inseparable=(TILT,))
    assert open_one.separation == 8.0
    assert open_one.words.endswith(f"apart by 8 noise norms (now 1.2); were it {tilt}, no shot would.")
    ones = of_plan(inseparable_from={DRAG: (MODE,), MODE: (DRAG,)})
    assert ones.words.endswith(f"(now 1.2); {drag} and {mode} stay one.")
    none = of_plan(shots=(), best=3.456)
    assert not none.settles and plain.settles
    assert none.words == (
        f"No shot of this rig tells {drag}, {tilt} and {mode} apart: the best would reach 3.5 noise norms."
    )
    assert of_plan(inseparable=(DRAG, TILT)).separation == 8.0 and of_plan(expected={}).separation == 0.0
    assert ones.to_json() == {
        "shots": [A.to_json()], "between": ["viscous_drag", "tilt", "block_mode"],
        "expected_if": {"viscous_drag": 8.0, "tilt": 6.66}, "best_separation": 8.0, "inseparable": [],
        "one_with": {"viscous_drag": ["block_mode"], "block_mode": ["viscous_drag"]}, "words": ones.words,
    }  # fmt: skip


@pytest.mark.parametrize("shots", [1, 2])
def test_a_plan_of_given_distances(shots: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The member 1 is separated from 0 alone; 2 is no member that may be true."""
    value = 9.0 if shots == 1 else 5.0
    of = distances({A: {(0, 1): value, (0, 2): value + 1, (1, 0): value + 2, (1, 2): 0.1}})
    fitted = SimpleNamespace(problem=SimpleNamespace(data=SimpleNamespace(shots=[SimpleNamespace(moving_mass_kg=1.0)])))
    members = [SimpleNamespace(effect=effect, fitted=fitted) for effect in (DRAG, TILT, MODE)]
    excluded: list[Any] = []
    comparison: Any = SimpleNamespace(members=members, separation_from=lambda out: excluded.append(out) or 1.5)
    monkeypatch.setattr(planning, "screen_shots", lambda *_: of)
    monkeypatch.setattr(planning, "next_shots", lambda *_: [A])
    monkeypatch.setattr(planning, "refitted", lambda _c, sequence, pairs, _s: pairs.pair_distances(sequence))
    monkeypatch.setattr(planning, "search_rivals_again", lambda _c, _s, known, *_: known)
    found = planning.plan(comparison, most=3)
    root = math.sqrt(shots)
    assert found == Plan(
        shots=(A,) * shots,
        members=(DRAG, TILT, MODE),
        now=1.5,
        expected={DRAG: pytest.approx(root * value), TILT: pytest.approx(root * (value + 2))},
        after_first={DRAG: pytest.approx(value), TILT: pytest.approx(value + 2)},
        best=pytest.approx(root * (value + 2)),
        inseparable=(),
        inseparable_from={TILT: (MODE,)},
    )
    assert excluded == [()]
    nowhere = distances({A: {(0, 1): 0.3, (1, 0): 0.2}})
    monkeypatch.setattr(planning, "screen_shots", lambda *_: nowhere)
    none = planning.plan(comparison, most=2)
    far = {DRAG: pytest.approx(0.3 * math.sqrt(2)), TILT: pytest.approx(0.2 * math.sqrt(2))}
    assert none == Plan((), (DRAG, TILT, MODE), 1.5, far, far, pytest.approx(0.3 * math.sqrt(2)), (DRAG, TILT), {})
    assert nearest({(0, 1): 2.0, (0, 2): 1.0}) == {0: 1.0}


def test_the_separation_expected_of_a_step_is_that_of_the_leader() -> None:
    step = PlannedStep(A, (DRAG, TILT, MODE), {DRAG: 6.0, TILT: 8.0})
    assert step.expected_separation == 6.0 and replace(step, leader=TILT).expected_separation == 8.0
    assert replace(step, leader=MODE).expected_separation == 6.0
    assert step.excluded(MODE) == [MODE] and step.excluded(TILT) == ()
    assert replace(step, inseparable_from={TILT: (DRAG,)}).excluded(TILT) == (DRAG,)
    assert replace(step, reached=7.5, leader=TILT).to_json() == {
        "shot": A.to_json(), "between": ["viscous_drag", "tilt", "block_mode"], "expected_separation": 8.0,
        "expected_if": {"viscous_drag": 6.0, "tilt": 8.0}, "reached_separation": 7.5,
    }  # fmt: skip
    planned = of_plan(shots=(B, A), after_first={DRAG: 4.0}, inseparable_from={TILT: (MODE,)})
    first = next_step(PlanningState(planned))
    assert first == PlannedStep(B, planned.members, {DRAG: 4.0}, None, None, {TILT: (MODE,)})
    assert [PlanningState(one).settled for one in (None, of_plan(shots=()), planned)] == [True, True, False]


@pytest.mark.parametrize("still", [True, False])
@pytest.mark.parametrize("left", [0, 2])
def test_a_step_that_was_taken_is_held_against_its_members_and_the_rest_is_planned(
    still: bool, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``still``: the diagnosis names the same effects as before."""
    compared: list[tuple[Any, ...]] = []
    most: list[int] = []

    def compare(fit: Any, members: Any, motions: Any, _stop: Any) -> Any:
        compared.append((fit, tuple(members), motions))
        leader = SimpleNamespace(effect=TILT)
        return SimpleNamespace(members=[leader], separation_from=lambda out: 7.0 + len(out))

    def further(_comparison: Any, _reach: Any, **options: Any) -> Plan:
        most.append(options["most"])
        return of_plan()

    monkeypatch.setattr("analysis.planning.model_comparison.compare_models", compare)
    monkeypatch.setattr("analysis.planning.plan.plan", further)
    monkeypatch.setattr(shot_log, "first_indistinguishable", lambda _: (TILT, DRAG) if still else (TILT, MODE))
    diagnosis: Any = SimpleNamespace(fit_after="fit")
    older = PlannedStep(B, (DRAG, MODE), {DRAG: 5.0}, 1.0, DRAG)
    taken = PlannedStep(A, (DRAG, TILT), {DRAG: 6.0, TILT: 8.0}, inseparable_from={TILT: (MODE,)})
    motions: Any = ["motion"]
    shots = shots_of(motions)
    state = plan_next(shots, diagnosis, (older, taken), left=left)
    assert state == PlanningState(of_plan(), (older, replace(taken, reached=8.0, leader=TILT)))
    assert compared == [("fit", (DRAG, TILT), motions), *([] if still else [("fit", (TILT, MODE), motions)])]
    assert most == [left or 3]
    compared.clear()
    assert plan_next(shots, diagnosis) == PlanningState(of_plan()) and len(compared) == 1

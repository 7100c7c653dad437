"""From where a search for the base model begins, and which of several ends is taken, over searches that are given."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.parameters import PAPER
from analysis.inference.fit import first_fit as module
from analysis.inference.fit.first_fit import first_fit, likeliest_plates
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import PLATES_RELIABLE_CHI2, SearchStart, base_named
from analysis.inference.model.samples import averaged_shot
from analysis.inference.noise.floor import white_floor
from analysis.inference.noise.site import STILL_FRAME
from analysis.shot import AnalysisError, Cancelled
from tests.analysis.collision.simulated import shot
from tests.analysis.diagnosis.shots import calm

BASE = base_named("paper")
FLOOR = replace(white_floor(1e-10, 5e-5), site=(0.0,))


def start(number: float, left: float = np.inf) -> SearchStart:
    return SearchStart(BASE, np.full(4, number), np.zeros((1, 3)), (), left)


@pytest.mark.parametrize(
    ("ends", "early", "tried", "best"),
    [
        ([29.0, 1.0], 1.0, [1], 1.0),  # near enough at once
        ([31.0, 1.0], 29.0, [1, -1, 9], 9.0),  # the first bounces lead there
        ([31.0, 32.0, 40.0, 1.0], 31.0, [1, -1, 2, 3], 1.0),  # they do not: the next two, and the best of all
        ([31.0, 29.0, 1.0], 31.0, [1, -1, 2], 2.0),
        ([31.0, None, 28.0], 31.0, [1, -1, 2, 3], 3.0),
        ([31.0, 29.0], None, [1, -1, 2], 2.0),
    ],
)
def test_of_several_searches_the_best_counts_and_one_that_is_near_enough_ends_them(
    monkeypatch: pytest.MonkeyPatch, ends: list[float | None], early: float | None, tried: list[int], best: float
) -> None:
    whole = JointData((averaged_shot(shot(PAPER)),), BASE)
    asked: list[float] = []

    def search(data: JointData, one: SearchStart, floor: Any, _stop: Any, evaluations: int = 60) -> SearchStart:
        assert floor.site == ()
        number = float(one.shared[0])
        if data is whole:
            asked.append(number)
            left = 0.5 if number == 9.0 else ends[int(number) - 1]
        else:  # of the first bounces alone, roughly
            assert number == 1.0 and evaluations == 30
            asked.append(-number)
            left, number = early, 9.0
        if left is None:
            raise Infeasible("none")
        return start(number, left)

    monkeypatch.setattr(module, "_search_from", search)
    found = module._best_of_searches(whole, [start(k) for k in range(1, len(ends) + 1)], FLOOR, calm)
    assert asked == tried and found.shared[0] == best


@pytest.mark.parametrize(
    ("share", "left", "same"), [(1.029, 10.09, True), (0.971, 9.91, True), (1.031, 10.0, False), (1.0, 10.11, False)]
)
def test_two_ends_are_one_where_chi2_and_every_parameter_are(share: float, left: float, same: bool) -> None:
    moved = start(2.0, left)
    moved.shared[2] *= share
    assert module._same_minimum(moved, start(2.0, 10.0)) is same


def test_the_first_bounces_end_at_three_tenths_of_the_contact() -> None:
    whole = averaged_shot(shot(PAPER))
    course = whole.course
    early = module._first_bounces(whole)
    until = course.touch_time_s + 0.3 * course.contact_time_s
    np.testing.assert_array_equal(early.valid, whole.valid & (whole.centre_s < until))
    assert early.valid.any() and early.valid.sum() < whole.valid.sum()


def test_a_plate_is_likely_where_a_frame_moves() -> None:
    def plate(rest: np.ndarray, noise: Any) -> tuple[float, float]:
        assert noise.site == (1.0,)
        return float(rest.sum()), 2.0

    shots = [SimpleNamespace(sway=SimpleNamespace(likeliest_plate=plate))] * 2
    problem: Any = SimpleNamespace(
        noise=SimpleNamespace(site=(1.0,)), data=SimpleNamespace(shots=shots),
        residual_m=lambda z: [z, 3.0 * z],
    )  # fmt: skip
    assert likeliest_plates(problem, np.array([1.0, 2.0])) == ((3.0, 2.0), (9.0, 2.0))
    problem.noise.site = ()
    assert likeliest_plates(problem, np.array([1.0])) == ()


def searched(
    monkeypatch: pytest.MonkeyPatch, lefts: list[float | None], still: float | None, *, moves: bool = True
) -> tuple[SearchStart, list[float]]:
    """Return the first fit where searches from rough ends 1, 2, ... end with these chi^2 per sample, and what it tried.

    A search without the frame ends at 9 with ``still``, from where one with it ends with a tenth of that.
    """
    asked: list[float] = []
    motion = shot(PAPER)
    site: Any = SimpleNamespace(moves=moves, vibration=SimpleNamespace(rms_m=3e-9 if moves else 0.0))

    def guesses(base: Any, shots: Any, stop: Any, sways_m: float = 0.0) -> list[np.ndarray]:
        assert sways_m == (3e-9 if moves else 0.0)
        return [np.full(4, 50.0)]

    def rough(_data: Any, starts: Any, _noise: Any, _stop: Any) -> Any:
        begun = [float(one.shared[0]) for one in starts]
        assert begun in ([40.0, 50.0], [9.0])
        yield from [start(9.0)] if begun == [9.0] else [start(k) for k in range(1, len(lefts) + 1)]

    def on_frame(_data: Any, one: SearchStart, _noise: Any, _stop: Any) -> SearchStart:
        number = float(one.shared[0])
        asked.append(number)
        left = lefts[int(number) - 1] if number < 9.0 else still
        if left is None:
            raise Infeasible("nothing moves so")
        return start(number, left if number < 9.0 else 0.1 * left)

    def best(data: JointData, starts: list[SearchStart], _noise: Any, _stop: Any) -> SearchStart:
        assert data.site.moves is False and [one.shared[0] for one in starts] == [50.0]
        assert starts[0].own.tolist() == [averaged_shot(motion).course.own.tolist()]
        asked.append(-9.0)
        if still is None:
            raise Infeasible("nothing moves so")
        return start(9.0, still)

    monkeypatch.setattr(module, "resembling_candidates", lambda base, shots, most: [np.full(4, 40.0)])
    monkeypatch.setattr(module, "first_guesses", guesses)
    monkeypatch.setattr(module, "_noisy_search_ends", rough)
    monkeypatch.setattr(module, "_search_on_frame", on_frame)
    monkeypatch.setattr(module, "_best_of_searches", best)
    return first_fit((averaged_shot(motion),), "paper", site, calm, noise=FLOOR), asked


@pytest.mark.parametrize(
    ("lefts", "still", "tried", "best"),
    [
        ([5.0, PLATES_RELIABLE_CHI2 - 0.1, 0.5], 1.0, [1, 2], 2.0),  # one that is believed ends the search
        ([5.0, 4.0, 2.0], 1.0, [1, 2, 3], 3.0),
        ([31.0, 29.0], 1.0, [1, 2], 2.0),
        ([31.0, 32.0], 400.0, [1, 2, -9, 9], 1.0),  # all far off: a search without the frame, and on from there
        ([31.0, 32.0], 50.0, [1, 2, -9, 9], 9.0),
        ([None, 31.0], 20.0, [1, 2, -9, 9], 9.0),
        ([None, None], 20.0, [1, 2, -9, 9], 9.0),
    ],
)
def test_on_a_moving_frame_searches_go_on_until_one_is_believed(
    monkeypatch: pytest.MonkeyPatch, lefts: list[float | None], still: float, tried: list[int], best: float
) -> None:
    found, asked = searched(monkeypatch, lefts, still)
    assert asked == tried and found.shared[0] == best


def test_two_searches_that_end_at_one_place_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_same_minimum", lambda one, other: (one.shared[0], other.shared[0]) == (3.0, 1.0))
    found, asked = searched(monkeypatch, [31.0, 32.0, 31.1, 0.1], 1.0)
    assert asked == [1, 2, 3] and found.shared[0] == 1.0


def test_without_a_frame_the_guesses_are_searched_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = searched(monkeypatch, [], 77.0, moves=False)
    assert asked == [-9.0] and found.left == 77.0


@pytest.mark.parametrize("moves", [True, False])
def test_where_nothing_moves_so_it_is_said(monkeypatch: pytest.MonkeyPatch, moves: bool) -> None:
    with pytest.raises(AnalysisError, match="no motion of the paper model comes near these shots: nothing moves so"):
        searched(monkeypatch, [None], None, moves=moves)
    monkeypatch.setattr(module, "_best_of_searches", lambda *_: pytest.fail("cancelled"))
    monkeypatch.setattr(module, "first_guesses", lambda *_: (_ for _ in ()).throw(Infeasible("late")))
    with pytest.raises(Cancelled):
        first_fit((averaged_shot(shot(PAPER)),), "paper", STILL_FRAME, lambda: True, noise=FLOOR)

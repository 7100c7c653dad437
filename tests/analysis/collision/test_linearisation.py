"""The instants on which a path is solved, and the order of its steps."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.solver.linearisation import RANGE, TURN, _cut_at_events, _guard_of, _write_instants
from analysis.collision.solver.modes import (
    CONTACT,
    FORCE,
    FREE,
    NEAR_0,
    OVERLAP,
    OVERLAP_RATE,
    OVERLAPPED,
    PARTING,
    PHASE,
    RANGE_0,
    VELOCITY,
)


def test_steps_before_the_start_run_backwards_and_their_instants_forwards() -> None:
    """Two steps lead from the start at 0 back to -3, two lead on to 5, of two, four, two and six instants."""
    begin, end = np.array([0.0, -1.0, 0.0, 2.0]), np.array([-1.0, -3.0, 2.0, 5.0])
    halves = np.array([1, 2, 1, 3])
    instants, place = np.full(15, np.nan), np.full(4, -1)
    _write_instants(begin, end, halves, 2, instants, place)
    assert instants.tolist() == [-3.0, -2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0]
    assert instants[place].tolist() == begin.tolist()


@pytest.mark.parametrize(
    ("before", "after", "guard"),
    [
        (FREE, CONTACT, OVERLAP), (CONTACT, FREE, OVERLAP), (PARTING, FREE, OVERLAP), (OVERLAPPED, FREE, OVERLAP),
        (CONTACT, PARTING, OVERLAP_RATE), (PARTING, CONTACT, OVERLAP_RATE), (CONTACT, OVERLAPPED, FORCE),
        (OVERLAPPED, CONTACT, FORCE),
    ],
)  # fmt: skip
def test_the_guard_that_ended_a_mode_is_known_by_its_kind(before: int, after: int, guard: int) -> None:
    assert _guard_of(10 * before + after, ()) == guard
    assert _guard_of(TURN, ()) == VELOCITY
    assert [_guard_of(RANGE + slot, (0, 2)) for slot in (0, 1)] == [RANGE_0, RANGE_0 + 2]


def steps_of(events_s: list[float], phases: list[int], time_s: np.ndarray, each: tuple[int, int]) -> Any:
    flags = np.zeros((len(phases), NEAR_0))
    flags[:, PHASE] = phases
    events: Any = SimpleNamespace(event_time=np.array(events_s), event_mode=flags)
    return _cut_at_events(events, time_s, each)


def test_a_path_is_cut_at_samples_and_events_in_steps_no_longer_than_its_mode_allows() -> None:
    time_s = np.arange(-2, 6) * 1.0  # the bodies meet at nothing
    cut = steps_of([0.0, 1.5, 3.0], [CONTACT, FREE, CONTACT], time_s, (4, 2))
    steps = list(zip(cut.begin_s.tolist(), cut.end_s.tolist(), cut.sample.tolist(), cut.event.tolist(), strict=True))
    assert steps[:2] == [(0.0, -1.0, 1, -1), (-1.0, -2.0, 0, -1)]  # backwards from the meeting
    after = steps[2:]
    assert [begin for begin, *_ in after] == [0.0, *(end for _, end, *_ in after[:-1])] and after[-1][1] == 5.0
    for begin, end, sample, event in after:
        assert event == (0 if end <= 1.5 else 1 if end <= 3.0 else 2)
        assert 0.0 < end - begin <= (0.5 if event == 1 else 0.25) + 1e-12
        assert sample == (int(end) + 2 if end in (1.0, 2.0, 3.0, 4.0, 5.0) else -1)
    assert len(after) == 4 + 2 + 1 + 2 + 8
    # an event between a sample and the next, and samples that all come before the bodies meet
    few = steps_of([0.25], [FREE], np.array([-1.0, 0.0, 1.0]), (1, 1))
    assert few.begin_s.tolist() == [0.25, 0.0, 0.25] and few.end_s.tolist() == [0.0, -1.0, 1.0]
    assert few.sample.tolist() == [1, 0, 2] and few.event.tolist() == [-1, -1, 0]


def laid(events_s: list[float], time_s: list[float], each: int = 1) -> list[tuple[float, float, int, int]]:
    cut = steps_of(events_s, [CONTACT] * len(events_s), np.array(time_s), (each, each))
    return list(zip(cut.begin_s.tolist(), cut.end_s.tolist(), cut.sample.tolist(), cut.event.tolist(), strict=True))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_sample_is_at_an_event_within_a_ten_millionth_of_a_microsecond(way: float) -> None:
    back, there = (0.0, -1.0, 0, -1), (0.0, 1.0, 2, 0)
    near, apart = way * 5e-14, way * 5e-13
    assert laid([0.0], [-1.0, near, 1.0]) == [back, there]
    begun = [(0.0, apart, 1, 0), (apart, 1.0, 2, 0)] if way > 0 else [(0.0, apart, 1, -1), (apart, -1.0, 0, -1), there]
    assert laid([0.0], [-1.0, apart, 1.0]) == [*([back] if way > 0 else []), *begun]
    assert laid([0.0, 2.0], [-1.0, 0.0, 1.0, 2.0 + near, 3.0]) == [back, there, (1.0, 2.0, 3, 0), (2.0, 3.0, 4, 1)]
    middle = [(1.0, 2.0, -1, 0), (2.0, 2.0 + apart, 3, 1), (2.0 + apart, 3.0, 4, 1)]
    if way < 0:
        middle = [(1.0, 2.0 + apart, 3, 0), (2.0 + apart, 2.0, -1, 0), (2.0, 3.0, 4, 1)]
    assert laid([0.0, 2.0], [-1.0, 0.0, 1.0, 2.0 + apart, 3.0]) == [back, there, *middle]


@pytest.mark.parametrize(("more", "pieces"), [(5e-7, 2), (5e-6, 3)])
def test_a_step_may_be_longer_by_a_millionth(more: float, pieces: int) -> None:
    assert len(laid([0.0], [0.0, 1.0, 2.0 + 0.5 * more], 2)) == 2 + pieces

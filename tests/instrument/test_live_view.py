"""The sliding window of the live curves, against all points kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.signal.stream import LiveChunk
from instrument.live.live_view import MAX_BINS, LiveWindow, empty_view


def _chunk(first: int, count: int) -> LiveChunk:
    time_s = np.arange(first, first + count) / 1e4
    values = np.random.default_rng(first).normal(size=(3, count))
    return LiveChunk(time_s, values[0], values[1], values[2], 2.7e6, None)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 700), min_size=1, max_size=12), st.sampled_from([7, 1000, 1001, 2500]))
def test_the_newest_points_are_shown_in_bins_that_keep_their_places(counts: list[int], length: int) -> None:
    window, kept, first = LiveWindow(length), [np.empty((4, 0))], 0
    for count in counts:
        chunk = _chunk(first, count)
        window.add(chunk)
        kept.append(np.stack((chunk.time_s, chunk.beat_frequency_hz, chunk.velocity_m_per_s, chunk.force_n)))
        first += count
    every = np.concatenate(kept, axis=1)
    size = -(-length // MAX_BINS)
    assert window.bin_points == size
    begin = -(-max(0, every.shape[1] - length) // size)  # bins are counted from the very first point
    bins = [every[:, n * size : (n + 1) * size] for n in range(begin, every.shape[1] // size)]
    curves = window.curves()
    assert all(len(curve) == len(curves[0]) for curve in curves)
    for row, curve in enumerate(curves):
        assert not curve.flags.writeable
        assert curve.tolist() == [value for one in bins for value in (one[row].min(), one[row].max())]


def test_a_cleared_window_begins_anew_and_an_empty_view_has_nothing() -> None:
    window = LiveWindow(2500)
    window.add(_chunk(0, 1000))
    window.clear()
    assert window.curves()[0].size == 0
    window.add(_chunk(5, 30))
    assert window.curves()[0][[0, -1]].tolist() == pytest.approx([5 / 1e4, 34 / 1e4])
    view = window.view(np.zeros(3), np.zeros((3, 2), np.float32), "dark", 7)
    assert (view.problem, view.skipped, view.floor) == ("dark", 7, None) and not view.raw_v.flags.writeable
    assert not view.raw_time_s.flags.writeable and view.force_n.size == 20
    none = empty_view()
    assert none.time_s.size == 0 and none.raw_v.shape == (0, 0) and none.problem is None and none.skipped == 0

"""Decimation for the screen: no peak lost, at most two points a pixel."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.window.plots.curve import Pyramid


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 30_000),
    st.integers(0, 2**31),
    st.integers(2, 900),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_view_keeps_every_extreme_and_two_points_a_pixel(count, seed, pixels, left, right):
    random = np.random.default_rng(seed)
    values = random.standard_normal(count)
    values[random.integers(0, count, 3)] = np.nan
    start, stop = sorted((int(left * count), int(right * count)))
    whole = Pyramid(values)
    x, y = whole.view(start, stop, pixels)
    assert len(x) == len(y) <= 2 * pixels
    seen = values[start:stop][np.isfinite(values[start:stop])]
    if len(seen):
        assert np.nanmax(y) >= seen.max()
        assert np.nanmin(y) <= seen.min()
        assert whole.extremes(start, stop) == (seen.min(), seen.max())


def test_view_shows_a_single_sample_spike_at_its_place_among_five_million():
    values = np.zeros(5_000_000, np.int16)
    values[3_141_592] = 1000
    x, y = Pyramid(values).view(0, len(values), 1000)
    assert y.max() == 1000
    assert abs(x[y.argmax()] - 3_141_592) <= 5_000_000 / 1000


def test_view_gives_the_samples_themselves_when_there_are_few():
    values = np.arange(100.0)
    x, y = Pyramid(values).view(10, 20, 500)
    assert np.array_equal(x, np.arange(10, 20))
    assert np.array_equal(y, np.arange(10.0, 20.0))


def test_extremes_of_nothing_are_nan():
    assert np.isnan(Pyramid(np.empty(0)).extremes(0, 10)).all()
    assert np.isnan(Pyramid(np.full(50, np.nan)).extremes(0, 50)).all()


def test_extremes_stand_in_their_columns_and_a_hole_stays_one():
    values = np.zeros(100_000)
    values[[12, 55_555]], values[99_999] = (3.0, -2.0), 5.0
    values[70_000:80_000] = np.nan  # a hole of ten columns of a thousand samples
    place, shown = Pyramid(values).view(0, values.size, 100)
    place = place / values.size
    assert shown.size == 200 and np.all(np.diff(place) >= 0.0) and place[0] > 0.0 and place[-1] < 1.0
    assert [place[shown == value][0] for value in (3.0, -2.0, 5.0)] == pytest.approx([0.005, 0.555, 0.995])
    hole = place[np.isnan(shown)]
    assert hole.size in (18, 20) and 0.7 < hole[0] < 0.72 and 0.78 < hole[-1] < 0.8


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(2, 40), st.integers(1, 3), st.floats(2.0, 31.9), st.floats(0.0, 1.0))
def test_a_column_has_the_extremes_of_its_own_samples_to_two_blocks_of_its_level(seed, pixels, level, blocks, left):
    unit = 16 ** (level - 1)
    random = np.random.default_rng(seed)
    count = int(np.ceil(blocks * unit * pixels)) + 1
    start = int(left * 3 * unit)
    values = random.standard_normal(start + count + int(random.integers(0, unit)))  # the last block may not be whole
    place, shown = Pyramid(values).view(start, start + count, pixels)
    edges = start + np.arange(pixels + 1) * count / pixels
    np.testing.assert_allclose(place, np.repeat((edges[1:] + edges[:-1]) / 2, 2), rtol=1e-12)
    for (low, high), begin, end in zip(shown.reshape(-1, 2), edges[:-1], edges[1:], strict=True):
        wide = values[max(0, int(begin) - 2 * unit) : int(np.ceil(end)) + 2 * unit]
        narrow = values[int(np.ceil(begin)) + 2 * unit : max(0, int(end) - 2 * unit)]
        assert wide.min() <= low <= narrow.min(initial=high) and narrow.max(initial=low) <= high <= wide.max()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_both_extremes_of_the_last_samples_too_few_for_a_block_stand_in_the_last_column(sign):
    values = np.zeros(256 * 40 + 100)
    values[-3:] = sign * np.array([-7.0, 5.0, 1.0])
    shown = Pyramid(values).view(0, values.size, 20)[1].reshape(-1, 2)  # blocks of 16: 512 samples a column
    assert (shown[:-1] == 0.0).all() and shown[-1].tolist() == sorted([-7.0 * sign, 5.0 * sign])

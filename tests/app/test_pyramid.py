"""Decimation for the screen: no peak lost, at most two points a pixel, grown in pieces like made at once."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.window.plots.pyramid import Pyramid


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 30_000),
    st.lists(st.integers(0, 30_000), max_size=5),
    st.integers(0, 2**31),
    st.integers(2, 900),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_view_keeps_every_extreme_and_two_points_a_pixel(count, cuts, seed, pixels, left, right):
    random = np.random.default_rng(seed)
    values = random.standard_normal(count)
    values[random.integers(0, count, 3)] = np.nan
    grown = Pyramid()
    edges = [0, *sorted(cut for cut in cuts if cut < count), count]
    for first, last in itertools.pairwise(edges):
        grown.append(values[first:last])
    start, stop = sorted((int(left * count), int(right * count)))
    whole = Pyramid(values)
    for a, b in zip(grown.view(start, stop, pixels), whole.view(start, stop, pixels), strict=True):
        assert np.array_equal(a, b, equal_nan=True)
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

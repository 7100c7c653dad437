"""What the curves of a plot give to cursors and axes, and the views that a plot remembers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.window.controls.theme import LIGHT
from app.window.plots.axis import _round_up
from app.window.plots.cursors import SECONDS, TIME, CursorAxis, interval_statistics
from app.window.plots.curve import Band, PointCurve, SampledCurve
from app.window.plots.lines import DASHES, MEASURED, ColumnCurve, series
from app.window.plots.plot_view import MOST, ViewHistory
from app.window.plots.time_plot import TimeStack


@given(st.integers(1, 60), st.floats(-20, 80), st.floats(0, 60), st.sampled_from([0.1, 0.25, 3.0]))
def test_samples_between_two_places_are_those_that_lie_there(count, left, width, step) -> None:
    curve = SampledCurve("a", MEASURED)
    values = np.arange(100.0, 100.0 + count)
    curve.show_samples(-1.5, step, values)
    at = -1.5 + step * np.arange(count)
    right = left + width
    if np.min(np.abs(at - left)) < 1e-6 or np.min(np.abs(at - right)) < 1e-6:
        return
    inside = (at >= left) & (at <= right)
    x, y = curve.between(left, right)
    assert x == pytest.approx(at[inside]) and y.tolist() == values[inside].tolist()
    extremes = curve.extremes(left, right)
    assert extremes == ((y.min(), y.max()) if y.size else pytest.approx((np.nan, np.nan), nan_ok=True))


def test_the_value_at_a_place_is_the_nearest_sample_s() -> None:
    curve = SampledCurve("a", MEASURED)
    curve.show_samples(2.0, 0.5, np.array([1.0, 4.0, 9.0]))
    assert curve.grid == (2.0, 0.5) and curve.samples.tolist() == [1, 4, 9]
    assert [curve.value_at(x) for x in (1.8, 2.2, 2.3, 3.2)] == [1, 1, 4, 9]
    assert all(np.isnan(curve.value_at(x)) for x in (1.7, 3.3, np.nan, np.inf))
    assert curve.between(2.0, 2.5)[1].tolist() == [1, 4]  # both ends are in
    assert curve.index_range(np.nan, 1.0) == (0, 0)
    curve.clear_samples()
    assert np.isnan(curve.value_at(2.0)) and curve.between(0.0, 9.0)[0].size == 0 and curve.grid == (0.0, 1.0)


def test_points_in_any_order_are_read_where_they_are() -> None:
    curve = PointCurve("a")
    assert np.isnan(curve.value_at(0.0))
    curve.show_points(np.array([3.0, 1.0, np.nan, 2.0]), np.array([30.0, 10.0, 99.0, np.nan]))
    assert [curve.value_at(x) for x in (1.0, 1.4, 2.6, 3.0)] == [10, 10, 30, 30]
    assert all(np.isnan(curve.value_at(x)) for x in (0.9, 3.1, 2.0))
    assert [part.tolist() for part in curve.between(2.5, 3.0)] == [[3.0], [30.0]]
    assert curve.extremes(0.0, 5.0) == (10.0, 30.0) and np.isnan(curve.extremes(1.5, 2.5)).all()
    assert curve.samples[:2].tolist() == [30.0, 10.0]


def test_a_band_has_its_half_width_to_both_sides_and_none_where_that_is_not_known() -> None:
    band = Band()
    half = np.full(1000, 2.0)
    half[300:400], half[999] = np.nan, np.inf
    band.show_band(1.0, 0.1, half)
    (x, upper), (_, lower) = (edge.getData() for edge in band.edges)
    assert band.typical == 2.0 and x.size == 334 and x[[0, 1]].tolist() == [1.0, 1.3]
    assert np.array_equal(lower, -upper) and set(upper) == {0.0, 2.0}
    assert upper[(x > 31.1) & (x < 40.9)].max() == 0.0
    band.show_band(0.0, 1.0, np.full(3, np.nan))
    assert np.isnan(band.typical)


def test_columns_reach_to_their_neighbours_so_that_a_steep_line_has_no_gaps() -> None:
    curve = ColumnCurve(look=MEASURED)
    least, greatest = np.array([0.0, 5.0, 6.0, np.nan, -9.0]), np.array([1.0, 5.5, 7.0, np.nan, -8.0])
    curve.show_columns(np.repeat(np.arange(5.0), 2), np.column_stack((least, greatest)).ravel())
    x, low, high = curve._columns
    assert x.tolist() == [0, 1, 2, 4]
    assert low.tolist() == [0, 1, 5.5, -9] and high.tolist() == [1, 5.5, 7, -8]
    curve.show_columns(np.repeat(np.arange(2.0), 2), np.array([5.0, 6.0, 0.0, 1.0]))
    assert curve._columns[1].tolist() == [5, 0] and curve._columns[2].tolist() == [6, 5]
    curve.show_line(np.arange(2.0), np.arange(2.0))
    assert curve._columns is None


def test_looks_of_overlaid_shots_differ_until_colours_and_dashes_are_used_up() -> None:
    colours = len(LIGHT.series)
    looks = [series(n) for n in range(colours * len(DASHES))]
    assert len({(look.of(LIGHT), look.dash) for look in looks}) == len(looks)
    assert looks[colours].of(LIGHT) == looks[0].of(LIGHT) and looks[colours].dash != looks[0].dash
    assert series(colours * len(DASHES)).dash == looks[0].dash


def test_readings_between_cursors_are_those_of_the_samples() -> None:
    random = np.random.default_rng(4)
    x, y = np.sort(random.uniform(5.0, 9.0, 80)), random.normal(3.0, 2.0, 80)
    found = interval_statistics("a", "N", x, y, 1.0, 4.0)
    assert found.slope == pytest.approx(np.polyfit(x, y, 1)[0]) and found.difference == 3.0
    assert (found.mean, found.rms, found.deviation) == pytest.approx((y.mean(), np.sqrt(np.mean(y**2)), y.std()))
    one = interval_statistics("a", "N", np.array([1.0]), np.array([7.0]), 7.0, 7.0)
    assert np.isnan(one.slope) and (one.mean, one.rms, one.deviation) == (7.0, 7.0, 0.0)
    assert (TIME.value(3.0), CursorAxis("Hz", "Hz", logarithmic=True).value(2.0)) == (3.0, 100.0)
    assert (TIME.scale, SECONDS.scale, TIME.per) == (1e-3, 1.0, "s")


def test_cursors_come_at_thirds_of_the_view_and_are_copied_whole(qtbot) -> None:
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    stack.add_plot("velocity", "m/s").add_curve("v", MEASURED).show_samples(0.0, 1.0, np.arange(31.0) ** 2)
    stack.show_span(0.0, 30.0)
    stack.show_cursors(True)
    assert stack.cursors.places == pytest.approx((10.0, 20.0))
    x = np.arange(10.0, 21.0)
    rows = [line.split("\t") for line in stack.cursors.text().splitlines()]
    assert rows[0] == ["A", "10.000000 ms", "B", "20.000000 ms", "B-A", "10.000000 ms"]
    assert rows[1][-1] == "slope (unit per s)" and rows[2][:2] == ["velocity, v", "m/s"]
    numbers = [100.0, 400.0, 300.0, np.mean(x**2), np.sqrt(np.mean(x**4)), np.std(x**2), 30.0 / 1e-3]
    assert [float(text) for text in rows[2][2:]] == pytest.approx(numbers, rel=1e-8)
    stack.cursors.place(20.0, 10.0)  # in either order
    (turned,) = stack.cursors.measures()
    assert (turned.difference, turned.mean) == pytest.approx((-300.0, np.mean(x**2)))
    stack.show_cursors(False)
    assert not stack.cursors.shown


def test_a_history_goes_back_and_forward_and_a_new_view_replaces_what_followed() -> None:
    history = ViewHistory()
    assert history.step(-1) is None and history.step(1) is None
    for state in (1, 2, 2, 3):
        history.note(state)
    assert [history.step(by) for by in (1, -1, -1, -1, 1)] == [None, 2, 1, None, 2]
    history.note(2)  # the present one
    assert history.step(1) == 3 and history.step(-1) == 2
    history.note(9)
    assert history.step(1) is None and history.step(-1) == 2
    for state in range(1000, 1000 + 3 * MOST):
        history.note(state)
    back = [history.step(-1) for _ in range(MOST)]
    assert back[-1] is None and back[-2] == 1000 + 2 * MOST and MOST == 100
    history.clear()
    assert history.step(-1) is None


@given(st.floats(1e-9, 1e9))
def test_a_distance_is_rounded_up_to_1_2_or_5(distance: float) -> None:
    steps = np.array([m * 10.0**k for k in range(-10, 11) for m in (1, 2, 5)])
    assert _round_up(distance) == pytest.approx(steps[steps >= distance * (1 - 1e-9)].min())

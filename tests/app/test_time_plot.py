"""The value axis of a plot over time: it holds what is in view, with room, and moves no more than it must."""

import numpy as np
import pytest

from app.window.plots.lines import MEASURED
from app.window.plots.time_plot import TimePlot, TimeStack

VALUES = np.concatenate((np.linspace(0.0, 10.0, 50), np.linspace(-40.0, 20.0, 50)))


@pytest.fixture
def stack(qtbot):
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    stack.add_plot("force", "N").add_curve("a", MEASURED).show_samples(0.0, 1.0, VALUES)
    return stack


def _plot(stack: TimeStack, left: float = 0.0, right: float = 49.0) -> TimePlot:
    stack.show_span(left, right)
    return stack.plots[0]


def _values(plot: TimePlot) -> tuple[float, float]:
    low, high = plot.view.viewRange()[1]
    return low, high


def test_the_axis_holds_the_curves_in_view_with_room_at_both_ends(stack) -> None:
    plot = _plot(stack)
    plot.fit_y()
    assert _values(plot) == pytest.approx((-0.8, 10.8))
    _plot(stack, 0.0, 99.0)  # follows the time
    assert _values(plot) == pytest.approx((-10.0 - 0.58 * 60, -10.0 + 0.58 * 60))
    plot.sampled[0].setVisible(False)
    plot.add_curve("b", MEASURED).show_samples(0.0, 1.0, np.full(100, 3.0))
    plot.minimum_span = 4.0
    plot.fit_y()
    assert _values(plot) == pytest.approx((3 - 2.32, 3 + 2.32))
    plot.minimum_span = 0.0
    plot.fit_y()
    low, high = _values(plot)
    assert low < 3.0 < high and high - low < 1e-6


def test_bands_and_levels_are_in_view_and_what_is_hidden_is_not(stack) -> None:
    plot = _plot(stack)
    band = plot.add_band()
    band.show_band(0.0, 1.0, np.full(100, 15.0))
    plot.fit_y()
    assert _values(plot) == pytest.approx((-17.4, 17.4))
    band.setVisible(False)
    plot.show_levels({"high": 30.0, "low": -2.0})
    plot.fit_y()
    assert _values(plot) == pytest.approx((14 - 0.58 * 32, 14 + 0.58 * 32))
    assert sorted(line.value() for line in plot._levels) == [-2.0, 30.0]
    plot.show_levels({"low": -2.0})
    plot.fit_y()
    assert len(plot._levels) == 1 and _values(plot) == pytest.approx((4 - 0.58 * 12, 4 + 0.58 * 12))


def test_a_steady_axis_moves_only_where_it_is_too_narrow_or_four_times_too_wide(stack) -> None:
    plot = _plot(stack)
    plot.steady = True
    plot.fit_y(anew=True)
    assert _values(plot) == pytest.approx((5 - 0.58 * 15, 5 + 0.58 * 15))  # half as much again
    curve = plot.sampled[0]

    def shown(low: float, high: float) -> tuple[float, float]:
        curve.show_samples(0.0, 1.0, np.tile([low, high], 50))
        plot.fit_y()
        return _values(plot)

    kept = _values(plot)
    assert shown(0.0, 10.0) == kept == shown(-3.0, 12.0) == shown(3.0, 3.0 + 17.4 / 3.9)
    assert shown(3.0, 3.0 + 17.4 / 4.1) == pytest.approx(
        (3 + 17.4 / 8.2 - 0.87 * 17.4 / 4.1, 3 + 17.4 / 8.2 + 0.87 * 17.4 / 4.1)
    )
    assert shown(0.0, 20.0) == pytest.approx((10 - 17.4, 10 + 17.4))
    narrower = _values(plot)
    curve.show_samples(0.0, 1.0, np.tile([8.0, 20.0], 50))
    plot.fit_y()
    assert _values(plot) == narrower
    plot.fit_y(anew=True)
    assert _values(plot) == pytest.approx((14 - 0.87 * 12, 14 + 0.87 * 12))


def test_an_axis_set_by_hand_stays_until_it_is_freed_and_is_brought_back_as_it_was(stack) -> None:
    plot = _plot(stack)
    plot.fit_y()
    before = plot.state
    assert before == ((0.0, 49.0), pytest.approx((-0.8, 10.8)), False)
    plot.view.y_set_by_user.emit(True)
    plot.view.setYRange(-1.0, 1.0, padding=0)
    _plot(stack, 10.0, 90.0)
    plot.fit_y()
    by_hand = plot.state
    assert by_hand == ((10.0, 90.0), (-1.0, 1.0), True)
    plot.restore(before)
    assert plot.state == before
    _plot(stack, 50.0, 99.0)
    assert _values(plot) == pytest.approx((-10.0 - 0.58 * 60, -10.0 + 0.58 * 60))  # free again
    plot.restore(by_hand)
    assert plot.state == by_hand
    plot.free_y()
    assert _values(plot) != (-1.0, 1.0) and not plot.state[2]


def test_marks_stand_at_these_times_alone(stack) -> None:
    plot = stack.plots[0]
    plot.mark([1.0, 2.0, 3.0])
    plot.mark([7.0, 8.0])
    assert plot.marks.xvals == [7.0, 8.0]


def test_nothing_in_view_leaves_the_axis_as_it_is(stack) -> None:
    plot = _plot(stack)
    plot.fit_y()
    before = _values(plot)
    plot.sampled[0].show_samples(0.0, 1.0, np.full(100, np.nan))
    plot.fit_y()
    assert _values(plot) == before

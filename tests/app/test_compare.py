"""COMPARE: the trend in numbers and words, and the curves laid over one another from first touch on."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty import number_with_key
from app.report import contact_span_ms
from app.session.session import Session
from app.window.panels.compare import MOST, ComparePanel, TrendPlot
from tests.app import synthetic
from tests.app.on_screen import trend_points

PEAK = number_with_key("contact_time_s")  # in ms


def _shot(speed: float, value: float | None, std: float = 2e-4):
    reading = NotSeen("no release") if value is None else Quantity(value, std)
    shot = synthetic.shot(count=8000)
    into = Quantity(-speed, 1e-6)
    return replace(shot, impact=replace(shot.impact, contact_time_s=reading, velocity_in_m_per_s=into))


@pytest.fixture
def trend(qtbot):
    plot = TrendPlot()
    qtbot.addWidget(plot)
    return plot


def test_a_trend_shows_each_shot_with_its_uncertainty_and_says_mean_and_spread(trend) -> None:
    shots = [_shot(0.2, 28e-3), _shot(0.3, 29e-3), _shot(0.4, None), _shot(0.4, 31e-3, 5e-4), _shot(0.5, np.nan)]
    said = trend.show_trend(PEAK, shots)
    assert np.array(trend_points(trend)) == pytest.approx(np.array([[0.2, 28.0], [0.3, 29.0], [0.4, 31.0]]))
    spread = np.std([28.0, 29.0, 31.0], ddof=1)
    assert said == (
        f"3 shots: mean 29.3333 ms, spread {spread:.3g} ({100 * spread / (88 / 3):.2g} %); "
        "bars: ± from each shot's noise only, 0.3 on average"
    )
    assert [values.tolist() for values in trend.columns.values()] == [
        pytest.approx([0.2, 0.3, 0.4]), pytest.approx([28.0, 29.0, 31.0]), pytest.approx([0.2, 0.2, 0.5]),
    ]  # fmt: skip
    assert list(trend.columns)[1].endswith("(ms)")
    (left, right), (low, high) = trend.plot.view.viewRange()
    assert (left, right) == pytest.approx((0.2 - 0.016, 0.4 + 0.016))
    assert (low, high) == pytest.approx((27.8 - 0.12 * 3.7, 31.5 + 0.12 * 3.7))
    bars = trend._bars.opts
    assert bars["height"] == pytest.approx([0.4, 0.4, 1.0]) and bars["y"] == pytest.approx([28.0, 29.0, 31.0])


def test_of_one_shot_there_is_no_spread_and_of_none_no_trend(trend) -> None:
    assert (
        trend.show_trend(PEAK, []) == "No selected shot has this number." == trend.show_trend(PEAK, [_shot(0.3, None)])
    )
    assert trend_points(trend) == []
    assert "select several" in trend.show_trend(PEAK, [_shot(0.3, 28e-3, np.inf)])
    assert trend.columns["standard uncertainty, noise alone"].tolist() == [0.0]
    (left, right), (low, high) = trend.plot.view.viewRange()
    assert left < 0.3 < right < 0.31 and low < 28.0 < high < 28.01


def test_a_mean_of_zero_has_no_relative_spread(trend) -> None:
    said = trend.show_trend(PEAK, [_shot(0.2, -1e-3), _shot(0.3, 1e-3)])
    assert said.startswith("2 shots: mean 0 ms, spread 1.41; bars") and "%" not in said


@pytest.fixture
def panel(qtbot):
    panel = ComparePanel()
    qtbot.addWidget(panel)
    panel.resize(1200, 800)
    panel.show()
    return panel


def _entries(count: int) -> list:
    session = Session()
    for n in range(count):
        session.add(synthetic.shot(f"s{n}", 0.2 + 0.01 * (n % 3), n, 8000))
    return list(session.entries)


def test_the_last_eight_are_overlaid_from_first_touch_on_with_their_numbers(panel) -> None:
    entries = _entries(MOST + 2)
    panel.show_entries(entries)
    velocity, force = panel.stack.plots
    assert [curve.label for curve in velocity.sampled] == [f"{n} s{n - 1}" for n in range(3, 11)]
    for curves, name in ((velocity.sampled, "velocity_m_per_s"), (force.sampled, "force_n")):
        for curve, entry in zip(curves, entries[2:], strict=True):
            assert np.array_equal(curve.samples, getattr(entry.shot.motion, name))
            assert curve.grid == pytest.approx((-60.0, 0.01)) and curve.isVisible()
    assert panel._say.text() == "the last 8 of 10 selected shots are overlaid; the trend includes all"
    assert (
        len(trend_points(panel.trend)) == 10 and panel.stack.accessibleDescription() == "Shots 3, 4, 5, 6, 7, 8, 9, 10"
    )
    assert panel.stack.span == pytest.approx((-60.0, 20.0))
    panel.show_contact()
    assert panel.stack.span == pytest.approx(contact_span_ms(entries[-1].shot))
    panel.stack.reset()
    assert panel.stack.span == pytest.approx((-60.0, 20.0))
    panel.show_entries(entries[:2])
    assert [curve.isVisible() for curve in velocity.sampled] == [True] * 2 + [False] * 6
    assert not any(len(curve.samples) for curve in force.sampled[2:]) and panel._say.text() == ""
    assert [words for words, _ in panel.stack.legend] == ["1  s0", "2  s1"]
    panel.show_entries([])
    assert "Select shots" in panel._say.text() and panel.stack.legend == []


def test_a_curve_s_number_lies_on_it_wherever_the_view_goes(panel) -> None:
    panel.show_entries(_entries(3))
    for left, right in ((-60.0, 20.0), (-20.0, 10.0)):
        panel.stack.show_span(left, right)
        for n, (item, curve) in enumerate(zip(panel._labels[:3], panel._velocity_curves[:3], strict=True)):
            at = left + (n + 1) / 4 * (right - left)
            assert item.toPlainText() == str(n + 1) and item.isVisible()
            assert (item.pos().x(), item.pos().y()) == pytest.approx((at, curve.value_at(at)))
    panel.stack.show_span(500.0, 600.0)
    assert not any(item.isVisible() for item in panel._labels)


def test_another_number_has_another_trend(panel) -> None:
    entries = _entries(3)
    panel.show_entries(entries)
    panel.which.setCurrentIndex(panel.which.findData("contact_time_s"))
    assert [y for _, y in trend_points(panel.trend)] == pytest.approx([28.71] * 3)
    assert panel.repeatability.text().startswith("3 shots: mean 28.71 ms, spread ")

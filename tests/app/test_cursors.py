"""What the cursors say of a stretch whose measures are known."""

import numpy as np
import pytest
from PySide6.QtGui import QTextDocumentFragment

from app.window.plots.cursors import CursorAxis, CursorReadout, interval_statistics
from app.window.plots.lines import MEASURED
from app.window.plots.plain_plot import LogPlot
from app.window.plots.time_plot import TimeStack


def test_measures_of_a_ramp():
    x_ms = np.linspace(0, 10, 1001)
    found = interval_statistics("velocity", "m/s", 1e-3 * x_ms, 3.0 + 200.0 * x_ms * 1e-3, 3.0, 5.0)
    assert found.slope == pytest.approx(200.0)
    assert found.mean == pytest.approx(4.0)
    assert found.difference == 2.0
    assert found.rms == pytest.approx(np.sqrt(16 + 4 / 12), rel=1e-3)
    assert found.deviation == pytest.approx(2 / np.sqrt(12), rel=1e-2)


def test_lost_samples_do_not_count():
    y = np.ones(100)
    y[40:60] = np.nan
    found = interval_statistics("force", "N", np.arange(100.0), y, 1.0, 1.0)
    assert (found.mean, found.rms) == (1.0, 1.0)


def test_nothing_between_is_nan_and_not_zero():
    found = interval_statistics("force", "N", np.empty(0), np.empty(0), float("nan"), float("nan"))
    assert np.isnan([found.mean, found.rms, found.slope]).all()


def test_a_cursor_dragged_in_one_plot_moves_in_all_of_them_and_the_other_stays(qtbot) -> None:
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    for title in ("velocity", "force"):
        stack.add_plot(title, "N")
    stack.show_cursors(True)
    cursors = stack.cursors
    cursors.place(1.0, 2.0)
    for dragged, place, places in (("A", 1.4, (1.4, 2.0)), ("B", 1.7, (1.4, 1.7)), ("A", 2.5, (2.5, 1.7))):
        with qtbot.waitSignal(cursors.moved):
            cursors._lines[dragged][1].setValue(place)  # as the mouse does
        assert cursors.places == places
        assert [{line.value() for line in cursors._lines[name]} for name in "AB"] == [{at} for at in places]


def test_a_plot_over_decades_is_told_in_plain_numbers(qtbot) -> None:
    plot = LogPlot("floor", ("velocity", "µm/s"), "frequency", CursorAxis("Hz", "Hz", logarithmic=True))
    qtbot.addWidget(plot)
    plot.add_curve("floor").show_points(np.array([1.0, 10.0, 100.0]), np.array([0.5, 5.0, 50.0]))
    plot.show_range((1.0, 100.0), (0.1, 100.0))
    plot.show_cursors(True)
    plot.cursors.place(0.0, 1.0)
    (told,) = plot.cursors.measures()
    assert (told.at_a, told.at_b, told.mean) == pytest.approx((0.5, 5.0, 2.75))
    assert plot.cursors.text().startswith("A\t1.000000 Hz\tB\t10.000000 Hz")
    ticks = plot.plot.getAxis("bottom").tickValues(0.0, 2.0, 300.0)[0][1]
    assert plot.plot.getAxis("bottom").tickStrings(ticks, 1.0, 1.0) == ["1", "2", "5", "10", "20", "50", "100"]


def test_the_table_names_a_curve_as_it_is_called_whatever_its_name_looks_like(qtbot) -> None:
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    stack.add_plot("force", "N").add_curve("1 v<u>0 & a", MEASURED).show_samples(0.0, 0.1, np.zeros(100))
    readout = CursorReadout(stack)
    qtbot.addWidget(readout)
    stack.show()
    stack.show_cursors(True)
    assert "force, 1 v<u>0 & a" in QTextDocumentFragment.fromHtml(readout.words).toPlainText()


def test_a_slope_is_per_second_and_a_hidden_curve_is_not_read(qtbot) -> None:
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    plot = stack.add_plot("velocity", "m/s")
    ramp, other = plot.add_curve("measured", MEASURED), plot.add_curve("other", MEASURED)
    ramp.show_samples(0.0, 0.1, 0.3 * np.arange(100))  # 3 per ms
    other.show_samples(0.0, 0.1, np.ones(100))
    other.setVisible(False)
    stack.show_cursors(True)
    stack.cursors.place(6.0, 2.0)  # B before A
    (told,) = stack.cursors.measures()
    assert (told.name, told.unit) == ("velocity, measured", "m/s")
    assert (told.at_a, told.at_b, told.difference) == pytest.approx((18.0, 6.0, -12.0))
    assert told.slope == pytest.approx(3000.0) and told.mean == pytest.approx(12.0)
    first, heads, row = stack.cursors.text().split("\n")
    assert first == "A\t6.000000 ms\tB\t2.000000 ms\tB-A\t-4.000000 ms"
    assert heads.endswith("slope (unit per s)") and len(heads.split("\t")) == len(row.split("\t"))
    cells = row.split("\t")
    assert cells[:2] == ["velocity, measured", "m/s"] and [float(cell) for cell in cells[2:6]] == pytest.approx(
        [18.0, 6.0, -12.0, 12.0]
    )
    assert float(cells[6]) == pytest.approx(told.rms) and float(cells[7]) == pytest.approx(told.deviation)


def test_cursors_are_shown_at_the_thirds_of_the_view_and_stepped(qtbot) -> None:
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    for title in ("velocity", "force"):
        stack.add_plot(title, "N")
    cursors = stack.cursors
    cursors.show(True, 3.0, 9.0)
    assert cursors.places == pytest.approx((5.0, 7.0)) and cursors.shown
    lines = [line for name in "AB" for line in cursors._lines[name]]
    assert len(lines) == 4 and all(line.isVisible() for line in lines)
    assert [getattr(line, "label", None) is not None for line in lines] == [True, False, True, False]
    with qtbot.waitSignal(cursors.moved):
        cursors.step("B", -0.5)
    assert cursors.places == pytest.approx((5.0, 6.5))
    with qtbot.waitSignal(cursors.moved):
        cursors.show(False, 0.0, 1.0)
    assert cursors.places == pytest.approx((5.0, 6.5)) and not any(line.isVisible() for line in lines)


def test_the_readout_tells_the_span_as_a_frequency_and_less_in_a_low_window(qtbot) -> None:
    stack = TimeStack("stack")
    qtbot.addWidget(stack)
    stack.add_plot("force", "N").add_curve("measured", MEASURED).show_samples(0.0, 0.1, np.arange(100.0))
    readout = CursorReadout(stack)
    qtbot.addWidget(readout)
    stack.show()
    assert readout.isHidden()
    stack.show_cursors(True)
    readout.resize(600, 1200)
    stack.cursors.place(2.0, 4.5)
    said = QTextDocumentFragment.fromHtml(readout.words).toPlainText()
    assert "A 2.0000 ms" in said and "B 4.5000 ms" in said and "B − A 2.5000 ms" in said and "(400 Hz)" in said
    assert [head in said for head in ("at A", "at B", "mean", "rms", "slope per s")] == 5 * [True]
    assert readout._table.text() == readout.words and readout._table.toolTip() == ""
    stack.cursors.place(3.0, 3.0)
    assert "(– Hz)" in QTextDocumentFragment.fromHtml(readout.words).toPlainText()
    readout.resize(600, 100)
    stack.cursors.place(2.0, 4.5)
    assert readout._table.toolTip() == readout.words != readout._table.text()
    assert "slope" not in readout._table.text() and "400 Hz" in readout._table.text()
    stack.show_cursors(False)
    assert readout.isHidden()

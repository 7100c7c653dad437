"""What the cursors say of a stretch whose measures are known."""

import numpy as np
import pytest
from PySide6.QtGui import QTextDocumentFragment

from app.window.plots.cursors import CursorAxis, CursorReadout, between
from app.window.plots.lines import MEASURED
from app.window.plots.plain_plot import LogPlot
from app.window.plots.time_stack import TimeStack


def test_measures_of_a_ramp():
    x_ms = np.linspace(0, 10, 1001)
    found = between("velocity", "m/s", 1e-3 * x_ms, 3.0 + 200.0 * x_ms * 1e-3, 3.0, 5.0)
    assert found.slope == pytest.approx(200.0)
    assert found.mean == pytest.approx(4.0)
    assert found.difference == 2.0
    assert found.rms == pytest.approx(np.sqrt(16 + 4 / 12), rel=1e-3)
    assert found.deviation == pytest.approx(2 / np.sqrt(12), rel=1e-2)


def test_lost_samples_do_not_count():
    y = np.ones(100)
    y[40:60] = np.nan
    found = between("force", "N", np.arange(100.0), y, 1.0, 1.0)
    assert (found.mean, found.rms) == (1.0, 1.0)


def test_nothing_between_is_nan_and_not_zero():
    found = between("force", "N", np.empty(0), np.empty(0), float("nan"), float("nan"))
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
    plot = LogPlot("floor", ("velocity", "µm/s"), "frequency (Hz)", CursorAxis("Hz", "Hz", logarithmic=True))
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

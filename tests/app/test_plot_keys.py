"""A plot by keys, its menu and its history of views; the legend above it."""

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QRect, Qt
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtWidgets import QLabel

from app.window.plots.legend import Legend, is_low
from app.window.plots.lines import MEASURED, SIMULATED
from app.window.plots.plot_view import MOST, NUDGE, PAN, ZOOM, ViewHistory, in_front
from app.window.plots.time_plot import TimeStack

NO, SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier
CTRL, ALT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.AltModifier


@pytest.fixture
def stack(qtbot):
    one = TimeStack("stack")
    qtbot.addWidget(one)
    for title, unit in (("velocity", "m/s"), ("force", "N")):
        one.add_plot(title, unit).add_curve("measured", MEASURED).show_samples(0.0, 0.1, np.sin(np.arange(1000) / 50))
    one.resize(600, 400)
    one.show()
    one.zoom(10.0, 20.0)
    return one


def _press(stack: TimeStack, key: Qt.Key, modifiers: Qt.KeyboardModifier = NO) -> bool:
    event = QKeyEvent(QEvent.Type.KeyPress, key, modifiers)
    stack.keyPressEvent(event)
    return event.isAccepted()


def test_arrows_move_by_a_tenth_and_zoom_by_a_fifth_about_the_middle(stack) -> None:
    for key, span in (
        (Qt.Key.Key_Right, (10.0 + 10 * PAN, 20.0 + 10 * PAN)),
        (Qt.Key.Key_Left, (10.0, 20.0)),
        (Qt.Key.Key_Up, (15.0 - 5 * ZOOM, 15.0 + 5 * ZOOM)),
        (Qt.Key.Key_Minus, (10.0, 20.0)),
        (Qt.Key.Key_Plus, (15.0 - 5 * ZOOM, 15.0 + 5 * ZOOM)),
        (Qt.Key.Key_Down, (10.0, 20.0)),
    ):
        assert _press(stack, key) and stack.span == pytest.approx(span), key
        assert {tuple(plot.view.viewRange()[0]) for plot in stack.plots} == {tuple(stack.plots[0].view.viewRange()[0])}
    assert not _press(stack, Qt.Key.Key_A) and not _press(stack, Qt.Key.Key_Left, ALT)
    assert stack.span == pytest.approx((10.0, 20.0))
    stack.show_whole(0.0, 99.9)
    _press(stack, Qt.Key.Key_Up)
    assert _press(stack, Qt.Key.Key_Home) and stack.span == pytest.approx((0.0, 99.9))


def test_shift_moves_cursor_a_and_ctrl_cursor_b_by_a_hundredth_of_the_view(stack) -> None:
    thirds = 10.0 + 10 / 3, 20.0 - 10 / 3
    assert _press(stack, Qt.Key.Key_Right, SHIFT) and stack.cursors.shown
    assert stack.cursors.places == pytest.approx((thirds[0] + 10 * NUDGE, thirds[1]))
    _press(stack, Qt.Key.Key_Left, CTRL)
    _press(stack, Qt.Key.Key_Left, CTRL)
    assert stack.cursors.places == pytest.approx((thirds[0] + 10 * NUDGE, thirds[1] - 20 * NUDGE))
    assert stack.span == pytest.approx((10.0, 20.0))
    stack.copy_cursors()
    assert QGuiApplication.clipboard().text() == stack.cursors.text()
    stack.toggle_cursors()
    QGuiApplication.clipboard().setText("mine")
    stack.copy_cursors()
    assert not stack.cursors.shown and QGuiApplication.clipboard().text() == "mine"


def test_views_are_stepped_back_and_forth_until_other_shots_are_drawn(stack) -> None:
    stack.zoom(30.0, 40.0)
    stack.zoom(50.0, 60.0)
    assert stack.step_view(-1) and stack.span == pytest.approx((30.0, 40.0))
    assert stack.step_view(-1) and stack.span == pytest.approx((10.0, 20.0))
    assert stack.step_view(1) and stack.span == pytest.approx((30.0, 40.0))
    stack.set_shots((1,), "shot 1")
    assert stack.accessibleDescription() == "shot 1" and stack.shows == (1,)
    assert not stack.step_view(-1) and not stack.step_view(1)
    stack.zoom(10.0, 20.0)
    stack.set_shots((1,), "shot 1")
    assert stack.step_view(-1) and stack.span == pytest.approx((30.0, 40.0))


def test_a_state_noted_after_going_back_replaces_those_that_followed() -> None:
    history = ViewHistory()
    assert history.step(-1) is None and history.step(1) is None and history.step(0) is None
    for state in (1, 2, 2, 3):
        history.note(state)
    assert [history.step(-1), history.step(-1), history.step(-1)] == [2, 1, None]
    history.note(9)
    assert (history.step(1), history.step(-1), history.step(1)) == (None, 1, 9)
    for state in range(10, 10 + MOST):
        history.note(state)
    back = [history.step(-1) for _ in range(MOST)]
    assert back[-1] is None and back[-2] == 10  # the oldest that is kept


def test_the_menu_does_what_it_says(stack) -> None:
    exported: list[tuple[object, str]] = []
    stack.export_wanted.connect(lambda plot, kind: exported.append((plot, kind)))
    actions = {action.text(): action for action in stack.menu().actions() if action.text()}
    assert list(actions) == [
        "Reset the view", "Back", "Forward", "Cursors", "Copy the cursor readings",
        "Save as PNG …", "Save as SVG …", "Save the samples in view as CSV …",
    ]  # fmt: skip
    assert not actions["Copy the cursor readings"].isEnabled() and not actions["Cursors"].isChecked()
    for words in list(actions)[-3:]:
        actions[words].trigger()
    assert exported == [(stack, "png"), (stack, "svg"), (stack, "csv")]
    stack.zoom(30.0, 40.0)
    actions["Back"].trigger()
    assert stack.span == pytest.approx((10.0, 20.0))
    actions["Forward"].trigger()
    assert stack.span == pytest.approx((30.0, 40.0))
    actions["Cursors"].trigger()
    assert stack.cursors.shown
    again = {action.text(): action for action in stack.menu().actions()}
    assert again["Copy the cursor readings"].isEnabled() and again["Cursors"].isChecked()
    stack.table_words = ""
    assert not any("CSV" in action.text() for action in stack.menu().actions())
    assert not stack.write_note()  # nothing says what its values are
    assert in_front([stack, stack]) is stack


def test_a_legend_breaks_its_lines_where_the_picture_ends(qtbot) -> None:
    entries = [(name, MEASURED) for name in ("one", "twenty-two", "one", "twenty-two")]
    legend = Legend()
    qtbot.addWidget(legend)
    legend.show_entries(entries)
    parts = [legend.layout().itemAt(place) for place in range(4)]
    needed, line = [part.sizeHint().width() for part in parts], parts[0].sizeHint().height()
    gap = legend.layout().spacing()
    for width, rows in (
        (sum(needed) + 3 * gap, [0, 0, 0, 0]),
        (sum(needed) + 3 * gap - 1, [0, 0, 0, 1]),
        (sum(needed[:2]) + gap, [0, 0, 1, 1]),
        (10, [0, 1, 2, 3]),
    ):
        assert legend.layout().heightForWidth(width) == line * (rows[-1] + 1) + gap * rows[-1]
        legend.layout().setGeometry(QRect(0, 0, width, 500))
        assert [part.geometry().top() // (line + gap) for part in parts] == rows
    legend.show_entries([])
    assert legend.layout().heightForWidth(100) == 0
    legend.show_entries([("one", MEASURED), ("two", SIMULATED)])
    labels = [legend.layout().itemAt(place).widget().findChild(QLabel) for place in range(legend.layout().count())]
    assert [label.text() for label in labels] == ["one", "two"]
    assert legend.entries == [("one", MEASURED), ("two", SIMULATED)]


def test_a_page_is_low_below_eighteen_lines(qtbot) -> None:
    legend = Legend()
    qtbot.addWidget(legend)
    lines = legend.fontMetrics().lineSpacing()
    for height, low in ((18 * lines - 1, True), (18 * lines, False)):
        legend.resize(100, height)
        assert is_low(legend) is low

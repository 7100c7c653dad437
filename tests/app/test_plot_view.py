"""What every plot of the window can do, pressed by keys: cursors with their readout, moving, zooming, the menu."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyqtgraph import Point
from PySide6.QtCore import QLocale, QPointF, QRectF, Qt
from PySide6.QtGui import QAccessible, QGuiApplication, QImage
from PySide6.QtWidgets import QWidget

from analysis.drive.curves import drive_curves
from app.session.session import Session
from app.window.controls.file_dialog import PathKind, ask
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.plots.cursors import CursorReadout
from app.window.plots.plot_view import PlotView
from app.window.plots.save import save_png
from tests.app import synthetic

SHIFT, CTRL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def panels(qtbot):
    layout = Layout(Theme("light"))
    qtbot.addWidget(layout)
    layout.resize(1400, 900)
    layout.show()
    session = Session()
    for index, speed in enumerate((0.2, 0.25, 0.3), 1):
        session.add(synthetic.shot(f"shot-{index}", speed, index))
    layout.shot.show_shot(session.entries[0].shot)
    layout.compare.show_entries(list(session.entries))
    found = replace(synthetic.diagnosis(session.entries[0].shot), laws=(synthetic.learned_law(),))
    layout.diagnosis.show_diagnosis(found, [session.entries[0].shot])
    layout.diagnosis.fold.setChecked(True)
    return layout


def _readout(panels, plot):
    (found,) = [r for r in panels.findChildren(CursorReadout) if r._plot is plot]
    return found


def _bring(panels, plot):
    wanted = plot in panels.shot.drive.plots
    if wanted != (panels.shot._shot.settings.model == "driven"):
        driven = synthetic.driven_shot() if wanted else synthetic.shot()
        panels.shot.show_shot(driven)
        if wanted:
            panels.shot.show_drive(driven, drive_curves(driven.motion, driven.fit))
    for page in range(panels.tabs.count()):
        for view in ("whole", "contact", "deflection", "gap", "raw"):
            panels.shot.set_view(view)
            panels.tabs.setCurrentIndex(page)
            if plot.isVisible():
                return
    panels.shot.raw.has_samples = True  # as if a recording were at hand
    panels.tabs.setCurrentIndex(Layout.SHOT)
    panels.shot.set_view("raw")


def test_every_plot_has_cursors_whose_readout_comes_and_goes_with_it(panels, qtbot):
    plots = panels.findChildren(PlotView)
    assert len(plots) == 19
    plots.remove(panels.diagnosis.residuals.forces)  # a drive's, in the place of the stack above it
    for plot in plots:
        _bring(panels, plot)
        assert plot.isVisible() and panels.plot_in_front() is not None
        readout = _readout(panels, plot)
        assert readout.isHidden()
        qtbot.keyClick(plot, Qt.Key.Key_Right, SHIFT)  # the cursors come with the first step
        assert plot.cursors.shown and readout.isVisible() and "<b>A</b>" in readout.words
        told = QAccessible.queryAccessibleInterface(readout._table).text(QAccessible.Text.Name)
        assert "B − A" in told  # a screen reader hears the numbers, not what they are called
        panels.tabs.setCurrentIndex(Layout.BUDGET)
        assert not readout.isVisible()


def test_arrows_move_zoom_and_step_the_cursors(panels, qtbot):
    plot = panels.compare.stack
    panels.tabs.setCurrentIndex(Layout.COMPARE)
    left, right = plot.span
    qtbot.keyClick(plot, Qt.Key.Key_Up)
    assert np.ptp(plot.span) == pytest.approx(0.8 * (right - left))
    qtbot.keyClick(plot, Qt.Key.Key_Right)
    assert np.mean(plot.span) > 0.5 * (left + right)
    qtbot.keyClick(plot, Qt.Key.Key_Home)
    assert plot.span == pytest.approx((left, right))
    plot.show_cursors(True)
    a, b = plot.cursors.places
    qtbot.keyClick(plot, Qt.Key.Key_Left, SHIFT)
    qtbot.keyClick(plot, Qt.Key.Key_Right, CTRL)
    assert plot.cursors.places == pytest.approx((a - 0.01 * (right - left), b + 0.01 * (right - left)))


@pytest.mark.parametrize("name", ["stack", "deflection"])
def test_box_wheel_back_and_forward(panels, name):
    panels.tabs.setCurrentIndex(Layout.SHOT)
    panels.shot.set_view("whole" if name == "stack" else name)
    panels.shot.reset()
    plot = getattr(panels.shot, name)
    view = plot.plots[1].view if name == "stack" else plot.plot.view
    whole = plot.states
    (left, right), (low, high) = view.viewRange()
    view.showAxRect(QRectF(left + 0.4 * (right - left), low, 0.2 * (right - left), 0.5 * (high - low)))
    box = plot.states
    assert np.ptp(plot.span) == pytest.approx(0.2 * (right - left))
    assert np.ptp(view.viewRange()[1]) == pytest.approx(0.5 * (high - low))
    assert plot.step_view(-1) and np.allclose(_flat(plot.states), _flat(whole))
    assert not plot.step_view(-1)
    assert plot.step_view(1) and np.allclose(_flat(plot.states), _flat(box))
    assert not plot.step_view(1)

    x, y = view.viewRange()
    view.wheelEvent(_Wheel(Qt.KeyboardModifier.ControlModifier))
    assert view.viewRange()[0] == x and view.viewRange()[1] != y  # one axis alone
    y = view.viewRange()[1]
    view.wheelEvent(_Wheel(Qt.KeyboardModifier.NoModifier))
    assert view.viewRange()[0] != x and view.viewRange()[1] == y
    x = view.viewRange()[0]
    left_axis = (plot.plots[1] if name == "stack" else plot.plot).getAxis("left")
    left_axis.wheelEvent(_Wheel(Qt.KeyboardModifier.NoModifier))
    assert view.viewRange()[0] == x and view.viewRange()[1] != y
    y = view.viewRange()[1]
    left_axis.mouseDragEvent(_Drag())
    assert view.viewRange()[0] == x and view.viewRange()[1] != y
    y = view.viewRange()[1]
    view.mouseDragEvent(_Drag())
    assert view.viewRange()[0] != x and view.viewRange()[1] == y
    corners = [view.mapToView(Point(at, at)) for at in (30.0, 40.0)]
    view.mouseDragEvent(_Drag(SHIFT))
    box = [sorted(corner.x() for corner in corners), sorted(corner.y() for corner in corners)]
    assert np.allclose(view.viewRange(), box)
    view.mouseDragEvent(_Drag())
    assert not np.allclose(view.viewRange()[0], box[0]) and view.viewRange()[1] == pytest.approx(box[1])
    plot.set_shots((object(),), "another shot")
    assert not plot.step_view(-1)


@pytest.mark.parametrize(("over_axis", "kind"), [(False, "wheelEvent"), (True, "wheelEvent"), (True, "mouseDragEvent")])
def test_values_zoomed_by_hand_stay_when_the_time_is_zoomed(panels, over_axis, kind):
    panels.tabs.setCurrentIndex(Layout.SHOT)
    panels.shot.set_view("whole")
    panels.shot.reset()
    plot = panels.shot.stack.plots[1]
    event = _Drag() if kind == "mouseDragEvent" else _Wheel(CTRL if not over_axis else Qt.KeyboardModifier.NoModifier)
    getattr(plot.getAxis("left") if over_axis else plot.view, kind)(event)
    chosen = plot.view.viewRange()[1]
    for _ in range(5):
        plot.view.wheelEvent(_Wheel(Qt.KeyboardModifier.NoModifier))
    assert plot.view.viewRange()[1] == chosen
    panels.shot.reset()
    assert plot.view.viewRange()[1] != chosen


def _flat(states):
    return [value for x, y, by_hand in states for value in (*x, *y, by_hand)]


class _Wheel:
    def __init__(self, held):
        self._held = held

    def modifiers(self):
        return self._held

    def delta(self):
        return 120

    def pos(self):
        return QPointF(40.0, 40.0)

    def scenePos(self):
        return QPointF(-9e3, -9e3)  # not over the plot

    def accept(self):
        pass


class _Drag(_Wheel):
    """A drag with the left button, by 10 pixels each way."""

    def __init__(self, modifiers=Qt.KeyboardModifier.NoModifier):
        super().__init__(modifiers)

    def button(self):
        return Qt.MouseButton.LeftButton

    def pos(self):
        return Point(40.0, 40.0)

    def lastPos(self):
        return Point(30.0, 30.0)

    def buttonDownPos(self, button=None):
        return QPointF(30.0, 30.0)

    def buttonDownScenePos(self, button=None):
        return self.scenePos()

    def isFinish(self):
        return True


def test_the_cursors_give_the_stiffness_as_the_slope_of_each_branch(panels):
    plot = panels.shot.deflection
    panels.tabs.setCurrentIndex(Layout.SHOT)
    panels.shot.set_view("deflection")
    deepest = float(np.nanmax(plot.columns["deflection_mm"]))
    plot.show_cursors(True)
    plot.cursors.place(0.7 * deepest, 0.95 * deepest)
    found = {m.name: m for m in plot.cursors.measures()}
    branches = [f"{who}, {which}" for who in ("simulated", "measured") for which in ("loading", "unloading")]
    assert list(found) == [f"force, {branch}" for branch in branches]
    for measured in found.values():
        assert measured.slope == pytest.approx(214.0, rel=0.1)  # N/m
    for curve in (*plot._simulated, *plot._measured):
        x, _ = curve.between(0.1 * deepest, 0.9 * deepest)
        assert np.all(np.diff(x) > 0.0 if curve.label.endswith(", loading") else np.diff(x) < 0.0), curve.label


def test_the_screen_follows_the_locale_and_what_is_copied_does_not(panels):
    plot = panels.compare.stack
    panels.tabs.setCurrentIndex(Layout.COMPARE)
    before = QLocale()
    QLocale.setDefault(QLocale("de_DE"))
    try:
        plot.show_cursors(True)
        plot.cursors.place(1.25, 2.5)
        words = _readout(panels, plot).words
        assert "1,2500 ms" in words and "." not in words.replace("shot.", "").partition("<tr>")[2].replace("0 9px", "")
        assert plot.plots[0].getAxis("left").tickStrings([0.25], 1.0, 0.05) == ["0,25"]
        plot.copy_cursors()
        assert "A\t1.250000 ms" in QGuiApplication.clipboard().text()
    finally:
        QLocale.setDefault(before)


def test_a_saved_picture_bears_the_legend_of_its_lines(panels, tmp_path):
    plot = panels.compare.stack
    panels.tabs.setCurrentIndex(Layout.COMPARE)
    assert len(plot.legend) > 1
    pictures = []
    for legend in (plot.legend, ()):
        plot.legend = legend
        save_png(plot, tmp_path / "plot.png")
        pictures.append(QImage(str(tmp_path / "plot.png")))
    above = pictures[0].height() - pictures[1].height()
    assert above > 0 and pictures[0].width() == pictures[1].width()
    heading = 2 * (plot.fontMetrics().height() + 6) if plot.accessibleDescription() else 0
    strip = pictures[0].copy(0, heading, pictures[0].width(), above)
    painted = {strip.pixel(x, y) for x in range(0, strip.width(), 3) for y in range(0, strip.height(), 2)}
    assert len(painted) > 10  # words and lines, not an empty band


def test_a_question_for_files_starts_in_the_folder_it_is_given(qtbot, tmp_path):
    parent = QWidget()
    qtbot.addWidget(parent)
    opened = ask(parent, "Open recordings", PathKind.FILES, lambda _: None, tmp_path)
    saved = ask(parent, "Save the plot as PNG", PathKind.NEW_FILE, lambda _: None, tmp_path / "plot.png", "PNG (*.png)")
    assert {Path(dialog.directory().absolutePath()) for dialog in (opened, saved)} == {tmp_path}
    assert Path(saved.selectedFiles()[0]) == tmp_path / "plot.png"

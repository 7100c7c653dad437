"""The names of axes: in the middle of their axis, never longer than it, and never a unit alone on its side."""

import itertools

import pyqtgraph as pg
import pytest
from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter, QPicture
from PySide6.QtTest import QTest

from app.window.controls.theme import LIGHT
from app.window.plots.axis import PlainAxis
from app.window.plots.cursors import SPEED
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.time_plot import TimeStack
from tests.app.on_screen import caption_words

HIGH, LOW = (700, 720), (700, 150)


def _label(plot) -> tuple[QRectF, QRectF]:
    """Return where the words of a plot's value axis lie (without the document's margin), and the axis, in the scene."""
    axis = plot.getAxis("left")
    words = axis.label.boundingRect().adjusted(4, 4, -4, -4) if axis.labelText else QRectF()
    return axis.label.mapRectToScene(words), axis.mapRectToScene(axis.rect())


@pytest.fixture
def stack(qapp):
    stack = TimeStack("residuals")
    for name in ("before", "after", "held out"):
        stack.add_plot(name, "nm")
    stack.resize(*HIGH)
    stack.show()
    QTest.qWait(20)
    yield stack
    stack.close()
    stack.deleteLater()


def _whole(stack) -> bool:
    found = [_label(plot) for plot in stack.plots]
    return all(
        not words.height() or (axis.top() <= words.top() and words.bottom() <= axis.bottom()) for words, axis in found
    )


def test_a_longer_name_stands_in_the_middle_as_the_first_did(stack):
    for plot in stack.plots:
        plot.name_value("residual of displacement", plot.unit)
    QTest.qWait(20)
    for plot in stack.plots:
        words, axis = _label(plot)
        assert words.height() > 0 and abs(words.center().y() - axis.center().y()) < 4


def test_a_name_that_comes_to_a_low_plot_is_cut_in_no_picture(stack):
    stack.resize(*LOW)
    QTest.qWait(20)
    for plot in stack.plots:
        plot.name_value("residual of displacement", plot.unit)  # and a picture is taken before anything else happens
    assert _whole(stack)
    assert [caption_words(plot.caption) for plot in stack.plots] == 3 * ["residual of displacement (nm)"]


def test_no_unit_stands_alone_on_its_side(stack):
    for height in range(HIGH[1], 90, -7):
        stack.resize(HIGH[0], height)
        QTest.qWait(5)
        assert _whole(stack)
        for plot in stack.plots:
            shown = plot.getAxis("left").labelText
            assert (shown, caption_words(plot.caption)) in ((f"{plot.title} (nm)", ""), ("", f"{plot.title} (nm)"))
        shown = {bool(caption_words(plot.caption)) for plot in stack.plots}
        assert len(shown) == 1, height  # all beside the axes, or all inside


def test_a_plot_over_something_else_than_time_names_its_values_too(qapp):
    plot = PlainPlot("Force against speed", ("residual of the force", "mN"), "speed", SPEED)
    plot.resize(*LOW)
    plot.show()
    QTest.qWait(20)
    try:
        assert (
            not plot.plot.getAxis("left").labelText and caption_words(plot.plot.caption) == "residual of the force (mN)"
        )
        plot.resize(*HIGH)
        QTest.qWait(20)
        assert plot.plot.getAxis("left").labelText == "residual of the force (mN)" and not caption_words(
            plot.plot.caption
        )
    finally:
        plot.close()
        plot.deleteLater()


def test_a_name_longer_than_the_plot_ends_in_dots(qapp):
    plot = PlainPlot("Trend", ("restitution, quasi-static", ""), "speed", SPEED)
    plot.resize(180, 90)
    plot.show()
    QTest.qWait(20)
    try:
        caption = plot.plot.caption
        assert caption_words(caption).startswith("restit") and caption_words(caption).endswith("…")
        assert caption.boundingRect().width() <= plot.plot.view.width()
        plot.resize(700, 90)
        QTest.qWait(20)
        assert caption_words(caption) == "restitution, quasi-static"
    finally:
        plot.close()
        plot.deleteLater()


NARROW = (  # width and height of a plot, and where both its axes begin and end: pyqtgraph's own ticks overlap in each
    (221, 187, -0.000659, 0.0199),
    (195, 279, 0.06727, 0.08686),
    (184, 195, -0.000208, 0.002884),
    (245, 277, -21.1196, -20.9049),
    (145, 130, 57.609, 58.791),
    (118, 178, -27.03, -7.93),
    (291, 155, -0.000211323, -0.000209537),
    (305, 74, -6.863784, -6.854308),
    (269, 80, -6988.0, 2049.0),
    (118, 76, -260.81, -258.17),
    (148, 94, 531.6, 1577.8),
)


def _numbers(axis) -> list[tuple[float, float, str]]:
    """Return from where to where each number of an axis goes along it, and its text, as they are drawn."""
    picture = QPicture()
    painter = QPainter(picture)
    _, _, texts = axis.generateDrawSpecs(painter)
    painter.end()
    upright = axis.orientation == "left"
    return sorted((r.top(), r.bottom(), t) if upright else (r.left(), r.right(), t) for r, _, t in texts)


def _overlaps(plot) -> list[tuple[str, str]]:
    found = (_numbers(plot.plot.getAxis(side)) for side in ("left", "bottom"))
    return [(a[2], b[2]) for numbers in found for a, b in itertools.pairwise(numbers) if a[1] > b[0]]


@pytest.mark.parametrize(("wide", "high", "least", "most"), NARROW)
def test_the_numbers_of_a_small_plot_do_not_lie_over_one_another(qapp, monkeypatch, wide, high, least, most):
    plot = PlainPlot("Trend", ("restitution", ""), "speed", SPEED)
    plot.resize(wide, high)
    plot.show()
    plot.plot.view.setRange(xRange=(least, most), yRange=(least, most), padding=0.0)
    QTest.qWait(20)
    try:
        assert _overlaps(plot) == []
        assert any(_numbers(plot.plot.getAxis(side)) for side in ("left", "bottom"))
        monkeypatch.setattr(PlainAxis, "tickSpacing", pg.AxisItem.tickSpacing)
        assert _overlaps(plot)  # what is looked for is found where it is
    finally:
        plot.close()
        plot.deleteLater()


def test_a_line_of_the_grid_stands_at_a_number_and_nowhere_else(qapp):
    plot = PlainPlot("Trend", ("restitution", ""), "speed", SPEED)
    plot.apply_colours(LIGHT)
    plot.resize(*HIGH)
    plot.show()
    plot.plot.view.setRange(xRange=(0.0, 1.0), yRange=(0.0, 1.0), padding=0.0)
    QTest.qWait(20)
    try:
        for side in ("left", "bottom"):
            axis = plot.plot.getAxis(side)
            picture = QPicture()
            painter = QPainter(picture)
            _, ticks, texts = axis.generateDrawSpecs(painter)
            painter.end()
            along = 1 if side == "left" else 0
            numbers = [(rectangle.center().x(), rectangle.center().y())[along] for rectangle, _, _ in texts]
            lines = sorted(start[along] for _, start, _ in ticks)
            assert len(texts) > 3 and len(lines) > 3
            for line in lines[1:-1]:  # the outermost numbers may have no room
                assert min(abs(line - number) for number in numbers) < 1.5
            assert {pen.color().name() for pen, _, _ in ticks} == {LIGHT.grid}
    finally:
        plot.close()
        plot.deleteLater()


def test_the_grid_of_a_plot_without_numbers_is_that_of_the_plot_below(qapp):
    """In a stack the numbers of the lowest plot serve all."""

    def lines(hidden: bool) -> tuple[list[float], set[str]]:
        plot = PlainPlot("Trend", ("restitution", ""), "speed", SPEED)
        plot.apply_colours(LIGHT)
        plot.resize(*HIGH)
        if hidden:
            plot.plot.hide_bottom_values()
        plot.show()
        plot.plot.view.setRange(xRange=(0.0, 1.0), yRange=(0.0, 1.0), padding=0.0)
        QTest.qWait(20)
        picture = QPicture()
        painter = QPainter(picture)
        _, ticks, _ = plot.plot.getAxis("bottom").generateDrawSpecs(painter)
        painter.end()
        plot.close()
        plot.deleteLater()
        return sorted(start[0] for _, start, _ in ticks), {pen.color().name() for pen, _, _ in ticks}

    (with_numbers, colour), (without, other) = lines(False), lines(True)
    assert len(without) == len(with_numbers) > 3 and colour == other == {LIGHT.grid}

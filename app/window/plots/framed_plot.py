"""A view box with two axes: pyqtgraph's PlotItem without its menu of 40 widgets, which is not used here."""

import math
from typing import Any

import pyqtgraph as pg
from pyqtgraph import Point
from PySide6.QtCore import QPointF, QRectF, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QFontMetricsF, QPainter
from PySide6.QtWidgets import QGraphicsGridLayout

from app.window.plots.curve import Band, PointCurve, SampledCurve
from app.window.plots.lines import CrispCurve, straight
from app.window.theme import LIGHT, Colours
from app.words import local

BEHIND = -1000


def _round_up(distance: float) -> float:
    """Return the least of 1, 2, 5, 10, 20 ... that is not below a distance."""
    decade = 10.0 ** math.floor(math.log10(max(distance, 1e-300)))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= distance * (1.0 - 1e-9))


class PlainAxis(pg.AxisItem):
    """The axis; finer ticks may have numbers, but no lines."""

    fitted = Signal(bool)  # whether the whole label is shown

    def __init__(self, orientation: str) -> None:
        self._whole = self._label_shown = ""
        self._fits = True
        self._group = [self]
        self._later = QTimer()
        self._later.setSingleShot(True)
        super().__init__(orientation)
        self._later.setParent(self)
        self._later.timeout.connect(self._fit_label)
        self._grid_pen = pg.mkPen("#e4e8ed")
        # drawn when it changes and copied otherwise: most pictures of LIVE show the same axis
        self.setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)

    def dress(self, line: str, text: str, grid: str) -> None:
        self._grid_pen = straight(grid)
        self.setPen(straight(line))
        self.setTextPen(pg.mkPen(text))
        self.setGrid(255)
        self.setZValue(BEHIND)

    def resizeEvent(self, ev: Any = None) -> None:
        """Fit the label after the event: changing it while it is drawn crashes Qt."""
        super().resizeEvent(ev)
        self._later.start()

    @Slot()
    def _fit_label(self) -> None:
        """Show the whole label, only its unit, or nothing, so that it is never cut.

        A value axis does not show its unit alone ("V" on its side reads as ">"); the plot shows the name instead.
        """
        if not self._whole:
            return
        self._fits = self._has_room(self._whole)
        for axis in self._group:
            axis._show_label(all(other._fits for other in self._group if other.isVisible()))

    def _has_room(self, text: str) -> bool:
        room = self.size().height() if self.orientation == "left" else self.size().width()
        return QFontMetricsF(self.label.font()).horizontalAdvance(text) + 8 <= room

    def _show_label(self, whole: bool) -> None:
        unit = self._whole[self._whole.rfind("(") + 1 :].partition(")")[0]
        text = self._whole if whole else unit if self.orientation != "left" and self._has_room(unit) else ""
        if text != self._label_shown:
            self._label_shown = self.labelText = text
            self.label.setHtml(self.labelString())
        super().resizeEvent(None)  # centre the label again
        self.fitted.emit(text == self._whole)

    def share_labels(self, others: "list[PlainAxis]") -> None:
        """Join the axes in ``others``: all of them show their whole label, or none does."""
        others.append(self)
        self._group = others

    def setLabel(self, text: str | None = None, *args: Any, **kwargs: Any) -> None:
        self._whole = self._label_shown = text or ""
        super().setLabel(text, *args, **kwargs)
        self._fit_label()  # at once, so that it is never drawn cut

    def generateDrawSpecs(self, p: QPainter) -> Any:
        """Keep only the lines of the coarsest ticks."""
        specs = super().generateDrawSpecs(p)
        if specs is None or not specs[1]:
            return specs
        axis, ticks, texts = specs
        strongest = max(pen.color().alpha() for pen, _, _ in ticks)
        kept = [(self._grid_pen, a, b) for pen, a, b in ticks if pen.color().alpha() >= strongest]
        return axis, kept, texts

    def tickSpacing(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, float]]:
        """Return the spacings of ticks at which their numbers do not overlap."""
        found: list[tuple[float, float]] = super().tickSpacing(minVal, maxVal, size)
        if not found or size <= 0.0 or self.logMode:
            return found
        metrics = QFontMetricsF(self.style["tickFont"] or self.font())

        def least(spacing: float) -> float:
            room = metrics.height()
            if self.orientation != "left":  # the wider of both ends, and a gap
                ends = self.tickStrings([minVal, maxVal], self.autoSIPrefixScale, spacing)
                room = max(map(metrics.horizontalAdvance, ends)) + metrics.horizontalAdvance("0")
            return room * abs(maxVal - minVal) / size

        kept = [(spacing, offset) for spacing, offset in found if spacing >= least(spacing)]
        if kept or self.orientation == "left":
            return kept or [(_round_up(least(found[0][0])), 0.0)]
        spacing = found[0][0]  # every so many of these, one of them in the middle
        middle = round(0.5 * (minVal + maxVal) / spacing) * spacing
        return [(math.ceil(least(spacing) / spacing) * spacing, middle)]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the ticks in the system's decimal format."""
        return [local(text) for text in super().tickStrings(values, scale, spacing)]


class QuietView(pg.ViewBox):
    """A view box that emits clicks; dragging moves one axis, with Shift it draws a box to zoom to."""

    clicked = Signal(float, float)
    y_taken = Signal(bool)
    moved = Signal()  # by hand, perhaps not finished
    placed = Signal()  # by hand, finished

    def __init__(self) -> None:
        super().__init__(enableMenu=False, defaultPadding=0.0)
        self.disableAutoRange()

    def mouseClickEvent(self, event: object) -> None:
        """Emit a left click in the plot's units."""
        if event.button() == Qt.MouseButton.LeftButton:  # type: ignore[attr-defined]
            point: QPointF = self.mapSceneToView(event.scenePos())  # type: ignore[attr-defined]
            self.clicked.emit(point.x(), point.y())
            event.accept()  # type: ignore[attr-defined]

    def wheelEvent(self, event: object, axis: int | None = None) -> None:
        """Zoom time with the wheel; with Ctrl, or over the left axis, zoom the value."""
        by_control = event.modifiers() & Qt.KeyboardModifier.ControlModifier  # type: ignore[attr-defined]
        chosen = 1 if (axis == 1 or by_control) else 0
        if chosen == 1:
            self.y_taken.emit(True)
        super().wheelEvent(event, axis=chosen)
        self.moved.emit()

    def mouseDragEvent(self, event: object, axis: int | None = None) -> None:
        """Drag in time; over the left axis, or with Ctrl, drag the value; with Shift draw a box to zoom to."""
        if axis is None and event.modifiers() & Qt.KeyboardModifier.ShiftModifier:  # type: ignore[attr-defined]
            self._draw_box(event)
            return
        by_control = event.modifiers() & Qt.KeyboardModifier.ControlModifier  # type: ignore[attr-defined]
        chosen = 1 if (axis == 1 or by_control) else 0
        if chosen == 1:
            self.y_taken.emit(True)
        super().mouseDragEvent(event, axis=chosen)
        self.moved.emit()

    def _draw_box(self, event: Any) -> None:
        """Draw the box, and zoom to it when the button is released."""
        event.accept()
        if not event.isFinish():
            self.updateScaleBox(event.buttonDownPos(), event.pos())
            return
        self.rbScaleBox.hide()
        box = QRectF(Point(event.buttonDownPos(event.button())), Point(event.pos()))
        self.zoom_to(self.childGroup.mapRectFromParent(box.normalized()))

    def zoom_to(self, box: QRectF) -> None:
        """Zoom to a box in the plot's units; one without area is ignored."""
        if box.width() > 0.0 and box.height() > 0.0:
            self.y_taken.emit(True)
            self.setRange(xRange=(box.left(), box.right()), yRange=(box.top(), box.bottom()), padding=0)
            self.placed.emit()


Span = tuple[float, float]
ViewState = tuple[Span, Span, bool]  # x, y, and whether y was set by hand
VIEW_AT = (0, 1)  # row and column
AXES_AT = {"left": (0, 0), "bottom": (1, 1)}
AXIS_WIDTH = 74  # wide enough for "-0.00025", so that linked plots stay aligned while values change


class FramedPlot(pg.GraphicsWidget):
    """Curves with a bottom and a left axis, the name of their value and its unit.

    A PlotItem takes 15 ms to make, more than half of it for its menu: half a second for thirty plots.
    """

    def __init__(self, title: str, unit: str, axis_kind: type[PlainAxis] = PlainAxis) -> None:
        super().__init__()
        self.colours = LIGHT
        self.view = QuietView()
        self.sampled: list[SampledCurve | PointCurve] = []  # what the cursors read
        self._axes = {side: axis_kind(side) for side in AXES_AT}
        grid = QGraphicsGridLayout()
        grid.setContentsMargins(1, 1, 1, 1)
        grid.setSpacing(0)
        self.setLayout(grid)
        grid.addItem(self.view, *VIEW_AT)
        grid.setRowStretchFactor(VIEW_AT[0], 100)
        grid.setColumnStretchFactor(VIEW_AT[1], 100)
        for side, axis in self._axes.items():
            grid.addItem(axis, *AXES_AT[side])
            axis.linkToView(self.view)
            axis.enableAutoSIPrefix(False)
        self.getAxis("left").setWidth(AXIS_WIDTH)
        self.caption = Caption(self)
        self.name_value(title, unit)

    def name_value(self, title: str, unit: str) -> None:
        """Set name and unit of the value."""
        self.title, self.unit = title, unit
        words = f"{title} ({unit})" if unit else title
        self.caption.say(words)
        self.setLabel("left", words)

    def dress(self, colours: Colours) -> None:
        """Set the colours of axes, grid, curves and bands."""
        self.colours = colours
        for axis in self._axes.values():
            axis.dress(colours.edge, colours.text, colours.grid)
        self.caption.dress(colours)
        for item in self.view.addedItems:
            if isinstance(item, CrispCurve | Band):
                item.dress(colours)

    def addItem(self, item: Any, ignoreBounds: bool = False) -> None:
        """Draw an item in the plot's own units."""
        self.view.addItem(item, ignoreBounds)
        if isinstance(item, CrispCurve | Band):
            item.dress(self.colours)

    def add_band(self) -> Band:
        """Add an empty noise band behind the curves, its edges above them."""
        band = Band()
        for item in (band, *band.edges):
            self.addItem(item)
        return band

    @property
    def state(self) -> ViewState:
        """Get what is in view."""
        (left, right), (low, high) = self.view.viewRange()
        return (left, right), (low, high), True

    def bring(self, state: ViewState) -> None:
        """Show again what was in view."""
        x, y, _ = state
        self.view.setRange(xRange=x, yRange=y, padding=0)

    def getAxis(self, side: str) -> PlainAxis:
        return self._axes[side]

    def hide_bottom_values(self) -> None:
        """Show no numbers at the bottom axis: those of the plot below, with the same axis, serve both."""
        bottom = self.getAxis("bottom")
        bottom.setStyle(showValues=False)
        bottom.setHeight(6)
        bottom.showLabel(False)

    def setLabel(self, side: str, text: str) -> None:
        self._axes[side].setLabel(text)

    def setXLink(self, other: "FramedPlot") -> None:
        self.view.setXLink(other.view)


ON_TOP = 30
_MARGIN = 8  # of the text item


class Caption(pg.TextItem):
    """Words in a plot's corner; hidden while the value axis shows them in full."""

    def __init__(self, plot: FramedPlot) -> None:
        super().__init__("", anchor=(0, 0))
        self._words = ""
        self._view = plot.view
        self.setParentItem(self._view)
        self.setZValue(ON_TOP)
        self.hide()
        plot.getAxis("left").fitted.connect(self._label_fitted)
        self._view.sigResized.connect(self._fit)

    @property
    def shown(self) -> str:
        """Get the words, "" while the axis shows them."""
        return str(self.toPlainText()) if self.isVisible() else ""

    def say(self, words: str) -> None:
        """Set the words; they are shortened to the width."""
        self._words = words
        self._fit()

    def dress(self, colours: Colours) -> None:
        self.setColor(colours.text)
        self.fill = pg.mkBrush(f"{colours.plot}a0")  # half transparent

    @Slot(bool)
    def _label_fitted(self, whole: bool) -> None:
        self.setVisible(not whole)

    @Slot()
    def _fit(self) -> None:
        room = self._view.width() - _MARGIN
        self.setText(QFontMetricsF(self.textItem.font()).elidedText(self._words, Qt.TextElideMode.ElideRight, room))

"""A plot with two axes: a light replacement of pyqtgraph's PlotItem, without its menu of 40 widgets."""

from typing import Any, TypeVar

import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt, Signal, Slot
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import QGraphicsGridLayout

from app.window.controls.theme import LIGHT, Colours
from app.window.plots.axis import PlainAxis
from app.window.plots.curve import Band, PointCurve, SampledCurve
from app.window.plots.lines import CrispCurve


class PlotViewBox(pg.ViewBox):
    """A view box that emits clicks; dragging moves one axis, dragging with Shift zooms to a box."""

    clicked = Signal(float)  # x
    y_set_by_user = Signal(bool)
    moved = Signal()  # the operator is moving the view

    def __init__(self) -> None:
        super().__init__(enableMenu=False, defaultPadding=0.0)
        self.disableAutoRange()

    def mouseClickEvent(self, event: object) -> None:
        """Emit the x of a left click in the plot's units."""
        if event.button() == Qt.MouseButton.LeftButton:  # type: ignore[attr-defined]
            point: QPointF = self.mapSceneToView(event.scenePos())  # type: ignore[attr-defined]
            self.clicked.emit(point.x())
            event.accept()  # type: ignore[attr-defined]

    def wheelEvent(self, event: object, axis: int | None = None) -> None:
        """Zoom x with the wheel; with Ctrl, or over the left axis, zoom y."""
        super().wheelEvent(event, axis=self._axis_of(event, axis))
        self.moved.emit()

    def mouseDragEvent(self, event: object, axis: int | None = None) -> None:
        """Drag along x; over the left axis, or with Ctrl, drag along y; with Shift draw a box to zoom to."""
        boxed = axis is None and event.modifiers() & Qt.KeyboardModifier.ShiftModifier  # type: ignore[attr-defined]
        self.setMouseMode(self.RectMode if boxed else self.PanMode)
        super().mouseDragEvent(event, axis=None if boxed else self._axis_of(event, axis))
        self.moved.emit()

    def _axis_of(self, event: object, axis: int | None) -> int:
        """Return the axis that the mouse moves: 1 (y) over the left axis or with Ctrl, else 0 (x).

        Moving y ends its automatic fit to the curves.
        """
        by_control = event.modifiers() & Qt.KeyboardModifier.ControlModifier  # type: ignore[attr-defined]
        if axis != 1 and not by_control:
            return 0
        self.y_set_by_user.emit(True)
        return 1

    def showAxRect(self, ax: QRectF, **how: Any) -> None:
        """Zoom to a box in the plot's units; a box without area is ignored."""
        if ax.width() and ax.height():
            self.y_set_by_user.emit(True)
            super().showAxRect(ax, padding=0, **how)


Drawn = TypeVar("Drawn", SampledCurve, PointCurve)
Span = tuple[float, float]
ViewState = tuple[Span, Span, bool]  # x range, y range, whether the operator has set y
VIEW_AT = (0, 1)  # (row, column) in the layout
AXES_AT = {"left": (0, 0), "bottom": (1, 1)}
AXIS_WIDTH = 74  # wide enough for "-0.00025", so that linked plots stay aligned while values change


class FramedPlot(pg.GraphicsWidget):
    """A plot of curves with a bottom and a left axis, name and unit of its value.

    It replaces PlotItem, which takes 15 ms to make, more than half of it for its menu: 0.5 s for thirty plots.
    """

    def __init__(self, title: str, unit: str, axis_kind: type[PlainAxis] = PlainAxis) -> None:
        view, axes = PlotViewBox(), {side: axis_kind(side) for side in AXES_AT}  # made before their parent
        super().__init__()
        self.colours = LIGHT
        self.view, self._axes = view, axes
        self.y_by_hand = True  # False: y follows the data, see TimePlot
        self.sampled: list[SampledCurve | PointCurve] = []  # the curves that the cursors read
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
        self.title, self.unit = title, unit
        left = self.getAxis("left")
        left.name_quantity(title, unit)
        self.caption.say(left.whole)

    def apply_colours(self, colours: Colours) -> None:
        """Apply colours to axes, grid, curves and bands."""
        self.colours = colours
        for axis in self._axes.values():
            axis.apply_colours(colours.edge, colours.text, colours.grid)
        self.caption.apply_colours(colours)
        for item in self.view.addedItems:
            if isinstance(item, CrispCurve | Band):
                item.apply_colours(colours)

    def addItem(self, item: Any, ignoreBounds: bool = False) -> None:
        self.view.addItem(item, ignoreBounds)
        if isinstance(item, CrispCurve | Band):
            item.apply_colours(self.colours)

    def added(self, curve: Drawn) -> Drawn:
        """Add a curve that the cursors read, and return it."""
        self.addItem(curve)
        self.sampled.append(curve)
        return curve

    def add_band(self) -> Band:
        """Add an empty noise band behind the curves, with its edges above them."""
        band = Band()
        for item in (band, *band.edges):
            self.addItem(item)
        return band

    @property
    def state(self) -> ViewState:
        """Get the ranges in view, and whether the operator has set y."""
        (left, right), (low, high) = self.view.viewRange()
        return (left, right), (low, high), self.y_by_hand

    def restore(self, state: ViewState) -> None:
        self.y_by_hand = True  # prevents a fit of y while x changes
        x, y, by_hand = state
        self.view.setRange(xRange=x, yRange=y, padding=0)
        self.y_by_hand = by_hand

    def getAxis(self, side: str) -> PlainAxis:
        return self._axes[side]

    def hide_bottom_values(self) -> None:
        """Hide the numbers of the bottom axis, because the plot below has the same axis."""
        bottom = self.getAxis("bottom")
        bottom.setStyle(showValues=False)
        bottom.setHeight(6)
        bottom.showLabel(False)


ON_TOP = 30
_MARGIN = 8  # margin of the text item in pixels


class Caption(pg.TextItem):
    """Name and unit in a plot's corner; hidden while the left axis shows its whole label."""

    def __init__(self, plot: FramedPlot) -> None:
        super().__init__("", anchor=(0, 0))
        self._words = ""
        self._view = plot.view
        self.setParentItem(self._view)
        self.setZValue(ON_TOP)
        self.hide()
        plot.getAxis("left").fitted.connect(self._label_fitted)
        self._view.sigResized.connect(self._fit)

    def say(self, words: str) -> None:
        """Set the text, which is shortened to the width."""
        self._words = words
        self._fit()

    def apply_colours(self, colours: Colours) -> None:
        self.setColor(colours.text)
        self.fill = pg.mkBrush(f"{colours.plot}a0")  # half transparent

    @Slot(bool)
    def _label_fitted(self, whole: bool) -> None:
        self.setVisible(not whole)

    @Slot()
    def _fit(self) -> None:
        room = self._view.width() - _MARGIN
        self.setText(QFontMetricsF(self.textItem.font()).elidedText(self._words, Qt.TextElideMode.ElideRight, room))

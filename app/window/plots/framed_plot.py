"""A view box with two axes: pyqtgraph's PlotItem without its menu of 40 widgets, which is not used here."""

from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import QGraphicsGridLayout

from app.window.plots.plain_axis import PlainAxis
from app.window.theme import Colours

VIEW_AT = (0, 1)  # row and column
AXES_AT = {"left": (0, 0), "bottom": (1, 1)}


class FramedPlot(pg.GraphicsWidget):
    """Curves with a bottom and a left axis.

    A PlotItem takes 15 ms to make, more than half of it for its menu: half a second for thirty plots.
    """

    def __init__(self, view: pg.ViewBox, axes: dict[str, PlainAxis]) -> None:
        super().__init__()
        self.view = view
        self._axes = axes
        grid = QGraphicsGridLayout()
        grid.setContentsMargins(1, 1, 1, 1)
        grid.setSpacing(0)
        self.setLayout(grid)
        grid.addItem(view, *VIEW_AT)
        grid.setRowStretchFactor(VIEW_AT[0], 100)
        grid.setColumnStretchFactor(VIEW_AT[1], 100)
        for side, axis in axes.items():
            grid.addItem(axis, *AXES_AT[side])
            axis.linkToView(view)
            axis.enableAutoSIPrefix(False)

    def addItem(self, item: Any, ignoreBounds: bool = False) -> None:
        """Draw an item in the plot's own units."""
        self.view.addItem(item, ignoreBounds)

    def getAxis(self, side: str) -> PlainAxis:
        """Return the "left" or the "bottom" axis."""
        return self._axes[side]

    def setLabel(self, side: str, text: str) -> None:
        """Name an axis."""
        self._axes[side].setLabel(text)

    def setXLink(self, other: "FramedPlot") -> None:
        """Link x to that of another plot."""
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

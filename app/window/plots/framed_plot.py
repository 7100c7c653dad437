"""A view box with its two axes: pyqtgraph's PlotItem without the 40 widgets of a menu that no plot here opens."""

from typing import Any

import pyqtgraph as pg
from PySide6.QtWidgets import QGraphicsGridLayout

from app.window.plots.plain_axis import PlainAxis

VIEW_AT = (0, 1)  # row and column
AXES_AT = {"left": (0, 0), "bottom": (1, 1)}


class FramedPlot(pg.GraphicsWidget):
    """Curves over a bottom and a left axis.

    A PlotItem takes 15 ms to make, of which the transforms, averages and sliders of its own menu are more than half;
    a window of thirty plots opened half a second later for them.
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
        """Keep the span of x that the other has."""
        self.view.setXLink(other.view)

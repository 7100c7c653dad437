"""A plot that is not over time: fixed range, its own menu, saved as picture, drawing or table like every other."""

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, Qt, Signal, Slot
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QMenu, QWidget

from app.plots.plain_axis import PlainAxis
from app.plots.time_plot import AXIS_WIDTH
from app.theme import Colours

Span = tuple[float, float]


class PlainPlot(pg.PlotWidget):
    """One plot; ``columns`` are what its CSV holds, and ``samples`` says whether it has any."""

    export_wanted = Signal(object, str)

    def __init__(self, name: str, left: str, bottom: str, parent: QWidget | None = None, samples: bool = True) -> None:
        axes = {side: PlainAxis(side) for side in ("left", "bottom")}
        super().__init__(parent, enableMenu=False, axisItems=axes)
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        item = self.getPlotItem()
        item.hideButtons()
        for side, words in (("left", left), ("bottom", bottom)):
            item.getAxis(side).enableAutoSIPrefix(False)
            item.setLabel(side, words)
        item.getAxis("left").setWidth(AXIS_WIDTH)
        item.getViewBox().disableAutoRange()
        self.columns: dict[str, NDArray[np.float64]] = {}
        self._samples = samples
        self._whole: tuple[Span, Span] | None = None

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self.setBackground(colours.plot)
        for side in ("left", "bottom"):
            self.getPlotItem().getAxis(side).dress(colours.edge, colours.text, colours.grid)

    def show_range(self, x: Span, y: Span) -> None:
        """Show this range, and come back to it by ``reset``."""
        self._whole = (x, y)
        self.reset()

    @Slot()
    def reset(self) -> None:
        """Show the whole again."""
        if self._whole is not None:
            x, y = self._whole
            self.getPlotItem().getViewBox().setRange(xRange=x, yRange=y, padding=0)

    def menu(self) -> QMenu:
        """Return a fresh menu."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Reset the view", self.reset)
        menu.addSeparator()
        menu.addAction("Save as PNG …", self._png)
        menu.addAction("Save as SVG …", self._svg)
        if self._samples:
            menu.addAction("Save the values as CSV …", self._csv)
        return menu

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Open the plot's own menu."""
        self.menu().popup(event.globalPos())
        event.accept()

    def open_menu(self) -> None:
        """Open the menu by key."""
        self.menu().popup(self.mapToGlobal(QPoint(20, 20)))

    @Slot()
    def _png(self) -> None:
        self.export_wanted.emit(self, "png")

    @Slot()
    def _svg(self) -> None:
        self.export_wanted.emit(self, "svg")

    @Slot()
    def _csv(self) -> None:
        self.export_wanted.emit(self, "csv")

"""Plots above one another on one time axis, with two cursors and a menu of their own."""

import pyqtgraph as pg
from PySide6.QtCore import QPoint, Qt, Signal, Slot
from PySide6.QtGui import QAction, QContextMenuEvent
from PySide6.QtWidgets import QMenu, QWidget

from app.plots.cursors import Cursors
from app.plots.time_plot import TimePlot
from app.theme import Colours


class TimeStack(pg.GraphicsLayoutWidget):
    """Linked time plots; x is in ms, y in each plot's own unit."""

    clicked = Signal(float)
    export_wanted = Signal(str)
    reset_wanted = Signal()

    def __init__(self, name: str, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name = name
        self.setAccessibleName(name)
        self.plots: list[TimePlot] = []
        self.colours = colours
        self.ci.layout.setSpacing(2)
        self.ci.layout.setContentsMargins(4, 4, 10, 4)
        self.cursors = Cursors(self)
        self.actions_added: list[QAction] = []
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)

    def add_plot(self, title: str, unit: str, stretch: int = 3) -> TimePlot:
        """Add a plot below the others."""
        plot = TimePlot(title, unit)
        row = len(self.plots)
        self.addItem(plot, row=row, col=0)
        self.ci.layout.setRowStretchFactor(row, stretch)
        if self.plots:
            plot.setXLink(self.plots[0])
            before = self.plots[-1].getAxis("bottom")
            before.setStyle(showValues=False)
            before.setHeight(6)
            before.showLabel(False)
        self.plots.append(plot)
        plot.view.clicked.connect(self._clicked)
        plot.dress(self.colours)
        self.cursors.join(plot)
        return plot

    def label_time(self, text: str) -> None:
        """Set the label of the time axis, which only the lowest plot shows."""
        self.plots[-1].setLabel("bottom", text)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self.colours = colours
        self.setBackground(colours.plot)
        for plot in self.plots:
            plot.dress(colours)
        self.cursors.dress(colours)

    def zoom(self, left: float, right: float) -> None:
        """Show the time from left to right in every plot, values fitted."""
        for plot in self.plots:
            plot.free_y()
        self.plots[0].view.setXRange(left, right, padding=0)
        for plot in self.plots:
            plot.fit_y()

    @property
    def span(self) -> tuple[float, float]:
        """Get the time in view."""
        (left, right), _ = self.plots[0].view.viewRange()
        return float(left), float(right)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Open the plot's own menu."""
        self.menu().popup(event.globalPos())
        event.accept()

    def menu(self) -> QMenu:
        """Return a fresh menu: view, cursors, export."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for action in self.actions_added:
            menu.addAction(action)
        menu.addAction("Reset the view", self._reset)
        cursors = menu.addAction("Cursors")
        cursors.setCheckable(True)
        cursors.setChecked(self.cursors.shown)
        cursors.toggled.connect(self.show_cursors)
        menu.addSeparator()
        menu.addAction("Save as PNG …", self._png)
        menu.addAction("Save as SVG …", self._svg)
        menu.addAction("Save the samples in view as CSV …", self._csv)
        return menu

    @Slot(bool)
    def show_cursors(self, shown: bool) -> None:
        """Show or hide the cursors, placed at a third and two thirds of the view when they come."""
        left, right = self.span
        self.cursors.show(shown, left, right)

    @Slot()
    def _reset(self) -> None:
        self.reset_wanted.emit()

    @Slot()
    def _png(self) -> None:
        self.export_wanted.emit("png")

    @Slot()
    def _svg(self) -> None:
        self.export_wanted.emit("svg")

    @Slot()
    def _csv(self) -> None:
        self.export_wanted.emit("csv")

    @Slot(float, float)
    def _clicked(self, x: float, _y: float) -> None:
        self.clicked.emit(x)

    def open_menu(self) -> None:
        """Open the menu by key, at the widget's corner."""
        self.menu().popup(self.mapToGlobal(QPoint(20, 20)))

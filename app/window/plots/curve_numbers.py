"""Numbers on overlaid curves, so that they differ not only in colour."""

import pyqtgraph as pg
from PySide6.QtCore import QObject, Slot

from app.window.plots.curve import SampledCurve
from app.window.plots.framed_plot import ON_TOP
from app.window.plots.time_plot import TimePlot
from app.window.theme import Colours


class CurveNumbers(QObject):
    """The numbers are on their curves, spread over the view."""

    def __init__(self, plot: TimePlot, parent: QObject) -> None:
        super().__init__(parent)
        self._plot = plot
        self._curves: list[SampledCurve] = []
        self._items: list[pg.TextItem] = []
        plot.view.sigXRangeChanged.connect(self.place)

    def show(self, curves: list[SampledCurve], numbers: list[str], colours: Colours) -> None:
        """Put these numbers on these curves."""
        while len(self._items) < len(curves):
            item = pg.TextItem(anchor=(0.5, 0.5))
            item.setZValue(ON_TOP)
            self._plot.addItem(item, ignoreBounds=True)
            self._items.append(item)
        self._curves = curves
        for index, item in enumerate(self._items):
            item.setVisible(index < len(curves))
            if index < len(curves):
                item.setText(numbers[index], colours.series[index % len(colours.series)])
                item.fill = pg.mkBrush(colours.plot)
        self.place()

    @Slot()
    def place(self) -> None:
        """Spread the numbers over the view."""
        (left, right), _ = self._plot.view.viewRange()
        for index, curve in enumerate(self._curves):
            at = left + (index + 1) / (len(self._curves) + 1) * (right - left)
            value = curve.value_at(at)
            seen = value == value
            self._items[index].setVisible(seen)
            if seen:
                self._items[index].setPos(at, value)

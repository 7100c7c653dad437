"""Plots above each other with one time axis."""

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QWidget

from app.window.plots.axis import PlainAxis
from app.window.plots.cursors import TIME, CursorAxis
from app.window.plots.framed_plot import Span
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimePlot


class TimeStack(PlotView):
    """Linked time plots; x is in the unit of ``axis``."""

    clicked = Signal(float)
    plots: tuple[TimePlot, ...]

    def __init__(self, name: str, parent: QWidget | None = None, axis: CursorAxis = TIME) -> None:
        super().__init__(name, axis, parent)
        self.whole: Span | None = None  # the range of time that ``reset`` shows; None: it only fits the values
        self._value_axes: list[PlainAxis] = []

    def add_plot(self, title: str, unit: str, stretch: int = 3) -> TimePlot:
        plot = TimePlot(title, unit)
        if self.plots:
            plot.view.setXLink(self.plots[0].view)
            self.plots[-1].hide_bottom_values()
        self.join(plot)
        self.ci.layout.setRowStretchFactor(len(self.plots) - 1, stretch)
        plot.view.clicked.connect(self._clicked)
        plot.getAxis("left").share_labels(self._value_axes)
        return plot

    def label_time(self, text: str) -> None:
        """Set the label of the time axis, which only the lowest plot shows."""
        self.plots[-1].getAxis("bottom").setLabel(text)

    def zoom(self, left: float, right: float) -> None:
        """Show this range of time in every plot, and fit the values."""
        for plot in self.plots:
            plot.free_y()
        self.show_span(left, right)
        for plot in self.plots:
            plot.fit_y()
        self.note_now()

    def show_whole(self, left: float, right: float) -> None:
        """Show this range of time, to which ``reset`` returns."""
        self.whole = left, right
        self.reset()

    @Slot()
    def reset(self) -> None:
        self.zoom(*(self.whole or self.span))

    @Slot(float, float)
    def _clicked(self, x: float, _y: float) -> None:
        self.clicked.emit(x)

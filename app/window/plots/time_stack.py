"""Plots above each other with one time axis."""

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QWidget

from app.window.plots.cursors import TIME, CursorAxis
from app.window.plots.framed_plot import PlainAxis
from app.window.plots.plot_view import PlotView, Span, ViewState
from app.window.plots.time_plot import TimePlot
from app.window.theme import Colours


class TimeStack(PlotView):
    """Linked time plots; x is in the unit of ``axis``.  The owner resets the view at ``reset_wanted``."""

    clicked = Signal(float)
    reset_wanted = Signal()

    def __init__(self, name: str, parent: QWidget | None = None, axis: CursorAxis = TIME) -> None:
        super().__init__(name, axis, parent)
        self.plots: list[TimePlot] = []
        self._value_axes: list[PlainAxis] = []

    def add_plot(self, title: str, unit: str, stretch: int = 3) -> TimePlot:
        plot = TimePlot(title, unit)
        row = len(self.plots)
        self.addItem(plot, row=row, col=0)
        self.ci.layout.setRowStretchFactor(row, stretch)
        if self.plots:
            plot.setXLink(self.plots[0])
            self.plots[-1].hide_bottom_values()
        self.plots.append(plot)
        plot.view.clicked.connect(self._clicked)
        plot.view.moved.connect(self.note_view)
        plot.view.placed.connect(self.note_now)
        plot.dress(self.colours)
        plot.getAxis("left").share_labels(self._value_axes)
        self.cursors.join(plot)
        return plot

    def label_time(self, text: str) -> None:
        """Set the label of the time axis, which only the lowest plot shows."""
        self.plots[-1].setLabel("bottom", text)

    def dress(self, colours: Colours) -> None:
        super().dress(colours)
        for plot in self.plots:
            plot.dress(colours)

    def zoom(self, left: float, right: float) -> None:
        """Show this range of time in every plot, and fit the values."""
        for plot in self.plots:
            plot.free_y()
        self.show_span(left, right)
        for plot in self.plots:
            plot.fit_y()
        self.note_now()

    @property
    def states(self) -> tuple[ViewState, ...]:
        return tuple(plot.state for plot in self.plots)

    def bring(self, states: tuple[ViewState, ...]) -> None:
        for plot, state in zip(self.plots, states, strict=True):
            plot.bring(state)

    def show_span(self, left: float, right: float) -> None:
        """Show this range of time; a value axis set by hand stays."""
        self.plots[0].view.setXRange(left, right, padding=0)

    @property
    def span(self) -> Span:
        (left, right), _ = self.plots[0].view.viewRange()
        return float(left), float(right)

    @Slot()
    def reset(self) -> None:
        self.reset_wanted.emit()

    @Slot(float, float)
    def _clicked(self, x: float, _y: float) -> None:
        self.clicked.emit(x)

"""Plots over time, above each other with one time axis; the value axis follows the data in view, at a fixed width."""

import math
from collections.abc import Mapping

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QWidget

from app.window.plots.axis import PlainAxis
from app.window.plots.cursors import TIME, CursorAxis
from app.window.plots.curve import Band, PointCurve, SampledCurve
from app.window.plots.framed_plot import FramedPlot, Span, ViewState
from app.window.plots.lines import Look, straight
from app.window.plots.plot_view import PlotView
from app.window.theme import Colours

_ROOM = 1.5  # span of a steady axis over that of the values, so that noise does not move it
_LOOSEST = 4.0  # span of a steady axis over that of the values, from which it is fitted again
LEAST_NAMED_LINES = 4  # least height for names of levels, in lines of text


class TimePlot(FramedPlot):
    """A plot of sampled curves over a shared time axis."""

    def __init__(self, title: str, unit: str) -> None:
        super().__init__(title, unit)
        self.bands: list[Band] = []
        self.marks: list[pg.InfiniteLine] = []
        self._levels: list[pg.InfiniteLine] = []
        self.levels: dict[str, float] = {}  # of ``show_levels``
        self.minimum_span = 0.0
        self.steady = False  # for running curves: the value axis moves only when necessary
        self._y_by_hand = False
        self.view.sigXRangeChanged.connect(self.fit_y)
        self.view.sigResized.connect(self._resized)
        self.view.y_taken.connect(self._take_y)

    def dress(self, colours: Colours) -> None:
        super().dress(colours)
        for mark in self.marks:
            mark.setPen(straight(colours.marker, Qt.PenStyle.DotLine))

    def add_curve(self, label: str, look: Look) -> SampledCurve:
        """Add an empty curve."""
        return self.added(SampledCurve(label, look))

    def add_points(self, label: str, look: Look) -> PointCurve:
        """Add an empty curve of points that are decimated already."""
        return self.added(PointCurve(label, look))

    def add_band(self) -> Band:
        """Add an empty noise band, which the value axis includes."""
        band = super().add_band()
        self.bands.append(band)
        return band

    def mark(self, times: list[float]) -> None:
        """Show vertical dotted lines at these x only."""
        while len(self.marks) < len(times):
            line = pg.InfiniteLine(angle=90, pen=straight(self.colours.marker, Qt.PenStyle.DotLine))
            line.setZValue(-5)
            self.addItem(line, ignoreBounds=True)
            self.marks.append(line)
        for index, line in enumerate(self.marks):
            line.setVisible(index < len(times))
            if index < len(times):
                line.setValue(times[index])

    def mark_level(self, level: float, words: str) -> None:
        """Show a horizontal dotted line at a value, named at its right end."""
        line = pg.InfiniteLine(
            level, angle=0, label=words, labelOpts={"position": 0.97, "anchors": [(1, 0), (1, 0)], "color": "#888888"}
        )
        line.setPen(straight("#888888", Qt.PenStyle.DotLine))
        line.setToolTip(words)  # in a low plot it has no name beside it
        line.setZValue(-5)
        self.addItem(line, ignoreBounds=True)
        self._levels.append(line)

    def show_levels(self, levels: Mapping[str, float]) -> None:
        """Show these levels only, by their words; the value axis includes them."""
        if dict(levels) == self.levels:
            return
        for line in self._levels:
            self.view.removeItem(line)
        self._levels.clear()
        self.levels = dict(levels)
        for words, level in self.levels.items():
            self.mark_level(level, words)
        self._name_levels()

    @property
    def state(self) -> ViewState:
        """Get what is in view, and whether the value axis was set by hand."""
        x, y, _ = super().state
        return x, y, self._y_by_hand

    def bring(self, state: ViewState) -> None:
        self._y_by_hand = True  # so that the values are not fitted meanwhile
        super().bring(state)
        self._y_by_hand = state[2]

    def free_y(self) -> None:
        """Let the value axis follow the data again."""
        self._y_by_hand = False
        self.fit_y(anew=True)

    @Slot(bool)
    def _take_y(self, taken: bool) -> None:
        self._y_by_hand = taken

    @Slot()
    def _resized(self) -> None:
        for curve in self.sampled:
            curve.redraw()
        self._name_levels()

    def _name_levels(self) -> None:
        for line in self._levels:  # a low plot has no room for names
            line.label.setVisible(self.view.height() > LEAST_NAMED_LINES * line.label.boundingRect().height())

    @Slot()
    def fit_y(self, *, anew: bool = False) -> None:
        """Fit the value axis to the data in view, unless it was set by hand; ``anew``: also a steady one."""
        if self._y_by_hand:
            return
        (left, right), _ = self.view.viewRange()
        low, high = math.inf, -math.inf
        for curve in self.sampled:
            if not curve.isVisible():
                continue
            least, most = curve.extremes(left, right)
            if math.isfinite(least):
                low, high = min(low, least), max(high, most)
        for band in self.bands:
            if band.isVisible() and math.isfinite(band.typical):
                low, high = min(low, -band.typical), max(high, band.typical)
        if not low <= high:
            return
        low, high = min(low, high, *self.levels.values()), max(low, high, *self.levels.values())
        span = max(high - low, self.minimum_span, 1e-12 * max(abs(low), abs(high)), 1e-30)
        middle = 0.5 * (low + high)
        if self.steady:
            bottom, top = self.view.viewRange()[1]
            if not anew and bottom <= low and high <= top and top - bottom <= _LOOSEST * span:
                return
            span *= _ROOM
        self.view.setYRange(middle - 0.58 * span, middle + 0.58 * span, padding=0)


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

"""Stacked plots with a common time axis; each y axis follows the data in view."""

import math
from collections.abc import Mapping

import pyqtgraph as pg
from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QWidget

from app.window.controls.theme import Colours
from app.window.plots.axis import PlainAxis
from app.window.plots.cursors import TIME, CursorAxis
from app.window.plots.curve import Band, PointCurve, SampledCurve
from app.window.plots.framed_plot import FramedPlot, Span
from app.window.plots.lines import LineStyle, straight
from app.window.plots.plot_view import PlotView

_ROOM = 1.5  # ratio of a steady axis' span to that of the values, so that noise does not move the axis
_LOOSEST = 4.0  # ratio of a steady axis' span to that of the values above which the axis is fitted again
MIN_NAMED_LINES = 4  # least height of a plot with labelled levels, in lines of text


class TimePlot(FramedPlot):
    """One plot of a TimeStack: sampled curves, bands, marks and levels over the common time axis."""

    def __init__(self, title: str, unit: str) -> None:
        super().__init__(title, unit)
        self.bands: list[Band] = []
        self.marks = pg.VTickGroup()
        self.marks.setZValue(-5)
        self.addItem(self.marks, ignoreBounds=True)
        self._levels: list[pg.InfiniteLine] = []
        self.levels: dict[str, float] = {}  # set by ``show_levels``
        self.minimum_span = 0.0
        self.steady = False  # True for running curves: the y axis moves only when necessary
        self.y_by_hand = False
        self.view.sigXRangeChanged.connect(self.fit_y)
        self.view.sigResized.connect(self._resized)
        self.view.y_set_by_user.connect(self._take_y)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self.marks.setPen(straight(colours.marker, Qt.PenStyle.DotLine))

    def add_curve(self, label: str, look: LineStyle) -> SampledCurve:
        return self.added(SampledCurve(label, look))

    def add_points(self, label: str, look: LineStyle) -> PointCurve:
        """Add an empty curve for points that are already decimated."""
        return self.added(PointCurve(label, look))

    def add_band(self) -> Band:
        """Add an empty noise band, which the y axis includes."""
        band = super().add_band()
        self.bands.append(band)
        return band

    def mark(self, times: list[float]) -> None:
        """Show vertical dotted lines at exactly these x."""
        self.marks.setXVals(times)
        self.marks.update()

    def mark_level(self, level: float, words: str) -> None:
        """Show a horizontal dotted line at a value, labelled at its right end."""
        line = pg.InfiniteLine(
            level, angle=0, label=words, labelOpts={"position": 0.97, "anchors": [(1, 0), (1, 0)], "color": "#888888"}
        )
        line.setPen(straight("#888888", Qt.PenStyle.DotLine))
        line.setToolTip(words)  # in a low plot the label is hidden
        line.setZValue(-5)
        self.addItem(line, ignoreBounds=True)
        self._levels.append(line)

    def show_levels(self, levels: Mapping[str, float]) -> None:
        """Show exactly these levels, by their labels; the y axis includes them."""
        if dict(levels) == self.levels:
            return
        for line in self._levels:
            self.view.removeItem(line)
        self._levels.clear()
        self.levels = dict(levels)
        for words, level in self.levels.items():
            self.mark_level(level, words)
        self._name_levels()

    def free_y(self) -> None:
        """Let the y axis follow the data again."""
        self.y_by_hand = False
        self.fit_y(anew=True)

    @Slot(bool)
    def _take_y(self, taken: bool) -> None:
        self.y_by_hand = taken

    @Slot()
    def _resized(self) -> None:
        for curve in self.sampled:
            curve.redraw()
        self._name_levels()

    def _name_levels(self) -> None:
        for line in self._levels:  # a low plot has no room for labels
            line.label.setVisible(self.view.height() > MIN_NAMED_LINES * line.label.boundingRect().height())

    @Slot()
    def fit_y(self, *, anew: bool = False) -> None:
        """Fit the y axis to the data in view, unless the operator has set it; ``anew``: even if it is steady."""
        if self.y_by_hand:
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
    """Stacked plots with linked time axes; x is in the unit of ``axis``."""

    plots: tuple[TimePlot, ...]

    def __init__(self, name: str, parent: QWidget | None = None, axis: CursorAxis = TIME) -> None:
        super().__init__(name, axis, parent)
        self.whole: Span | None = None  # time range of ``reset``; None: it only fits the y axes
        self._value_axes: list[PlainAxis] = []

    def add_plot(self, title: str, unit: str, stretch: int = 3) -> TimePlot:
        plot = TimePlot(title, unit)
        if self.plots:
            plot.view.setXLink(self.plots[0].view)
            self.plots[-1].hide_bottom_values()
        self.join(plot)
        self.ci.layout.setRowStretchFactor(len(self.plots) - 1, stretch)
        plot.getAxis("left").share_labels(self._value_axes)
        return plot

    def label_time(self, words: str) -> None:
        """Set the label of the time axis, without its unit, shown at the lowest plot."""
        self.plots[-1].getAxis("bottom").name_quantity(words, self.cursors.axis.unit)

    def zoom(self, left: float, right: float) -> None:
        """Show this time range in every plot, and fit the y axes."""
        for plot in self.plots:
            plot.free_y()
        self.show_span(left, right)
        for plot in self.plots:
            plot.fit_y()
        self.record_view()

    def show_whole(self, left: float, right: float) -> None:
        """Show this time range and set it as the range of ``reset``."""
        self.whole = left, right
        self.reset()

    @Slot()
    def reset(self) -> None:
        self.zoom(*(self.whole or self.span))

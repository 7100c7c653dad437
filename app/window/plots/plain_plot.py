"""A single plot of y against x with a fixed range, cursors and menu, with linear or logarithmic axes."""

import math

import numpy as np
from PySide6.QtCore import Slot
from PySide6.QtWidgets import QWidget

from analysis.shot import Floats
from app.window.plots.axis import PlainAxis
from app.window.plots.cursors import CursorAxis
from app.window.plots.curve import PointCurve
from app.window.plots.framed_plot import FramedPlot, Span
from app.window.plots.lines import LineStyle
from app.window.plots.plot_view import PlotView
from app.words import number


class PlainPlot(PlotView):
    """A single plot with linear axes; ``columns`` is the content of its CSV file."""

    axis_kind, curve_kind = PlainAxis, PointCurve

    def __init__(
        self,
        name: str,
        value: tuple[str, str],
        bottom: str,
        axis: CursorAxis,
        parent: QWidget | None = None,
        tabulated: bool = True,
    ) -> None:
        """``value`` is (name, unit) of y, ``bottom`` the name of x; ``tabulated``: the plot can be saved as CSV."""
        super().__init__(name, axis, parent)
        self.table_words = "Save the values as CSV …" if tabulated else ""
        self.plot = FramedPlot(*value, self.axis_kind)
        self.join(self.plot)
        self.name_bottom(bottom, axis)
        self.columns: dict[str, Floats] = {}
        self._whole: tuple[Span, Span] | None = None

    def name_bottom(self, quantity: str, axis: CursorAxis) -> None:
        """Set the quantity and the unit of x."""
        self.cursors.axis = axis
        self.plot.getAxis("bottom").name_quantity(quantity, axis.unit)

    def add_curve(self, label: str, look: LineStyle | None = None) -> PointCurve:
        """Add an empty curve that the cursors read."""
        return self.plot.added(self.curve_kind(label, look))

    def show_range(self, x: Span, y: Span) -> None:
        """Show this range and set it as the range of ``reset``."""
        self._whole = (x, y)
        self.reset()

    @Slot()
    def reset(self) -> None:
        if self._whole is not None:
            x, y = self._whole
            self.plot.view.setRange(xRange=x, yRange=y, padding=0)
            self.record_view()


FEW_DECADES = 2.6  # axis length up to which 2 and 5 are labelled too


class LogAxis(PlainAxis):
    """A logarithmic axis with ticks at 1, 2 and 5 of each decade, or only at decades if there are many."""

    def tickValues(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, list[float]]]:
        """Return the ticks between two logarithms, all at one level."""
        steps = (1.0, 2.0, 5.0) if abs(maxVal - minVal) < FEW_DECADES else (1.0,)
        decades = range(math.floor(min(minVal, maxVal)), math.ceil(max(minVal, maxVal)) + 1)
        ticks = [decade + math.log10(step) for decade in decades for step in steps]
        return [(1.0, [tick for tick in ticks if minVal <= tick <= maxVal])]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        return [number(10.0**value, 2) for value in values]


class LogCurve(PointCurve):
    """Points with positive x (n,) and y (n,), whose logarithms are drawn."""

    def show_points(self, x: Floats, y: Floats) -> None:
        """Show points, given as linear values."""
        super().show_points(np.log10(x), np.log10(y))

    @property
    def samples(self) -> Floats:
        """Get the values, shape (n,)."""
        return np.asarray(10.0**self._y)

    def between(self, left: float, right: float) -> tuple[Floats, Floats]:
        """Return the points between two positions of the plot, as linear values."""
        x, y = super().between(left, right)
        return 10.0**x, 10.0**y

    def value_at(self, x: float) -> float:
        """Return the value nearest to a position of the plot, as a linear value; NaN outside."""
        return float(10.0 ** super().value_at(x))


class LogPlot(PlainPlot):
    """A single plot with logarithmic axes; curves and ranges are given as linear values."""

    axis_kind, curve_kind = LogAxis, LogCurve

    def show_range(self, x: Span, y: Span) -> None:
        """Show this range and set it as the range of ``reset``."""
        super().show_range((math.log10(x[0]), math.log10(x[1])), (math.log10(y[0]), math.log10(y[1])))

"""A plot with two logarithmic axes; labels, cursors and files have plain numbers."""

import math

import numpy as np
from PySide6.QtGui import QPen

from app.window.plots.plain_axis import PlainAxis
from app.window.plots.plain_plot import Floats, PlainPlot, XyCurve
from app.window.plots.plot_view import Span
from app.words import number

FEW_DECADES = 2.6  # up to which 2 and 5 are labelled too


class LogAxis(PlainAxis):
    """Ticks at 1, 2 and 5 of each decade, or only at decades where there are many."""

    def tickValues(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, list[float]]]:
        """Return the ticks between two logarithms, all of one kind."""
        steps = (1.0, 2.0, 5.0) if abs(maxVal - minVal) < FEW_DECADES else (1.0,)
        decades = range(math.floor(min(minVal, maxVal)), math.ceil(max(minVal, maxVal)) + 1)
        ticks = [decade + math.log10(step) for decade in decades for step in steps]
        return [(1.0, [tick for tick in ticks if minVal <= tick <= maxVal])]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the plain numbers."""
        return [number(10.0**value, 2) for value in values]


class LogCurve(XyCurve):
    """Points above zero, shape (n,) by (n,), whose logarithms are drawn."""

    def show_points(self, x: Floats, y: Floats) -> None:
        """Show points, given in plain numbers."""
        super().show_points(np.log10(x), np.log10(y))

    @property
    def samples(self) -> Floats:
        """Get the values, shape (n,)."""
        return np.asarray(10.0**self._y)

    def between(self, left: float, right: float) -> tuple[Floats, Floats]:
        """Return the points, in plain numbers, between two places of the plot."""
        x, y = super().between(left, right)
        return 10.0**x, 10.0**y

    def value_at(self, x: float) -> float:
        """Return the value nearest to a place of the plot; NaN outside."""
        return float(10.0 ** super().value_at(x))


class LogPlot(PlainPlot):
    """One plot; curves and ranges are given in plain numbers."""

    axis_kind = LogAxis

    def add_curve(self, label: str, pen: QPen | None = None) -> XyCurve:
        """Add an empty curve that the cursors read."""
        return self._added(LogCurve(label, pen))

    def show_range(self, x: Span, y: Span) -> None:
        """Show this range, to which ``reset`` returns."""
        super().show_range((math.log10(x[0]), math.log10(x[1])), (math.log10(y[0]), math.log10(y[1])))

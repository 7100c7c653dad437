"""Two cursors in linked plots, statistics of the curves between them, and the table of these below a plot."""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Signal, Slot
from PySide6.QtWidgets import QFrame, QWidget

from analysis.shot import Floats
from app.window.controls.commands import with_keys
from app.window.controls.widgets import horizontal, push_button, text_label
from app.window.plots.lines import straight
from app.words import DASH, Markup, joined, localised_number, number, tag

if TYPE_CHECKING:
    from app.window.plots.plot_view import PlotView


@dataclass(frozen=True, slots=True)
class CursorAxis:
    """The x axis of the cursors: its unit, and the unit ``per`` of x in slopes; 1 ``unit`` = ``scale`` ``per``."""

    unit: str
    per: str
    scale: float = 1.0
    inverse: str = ""  # unit of 1/(B - A); "": not shown
    logarithmic: bool = False  # x of the plot is the logarithm of the value

    def value(self, place: float) -> float:
        """Return the value in the axis' unit at a position x in the plot."""
        return float(10.0**place) if self.logarithmic else place


TIME = CursorAxis("ms", "s", 1e-3, "Hz")
SECONDS = CursorAxis("s", "s", 1.0, "Hz")
SPEED = CursorAxis("m/s", "m/s")
DISTANCE = CursorAxis("mm", "m", 1e-3)


@dataclass(frozen=True, slots=True)
class IntervalStatistics:
    """Statistics of one curve between the cursors, in its unit; NaN without samples."""

    name: str
    unit: str
    at_a: float
    at_b: float
    mean: float
    rms: float  # about zero
    deviation: float  # about the mean
    slope: float  # least-squares slope per unit of x

    @property
    def difference(self) -> float:
        return self.at_b - self.at_a


def interval_statistics(
    name: str, unit: str, x: Floats, values: Floats, at_a: float, at_b: float
) -> IntervalStatistics:
    """Return the statistics of samples (n,) at x (n,), ignoring NaN; the slope is per unit of x."""
    seen = np.isfinite(values) & np.isfinite(x)
    x, y = x[seen], values[seen].astype(np.float64)
    if len(y) == 0:
        nothing = float("nan")
        return IntervalStatistics(name, unit, at_a, at_b, nothing, nothing, nothing, nothing)
    mean = float(y.mean())
    centred = x - x.mean()
    power = float(centred @ centred)
    slope = float(centred @ (y - mean)) / power if power > 0 else float("nan")
    return IntervalStatistics(name, unit, at_a, at_b, mean, float(np.sqrt(np.mean(y * y))), float(y.std()), slope)


class Cursors(QObject):
    """Cursors A and B at the same x in all plots of a view; their lines are made when first shown."""

    moved = Signal()

    def __init__(self, view: "PlotView", axis: CursorAxis) -> None:
        super().__init__(view)
        self.axis = axis
        self._view = view
        self._lines: dict[str, list[pg.InfiniteLine]] = {"A": [], "B": []}
        self._at = {"A": 0.0, "B": 1.0}
        self.shown = False
        self._following = False

    def _draw(self) -> None:
        """Make missing lines; only those in the first plot are labelled."""
        for name, lines in self._lines.items():
            for plot in self._view.plots[len(lines) :]:
                named = {"label": name, "labelOpts": {"position": 0.94, "movable": False}} if not lines else {}
                line = pg.InfiniteLine(angle=90, movable=True, **named)
                line.setZValue(20)
                plot.addItem(line, ignoreBounds=True)
                line.sigPositionChanged.connect(partial(self._dragged, name))
                lines.append(line)
        self.apply_colours()

    def apply_colours(self) -> None:
        """Apply the view's colours; A is solid, B dashed."""
        colours = self._view.colours
        full, dashed = Qt.PenStyle.SolidLine, Qt.PenStyle.DashLine
        for name, colour, dash in (("A", colours.cursor_a, full), ("B", colours.cursor_b, dashed)):
            for line in self._lines[name]:
                line.setPen(straight(colour, dash))
                line.setHoverPen(straight(colour, dash, 3))
                if getattr(line, "label", None) is not None:
                    line.label.setColor(colour)

    @property
    def places(self) -> tuple[float, float]:
        """Get the positions of A and B in the plot's x."""
        return self._at["A"], self._at["B"]

    def place(self, a: float, b: float) -> None:
        self._set("A", a)
        self._set("B", b)

    def step(self, name: str, by: float) -> None:
        self._set(name, self._at[name] + by)

    def show(self, shown: bool, left: float, right: float) -> None:
        """Show the cursors at one and two thirds of the range left to right, or hide them."""
        self.shown = shown
        if shown:
            self._draw()
            third = (right - left) / 3
            self.place(left + third, right - third)
        for lines in self._lines.values():
            for line in lines:
                line.setVisible(shown)
        self.moved.emit()

    def _set(self, name: str, place: float) -> None:
        if self._following:
            return
        self._following = True
        self._at[name] = place
        for line in self._lines[name]:
            line.setValue(place)
        self._following = False
        self.moved.emit()

    def _dragged(self, name: str, line: pg.InfiniteLine) -> None:
        self._set(name, float(line.value()))

    def measures(self) -> list[IntervalStatistics]:
        """Return the statistics of every visible curve."""
        a, b = self.places
        left, right = min(a, b), max(a, b)
        found = []
        for plot in self._view.plots:
            for curve in plot.sampled:
                if curve.isVisible() and len(curve.samples):
                    x, values = (np.asarray(part, float) for part in curve.between(left, right))
                    at_a, at_b, x = curve.value_at(a), curve.value_at(b), self.axis.scale * x
                    name = f"{plot.title}, {curve.label}"
                    found.append(interval_statistics(name, plot.unit, x, values, at_a, at_b))
        return found

    def text(self) -> str:
        """Return all statistics as tab-separated text, with "." as the decimal sign."""
        a, b = map(self.axis.value, self.places)
        unit, per = self.axis.unit, self.axis.per
        rows = [
            f"A\t{a:.6f} {unit}\tB\t{b:.6f} {unit}\tB-A\t{b - a:.6f} {unit}",
            f"curve\tunit\tat A\tat B\tB-A\tmean\trms\tstandard deviation\tslope (unit per {per})",
        ]
        for m in self.measures():
            numbers = (m.at_a, m.at_b, m.difference, m.mean, m.rms, m.deviation, m.slope)
            rows.append(f"{m.name}\t{m.unit}\t" + "\t".join(f"{value:.9g}" for value in numbers))
        return "\n".join(rows)


GAP = "\u00a0 \u00a0"  # between the positions of A and B
LOW_LINES = 40  # height in lines of text below which a window shows the table only as a tooltip


class CursorReadout(QFrame):
    """The cursor table of one plot; hidden while the cursors or the plot are hidden."""

    def __init__(self, plot: "PlotView", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plot, self._cursors = plot, plot.cursors
        self.setProperty("card", True)
        row = horizontal(self, (8, 4, 8, 4))
        self._table = text_label("", self, selectable=True)
        hover = "Copy places, values, differences, mean, rms and slope between the cursors"
        copy = push_button("Copy as text", with_keys(hover, "copy_cursors"), self, plot.copy_cursors)
        row.addWidget(self._table, 1)
        row.addWidget(copy, 0, Qt.AlignmentFlag.AlignTop)
        self._cursors.moved.connect(self.refresh)
        self.words = ""  # the whole table
        self.setVisible(False)

    @Slot()
    def refresh(self) -> None:
        shown = self._cursors.shown and not self._plot.isHidden()
        self.setVisible(shown)
        if not shown or not self._plot.isVisible():
            return
        axis = self._cursors.axis
        a, b = map(axis.value, self._cursors.places)
        span = abs(b - a) * axis.scale
        named = (("A", a), ("B", b), ("B − A", b - a))
        places = [
            joined(tag("b", name), f" {localised_number(f'{place:.4f}')} {axis.unit}{GAP}") for name, place in named
        ]
        rate = f"({number(1 / span, 5) if span else DASH} {axis.inverse})" if axis.inverse else ""
        rows = [tag("tr", tag("td", places, rate, colspan=8))]
        measures = self._cursors.measures()
        if measures:
            heads = ("", "at A", "at B", "B − A", "mean", "rms", f"slope per {axis.per}", "")
            rows.append(tag("tr", [_right(tag("b", head)) for head in heads]))
        for m in measures:
            cells = (m.at_a, m.at_b, m.difference, m.mean, m.rms, m.slope)
            numbers = [_right(number(cell, 5)) for cell in cells]
            rows.append(tag("tr", tag("td", m.name), numbers, tag("td", m.unit)))
        table = tag("table", rows, cellspacing=0)
        low = self.window().height() < LOW_LINES * self.fontMetrics().lineSpacing()
        self._table.setText(tag("table", rows[0], cellspacing=0) if low else table)
        self._table.setToolTip(table if low else "")
        self.words = table


def _right(text: str) -> Markup:
    return tag("td", text, align="right", style="padding: 0 9px")

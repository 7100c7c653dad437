"""COMPARE page: several shots overlaid with time from first touch, and a number plotted against impact speed."""

import math
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QSplitter, QWidget

from analysis.shot import Quantity, Shot
from analysis.uncertainty import ResultNumber, series_numbers, with_unit
from app.report import contact_span_ms, grid_ms
from app.session import Entry
from app.window.controls.theme import Colours, Themed
from app.window.controls.widgets import added, combo_box, push_button, text_label, vertical
from app.window.plots.cursors import SPEED, CursorReadout
from app.window.plots.curve import SampledCurve
from app.window.plots.framed_plot import AXIS_WIDTH, ON_TOP
from app.window.plots.legend import Legend, is_low
from app.window.plots.lines import series, straight
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.time_plot import TimeStack
from app.words import lines, localised_number, number, short_name, tag


class TrendPlot(PlainPlot):
    """Plot of a number of each shot against impact speed, with its standard uncertainty from noise alone.

    Errors common to all shots (mass, wavelength, clock) are left out: they cause no scatter and would hide a spread.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Trend against impact velocity", ("", ""), "impact speed |v in|", SPEED, parent)
        self.plot.getAxis("left").setWidth(AXIS_WIDTH + 8)
        self._bars = pg.ErrorBarItem(x=np.zeros(0), y=np.zeros(0), beam=0.0)
        self._points = pg.ScatterPlotItem(size=9)
        self.plot.addItem(self._bars)
        self.plot.addItem(self._points)
        self._curve = self.add_curve("shots")

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self._points.setBrush(pg.mkBrush(colours.measured))
        self._points.setPen(pg.mkPen(colours.plot))
        self._bars.setData(pen=straight(colours.marker))

    def show_trend(self, trend: ResultNumber, shots: list[Shot]) -> str:
        """Show the trend of a number and return its mean and spread in words."""
        x, y, half = [], [], []
        for shot in shots:
            reading = trend.find(shot)
            speed = shot.impact.velocity_in_m_per_s if shot.impact is not None else None
            if isinstance(reading, Quantity) and isinstance(speed, Quantity) and math.isfinite(reading.value):
                x.append(abs(speed.value))
                y.append(trend.scale * reading.value)
                half.append(trend.scale * reading.std if math.isfinite(reading.std) else 0.0)
        self._points.setData(x, y)
        xs, ys, halves = np.array(x), np.array(y), np.array(half)
        self._bars.setData(x=xs, y=ys, height=2 * halves)
        self._curve.show_points(xs, ys)
        self.plot.name_value(trend.title, trend.shown_unit)
        self.columns = {
            "impact speed (m/s)": xs,
            with_unit(trend.title, trend.shown_unit): ys,
            "standard uncertainty, noise alone": halves,
        }
        if not x:
            return "No selected shot has this number."
        reach_x = 0.08 * max(np.ptp(xs), 0.02 * xs.max(), 1e-6)
        low, high = (ys - halves).min(), (ys + halves).max()
        reach_y = 0.12 * max(high - low, 1e-4 * abs(ys).max(), 1e-12)
        self.show_range((xs.min() - reach_x, xs.max() + reach_x), (low - reach_y, high + reach_y))
        if len(y) < 2:
            return "One shot: select several to see the spread."
        spread, mean = float(ys.std(ddof=1)), float(ys.mean())
        unit = f" {trend.shown_unit}" if trend.shown_unit else ""
        share = f" ({localised_number(f'{100 * spread / abs(mean):.2g}')} %)" if mean else ""
        return (
            f"{len(y)} shots: mean {number(mean, 6)}{unit}, spread {number(spread, 3)}{share}; "
            f"bars: ± from each shot's noise only, {number(float(halves.mean()), 2)} on average"
        )


MOST = 8


def _named(entries: Sequence[Entry]) -> str:
    """Return the numbers of the shots in a saved picture, in words; "" for none."""
    numbers = ", ".join(str(entry.number) for entry in entries)
    return f"Shot{'s' if len(entries) > 1 else ''} {numbers}" if entries else ""


def _overlay(entries: Sequence[Entry], curves: Sequence[SampledCurve], quantity: str) -> None:
    """Show a quantity of the motion of each entry, one curve each, and hide the other curves."""
    for curve, entry in zip_longest(curves, entries):
        curve.setVisible(entry is not None)
        if entry is None or entry.shot is None:
            curve.clear_samples()
        else:
            curve.label = f"{entry.number} {entry.name}"
            curve.show_samples(*grid_ms(entry.shot), getattr(entry.shot.motion, quantity))


class ComparePanel(Themed, QWidget):
    """The COMPARE page: overlay on the left, trend on the right."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._entries: list[Entry] = []
        column = vertical(self, (6, 6, 6, 2))
        bar = QHBoxLayout()
        bar.addWidget(push_button("Whole shot", "The whole length of the shots", self, command="show_view:whole"))
        bar.addWidget(push_button("First contact", "The bounces at first contact", self, command="show_view:contact"))
        self._say = added(bar, text_label("", self, faint=True, wrap=True), 1)
        self._numbers_followed = series_numbers()
        hover = "Number plotted against impact speed; a slope shows that it depends on speed"
        items = [(with_unit(followed.title, followed.shown_unit), followed.key) for followed in self._numbers_followed]
        self.which = added(bar, combo_box("Number whose trend is shown", hover, self, items))
        self.which.currentIndexChanged.connect(self._trend_chosen)
        column.addLayout(bar)
        self._legend = added(column, Legend(self))
        split = QSplitter(Qt.Orientation.Horizontal, self)
        self.stack = TimeStack("Overlaid shots", split)
        velocity, force = self.stack.add_plot("velocity", "m/s", 2), self.stack.add_plot("force", "N", 3)
        self.stack.label_time("time from first touch")
        self._velocity_curves, self._force_curves = (
            [plot.add_curve("", series(index)) for index in range(MOST)] for plot in (velocity, force)
        )
        self._labels = [pg.TextItem(anchor=(0.5, 0.5)) for _ in range(MOST)]  # the number of each curve's shot
        for label in self._labels:
            label.setZValue(ON_TOP)
            velocity.addItem(label, ignoreBounds=True)
        velocity.view.sigXRangeChanged.connect(self._place_labels)
        right = QWidget(split)
        right_column = vertical(right, (6, 0, 0, 0))
        self.trend = added(right_column, TrendPlot(right), 1)
        self.repeatability = added(right_column, text_label("", right, selectable=True, wrap=True))
        split.setSizes([620, 380])
        split.setChildrenCollapsible(False)
        column.addWidget(split, 1)
        self.plots = (self.stack, self.trend)
        for plot in self.plots:
            column.addWidget(CursorReadout(plot, self))
        self.show_entries([])

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self._label_lines()

    def _label_lines(self) -> None:
        shown = self._entries[-MOST:]
        for index, (label, entry) in enumerate(zip(self._labels, shown, strict=False)):
            label.setText(str(entry.number), series(index).of(self.colours))
            label.fill = pg.mkBrush(self.colours.plot)
        self._place_labels()
        entries = [(f"{e.number}  {short_name(e.name)}", series(index)) for index, e in enumerate(shown)]
        self._legend.show_entries(entries)
        self.stack.legend = entries

    @Slot()
    def _place_labels(self) -> None:
        """Place the labels on their curves, spread over the view; a curve out of view has none."""
        left, right = self.stack.span
        count = len(self._entries[-MOST:])
        for place, (label, curve) in enumerate(zip(self._labels, self._velocity_curves, strict=True), 1):
            at = left + place / (count + 1) * (right - left)
            value = curve.value_at(at)
            label.setVisible(math.isfinite(value))
            if math.isfinite(value):
                label.setPos(at, value)

    def show_entries(self, entries: list[Entry]) -> None:
        """Overlay the last ``MOST`` of these entries and show the trend of all."""
        self._entries = [entry for entry in entries if entry.shot is not None and entry.shot.motion is not None]
        shown = self._entries[-MOST:]
        _overlay(shown, self._velocity_curves, "velocity_m_per_s")
        _overlay(shown, self._force_curves, "force_n")
        count, said = len(self._entries), ""
        if count == 0:
            said = "Select shots in the table below (Ctrl or Shift with a click) to overlay them."
        elif count > MOST:
            said = f"the last {MOST} of {count} selected shots are overlaid; the trend includes all"
        self._say.setText(said)
        self._label_lines()
        self.stack.set_shots([e.shot for e in shown], _named(shown))
        self.trend.set_shots([e.shot for e in self._entries], _named(self._entries))
        self._trend_chosen(0)
        curves = [curve for curve in self._velocity_curves if len(curve.samples)]
        if curves:
            left = min(curve.grid[0] for curve in curves)
            self.stack.show_whole(left, max(curve.grid[0] + curve.grid[1] * len(curve.samples) for curve in curves))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Hide legend and repeatability if there is no room for them."""
        super().resizeEvent(event)
        self._show_words()

    def _show_words(self) -> None:
        """Show legend and repeatability; on a low page show them as tooltips, to leave room for the plots."""
        low = is_low(self)
        self._legend.setVisible(not low)
        self.repeatability.setVisible(not low)
        entries = [words for words, _ in self._legend.entries]
        self.stack.setToolTip(tag("span", lines(entries)) if low and entries else "")
        self.trend.setToolTip(self.repeatability.text() if low else "")

    def show_contact(self) -> None:
        shots = [entry.shot for entry in self._entries if entry.shot is not None]
        if shots:
            self.stack.zoom(*contact_span_ms(shots[-1]))

    @Slot(int)
    def _trend_chosen(self, _: int) -> None:
        shots = [entry.shot for entry in self._entries if entry.shot is not None]
        self.repeatability.setText(self.trend.show_trend(self._numbers_followed[self.which.currentIndex()], shots))
        self._show_words()

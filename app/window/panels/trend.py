"""The trend of a number against impact speed, and its repeatability."""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from analysis.shot import Quantity, Shot
from analysis.uncertainty import ResultNumber, with_unit
from app.window.pens import straight
from app.window.plots.cursors import CursorAxis
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.time_plot import AXIS_WIDTH
from app.window.theme import Colours
from app.words import local, number

SPEED = CursorAxis("m/s", "m/s")


class TrendPlot(PlainPlot):
    """A number of each shot against impact speed, with its standard uncertainty from noise only.

    Errors that all shots share (mass, wavelength, clock) cause no scatter and would hide a spread.
    """

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__("Trend against impact velocity", ("", ""), "impact speed |v in| (m/s)", SPEED, parent)
        self.plot.getAxis("left").setWidth(AXIS_WIDTH + 8)
        self._bars = pg.ErrorBarItem(x=np.zeros(0), y=np.zeros(0), beam=0.0)
        self._points = pg.ScatterPlotItem(size=9)
        self.plot.addItem(self._bars)
        self.plot.addItem(self._points)
        self._curve = self.add_curve("shots")
        self.points: list[tuple[float, float]] = []
        self.dress(colours)

    def dress(self, colours: Colours) -> None:
        super().dress(colours)
        self._points.setBrush(pg.mkBrush(colours.measured))
        self._points.setPen(pg.mkPen(colours.plot))
        self._bars.setData(pen=straight(colours.marker))

    def show_trend(self, trend: ResultNumber, shots: list[Shot]) -> str:
        """Show the trend and return its repeatability in words."""
        x, y, half = [], [], []
        for shot in shots:
            reading = trend.find(shot)
            speed = shot.impact.velocity_in_m_per_s if shot.impact is not None else None
            if isinstance(reading, Quantity) and isinstance(speed, Quantity) and math.isfinite(reading.value):
                x.append(abs(speed.value))
                y.append(trend.scale * reading.value)
                half.append(trend.scale * reading.std if math.isfinite(reading.std) else 0.0)
        self.points = list(zip(x, y, strict=True))
        self._points.setData(x, y)
        xs, ys, halves = np.array(x), np.array(y), np.array(half)
        self._bars.setData(x=xs, y=ys, height=2 * halves)
        self._curve.show_points(xs, ys)
        self.label_value(trend.title, trend.shown_unit)
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
            return "One shot: select several for their spread."
        spread, mean = float(ys.std(ddof=1)), float(ys.mean())
        unit = f" {trend.shown_unit}" if trend.shown_unit else ""
        return (
            f"{len(y)} shots: mean {number(mean, 6)}{unit}, spread {number(spread, 3)} "
            f"({local(f'{100 * spread / abs(mean):.2g}')} %); bars: ± from each shot's noise only, "
            f"{number(float(halves.mean()), 2)} on average"
        )

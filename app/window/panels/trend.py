"""Any number of a shot against impact speed, and how well it repeats."""

import math
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from analysis.shot.quantity import Quantity, Reading
from analysis.shot.shot import Shot
from app.window.pens import straight
from app.window.plots.cursors import CursorAxis
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.time_plot import AXIS_WIDTH
from app.window.theme import Colours
from app.words.wording import local, number

SPEED = CursorAxis("m/s", "m/s")


@dataclass(frozen=True, slots=True)
class Trend:
    """A number that can be followed: its words, its name in the shot, its unit on the screen."""

    words: str
    name: str
    unit: str = ""
    scale: float = 1.0  # of the stored number

    @property
    def label(self) -> str:
        """Get words and unit."""
        return f"{self.words} ({self.unit})" if self.unit else self.words


TRENDS: tuple[Trend, ...] = (
    Trend("COR quasi-static", "cor_quasi_static"),
    Trend("COR impulse ratio", "cor_impulse"),
    Trend("COR kinetic, force peaks", "force_peaks"),
    Trend("COR of the fitted contact", "contact"),
    Trend("k_p", "plate_stiffness_n_per_m", "N/m"),
    Trend("m_p*", "plate_mass_kg", "g", 1e3),
    Trend("k_N", "contact_stiffness_n_per_m", "N/m"),
    Trend("γ_N", "contact_damping_n_s_per_m", "N s/m"),
    Trend("peak force", "force_peak_n", "N"),
    Trend("contact time", "contact_time_s", "ms", 1e3),
    Trend("pulse width", "force_fwhm_s", "ms", 1e3),
    Trend("deflection", "deflection_max_m", "mm", 1e3),
    Trend("slope of F", "stiffness_slope_n_per_m", "N/m"),
)


def trend_reading(shot: Shot, name: str) -> Reading | None:
    """Return a shot's number by its name in ``TRENDS``, in SI units."""
    if shot.impact is not None:
        if hasattr(shot.impact, name):
            return getattr(shot.impact, name)
        if hasattr(shot.impact.cor_kinetic, name):
            return getattr(shot.impact.cor_kinetic, name)
    if shot.fit is not None and shot.fit.converged:
        return shot.fit.parameters.get(name)
    return None


class TrendPlot(PlainPlot):
    """A number of each shot against its impact speed, with its standard uncertainty from noise only.

    What all shots share (mass, wavelength, clock) scatters nothing: bars that held it would hide a spread.
    """

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__("Trend against impact velocity", ("", ""), "impact speed |v in| (m/s)", SPEED, parent)
        self.plot.getAxis("left").setWidth(AXIS_WIDTH + 8)
        self._bars = pg.ErrorBarItem(x=np.zeros(0), y=np.zeros(0), beam=0.0)
        self._points = pg.ScatterPlotItem(size=9)
        self.plot.addItem(self._bars)
        self.plot.addItem(self._points)
        self._told = self.add_curve("shots")
        self.points: list[tuple[float, float]] = []
        self.dress(colours)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        super().dress(colours)
        self._colours = colours
        self._points.setBrush(pg.mkBrush(colours.measured))
        self._points.setPen(pg.mkPen(colours.plot))

    def show_trend(self, trend: Trend, shots: list[Shot]) -> str:
        """Show the trend and return its repeatability in words."""
        x, y, half = [], [], []
        for shot in shots:
            reading = trend_reading(shot, trend.name)
            speed = shot.impact.velocity_in_m_per_s if shot.impact is not None else None
            if isinstance(reading, Quantity) and isinstance(speed, Quantity) and math.isfinite(reading.value):
                x.append(abs(speed.value))
                y.append(trend.scale * reading.value)
                half.append(trend.scale * reading.std if math.isfinite(reading.std) else 0.0)
        self.points = list(zip(x, y, strict=True))
        self._points.setData(x, y)
        xs, ys, halves = np.array(x), np.array(y), np.array(half)
        self._bars.setData(x=xs, y=ys, height=2 * halves, pen=straight(self._colours.marker))
        self._told.show_points(xs, ys)
        self.label_value(trend.words, trend.unit)
        self.columns = {"impact speed (m/s)": xs, trend.label: ys, "standard uncertainty, noise alone": halves}
        if not x:
            return "No selected shot has this number."
        reach_x = 0.08 * max(np.ptp(xs), 0.02 * xs.max(), 1e-6)
        low, high = (ys - halves).min(), (ys + halves).max()
        reach_y = 0.12 * max(high - low, 1e-4 * abs(ys).max(), 1e-12)
        self.show_range((xs.min() - reach_x, xs.max() + reach_x), (low - reach_y, high + reach_y))
        if len(y) < 2:
            return "One shot: select several for their spread."
        spread, mean = float(ys.std(ddof=1)), float(ys.mean())
        unit = f" {trend.unit}" if trend.unit else ""
        return (
            f"{len(y)} shots: mean {number(mean, 6)}{unit}, spread {number(spread, 3)} "
            f"({local(f'{100 * spread / abs(mean):.2g}')} %); bars: ± from each shot's noise only, "
            f"{number(float(halves.mean()), 2)} on average"
        )

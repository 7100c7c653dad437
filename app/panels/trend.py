"""Any number of a shot against impact speed, and how well it repeats."""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from analysis.quantity import Quantity, Reading
from analysis.shot import Shot
from app.plots.plain_plot import PlainPlot
from app.plots.time_plot import AXIS_WIDTH
from app.theme import Colours
from app.wording import local, number

TRENDS: tuple[tuple[str, str], ...] = (
    ("COR quasi-static", "cor_quasi_static"),
    ("COR impulse ratio", "cor_impulse"),
    ("COR kinetic (force peaks)", "force_peaks"),
    ("COR of the fitted contact", "contact"),
    ("k_p (N/m)", "plate_stiffness_n_per_m"),
    ("m_p* (kg)", "plate_mass_kg"),
    ("k_N (N/m)", "contact_stiffness_n_per_m"),
    ("γ_N (N s/m)", "contact_damping_n_s_per_m"),
    ("peak force (N)", "force_peak_n"),
    ("contact time (s)", "contact_time_s"),
    ("pulse width (s)", "force_fwhm_s"),
    ("deflection (m)", "deflection_max_m"),
    ("slope of F (N/m)", "stiffness_slope_n_per_m"),
)


def trend_reading(shot: Shot, name: str) -> Reading | None:
    """Return a shot's number by its name in ``TRENDS``."""
    if shot.impact is not None:
        if hasattr(shot.impact, name):
            return getattr(shot.impact, name)
        if hasattr(shot.impact.cor_kinetic, name):
            return getattr(shot.impact.cor_kinetic, name)
    if shot.fit is not None and shot.fit.converged:
        return shot.fit.parameters.get(name)
    return None


class TrendPlot(PlainPlot):
    """A number of each shot against its impact speed, with standard uncertainties."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__("Trend against impact velocity", "", "impact speed |v in| (m/s)", parent)
        item = self.getPlotItem()
        item.getAxis("left").setWidth(AXIS_WIDTH + 8)
        self._bars = pg.ErrorBarItem(x=np.zeros(0), y=np.zeros(0), beam=0.0)
        self._points = pg.ScatterPlotItem(size=9)
        item.addItem(self._bars)
        item.addItem(self._points)
        self.points: list[tuple[float, float]] = []
        self.dress(colours)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        super().dress(colours)
        self._colours = colours
        self._points.setBrush(pg.mkBrush(colours.measured))
        self._points.setPen(pg.mkPen(colours.plot))

    def show_trend(self, words: str, name: str, shots: list[Shot]) -> str:
        """Show the trend and return its repeatability in words."""
        x, y, half = [], [], []
        for shot in shots:
            reading = trend_reading(shot, name)
            speed = shot.impact.velocity_in_m_per_s if shot.impact is not None else None
            if isinstance(reading, Quantity) and isinstance(speed, Quantity) and math.isfinite(reading.value):
                x.append(abs(speed.value))
                y.append(reading.value)
                half.append(reading.std if math.isfinite(reading.std) else 0.0)
        self.points = list(zip(x, y, strict=True))
        self._points.setData(x, y)
        xs, ys, halves = np.array(x), np.array(y), np.array(half)
        self._bars.setData(x=xs, y=ys, height=2 * halves, pen=pg.mkPen(self._colours.marker))
        self.getPlotItem().setLabel("left", words)
        self.columns = {"impact speed (m/s)": xs, words: ys, "standard uncertainty": halves}
        if not x:
            return "No selected shot has this number."
        reach_x = 0.08 * max(np.ptp(xs), 0.02 * xs.max(), 1e-6)
        low, high = (ys - halves).min(), (ys + halves).max()
        reach_y = 0.12 * max(high - low, 1e-4 * abs(ys).max(), 1e-12)
        self.show_range((xs.min() - reach_x, xs.max() + reach_x), (low - reach_y, high + reach_y))
        if len(y) < 2:
            return "One shot: select several for their spread."
        spread, mean = float(ys.std(ddof=1)), float(ys.mean())
        return (
            f"{len(y)} shots: mean {number(mean, 6)}, spread {number(spread, 3)} "
            f"({local(f'{100 * spread / abs(mean):.2g}')} %), mean stated uncertainty {number(float(halves.mean()), 2)}"
        )

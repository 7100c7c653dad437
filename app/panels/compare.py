"""COMPARE: several shots over one another from first touch on, and any number's trend against impact velocity."""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QPushButton, QSplitter, QVBoxLayout, QWidget

from analysis.quantity import Quantity, Reading
from analysis.shot import Shot
from app.plots.cursor_readout import CursorReadout
from app.plots.curve import SampledCurve
from app.plots.legend import Legend
from app.plots.shot_times import contact_span_ms, time_zero
from app.plots.time_plot import AXIS_WIDTH
from app.plots.time_stack import TimeStack
from app.session import Entry
from app.theme import Colours, series_pen
from app.wording import local, number

MOST = 8
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


class TrendPlot(pg.PlotWidget):
    """A number of each shot against its impact speed, with standard uncertainties."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent, enableMenu=False)
        self.setAccessibleName("Trend against impact velocity")
        item = self.getPlotItem()
        item.hideButtons()
        for side in ("left", "bottom"):
            item.getAxis(side).enableAutoSIPrefix(False)
        item.getAxis("left").setWidth(AXIS_WIDTH + 8)
        item.setLabel("bottom", "impact speed |v in| (m/s)")
        self._bars = pg.ErrorBarItem(x=np.zeros(0), y=np.zeros(0), beam=0.0)
        self._points = pg.ScatterPlotItem(size=9)
        item.addItem(self._bars)
        item.addItem(self._points)
        self.points: list[tuple[float, float]] = []
        self.dress(colours)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self.setBackground(colours.plot)
        for side in ("left", "bottom"):
            self.getPlotItem().getAxis(side).setPen(pg.mkPen(colours.edge))
            self.getPlotItem().getAxis(side).setTextPen(pg.mkPen(colours.text))
        self.getPlotItem().showGrid(x=True, y=True, alpha=0.18)
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
        if not x:
            return "No selected shot has this number."
        reach_x = 0.08 * max(np.ptp(xs), 0.02 * xs.max(), 1e-6)
        low, high = (ys - halves).min(), (ys + halves).max()
        reach_y = 0.12 * max(high - low, 1e-4 * abs(ys).max(), 1e-12)
        view = self.getPlotItem().getViewBox()
        view.setRange(
            xRange=(xs.min() - reach_x, xs.max() + reach_x), yRange=(low - reach_y, high + reach_y), padding=0
        )
        if len(y) < 2:
            return "One shot: select several for their spread."
        spread, mean = float(ys.std(ddof=1)), float(ys.mean())
        return (
            f"{len(y)} shots: mean {number(mean, 6)}, spread {number(spread, 3)} "
            f"({local(f'{100 * spread / abs(mean):.2g}')} %), mean stated uncertainty {number(float(halves.mean()), 2)}"
        )


class ComparePanel(QWidget):
    """Overlay to the left, trend to the right."""

    export_wanted = Signal(object, str)

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._entries: list[Entry] = []
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 2)
        bar = QHBoxLayout()
        for words, tip, slot in (
            ("Whole shot", "The whole length of the shots  (1)", self.show_whole),
            ("First contact", "The bounces at first contact  (2)", self.show_contact),
        ):
            button = QPushButton(words, self)
            button.setToolTip(tip)
            button.clicked.connect(slot)
            bar.addWidget(button)
        self._say = QLabel(self)
        self._say.setProperty("faint", True)
        bar.addWidget(self._say, 1)
        self._which = QComboBox(self)
        self._which.setAccessibleName("Number whose trend is shown")
        for words, name in TRENDS:
            self._which.addItem(words, name)
        self._which.currentIndexChanged.connect(self._trend_chosen)
        bar.addWidget(self._which)
        column.addLayout(bar)
        self._legend = Legend(self)
        column.addWidget(self._legend)
        split = QSplitter(Qt.Orientation.Horizontal, self)
        self.stack = TimeStack("Overlaid shots", colours, split)
        self._velocity = self.stack.add_plot("velocity", "m/s", 2)
        self._force = self.stack.add_plot("force", "N", 3)
        self.stack.label_time("time from first touch (ms)")
        self._velocity_curves = self._curves(self._velocity)
        self._force_curves = self._curves(self._force)
        right = QWidget(split)
        right_column = QVBoxLayout(right)
        right_column.setContentsMargins(0, 0, 0, 0)
        self.trend = TrendPlot(colours, right)
        self._repeatability = QLabel(right)
        self._repeatability.setWordWrap(True)
        self._repeatability.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        right_column.addWidget(self.trend, 1)
        right_column.addWidget(self._repeatability)
        split.setSizes([620, 380])
        split.setChildrenCollapsible(False)
        column.addWidget(split, 1)
        self._readout = CursorReadout(self.stack.cursors, self)
        column.addWidget(self._readout)
        self.stack.reset_wanted.connect(self.show_whole)
        self.stack.export_wanted.connect(self._export)
        self.dress(colours)
        self.show_entries([])

    def _curves(self, plot: object) -> list[SampledCurve]:
        return [plot.add_curve("", series_pen(self._colours, index)) for index in range(MOST)]  # type: ignore[attr-defined]

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self.stack.dress(colours)
        self.trend.dress(colours)
        for curves in (self._velocity_curves, self._force_curves):
            for index, curve in enumerate(curves):
                curve.setPen(series_pen(colours, index))
        self._label_lines()

    def _label_lines(self) -> None:
        shown = self._entries[-MOST:]
        self._legend.show_entries(
            [(f"{e.number}  {e.name}", series_pen(self._colours, index)) for index, e in enumerate(shown)]
        )

    def show_entries(self, entries: list[Entry]) -> None:
        """Overlay the last eight of these and show the trend of all."""
        self._entries = [entry for entry in entries if entry.shot is not None and entry.shot.motion is not None]
        shown = self._entries[-MOST:]
        for index in range(MOST):
            velocity, force = self._velocity_curves[index], self._force_curves[index]
            present = index < len(shown)
            velocity.setVisible(present)
            force.setVisible(present)
            if not present:
                velocity.clear_samples()
                force.clear_samples()
                continue
            shot = shown[index].shot
            assert shot is not None and shot.motion is not None
            zero, _ = time_zero(shot)
            start, step = 1e3 * (float(shot.motion.time_s[0]) - zero), 1e3 / shot.motion.sample_rate_hz
            velocity.label = force.label = f"{shown[index].number} {shown[index].name}"
            velocity.show_samples(start, step, shot.motion.velocity_m_per_s)
            force.show_samples(start, step, shot.motion.force_n)
        count = len(self._entries)
        if count == 0:
            self._say.setText(
                "Select shots in the table below (Ctrl or Shift with a click) to lay them over one another."
            )
        elif count > MOST:
            self._say.setText(f"the last {MOST} of {count} selected shots are overlaid; the trend shows all")
        else:
            self._say.setText("")
        self._label_lines()
        self._trend_chosen(0)
        self.show_whole()

    def choose_trend(self, name: str) -> None:
        """Show the trend of the number of this name in ``TRENDS``."""
        self._which.setCurrentIndex(self._which.findData(name))

    @property
    def repeatability(self) -> str:
        """Get what is said of the trend."""
        return self._repeatability.text()

    @Slot()
    def show_whole(self) -> None:
        """Show the whole length."""
        curves = [curve for curve in self._velocity_curves if len(curve.samples)]
        if curves:
            left = min(curve.grid[0] for curve in curves)
            right = max(curve.grid[0] + curve.grid[1] * len(curve.samples) for curve in curves)
            self.stack.zoom(left, right)

    @Slot()
    def show_contact(self) -> None:
        """Show the first bounces."""
        shots = [entry.shot for entry in self._entries if entry.shot is not None]
        if shots:
            self.stack.zoom(*contact_span_ms(shots[-1]))

    @Slot(int)
    def _trend_chosen(self, _: int) -> None:
        shots = [entry.shot for entry in self._entries if entry.shot is not None]
        words, name = self._which.currentText(), str(self._which.currentData())
        self._repeatability.setText(self.trend.show_trend(words, name, shots))

    @Slot()
    def copy_cursors(self) -> None:
        """Copy what lies between the cursors."""
        if self.stack.cursors.shown:
            self._readout.copy()

    @Slot(str)
    def _export(self, kind: str) -> None:
        self.export_wanted.emit(self.stack, kind)

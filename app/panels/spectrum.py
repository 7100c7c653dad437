"""SPECTRUM: what the beats are made of, over the whole record and over time; computed beside the screen."""

from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtWidgets import QLabel, QSplitter, QVBoxLayout, QWidget

from analysis.recording import Recording, Role
from analysis.shot import Cancelled
from app.jobs import Asked, Report
from app.plots.legend import Legend
from app.plots.time_plot import AXIS_WIDTH
from app.theme import Colours, thin, under

Floats = NDArray[np.float64]
NAMES = {Role.REFERENCE: "PD0", Role.MEASUREMENT: "PD1"}
BINS = 4096
COLUMNS = 400


@dataclass(frozen=True, slots=True)
class Spectra:
    """Power of each beat against frequency, and PD1's against time; decibels above 1 V^2/Hz."""

    frequency_hz: Floats  # (f,)
    power_db: dict[Role, Floats]  # each (f,)
    image_db: Floats  # (columns, rows) of PD1
    image_span_s: tuple[float, float]
    image_span_hz: tuple[float, float]


def spectra_of(recording: Recording, zero_s: float, report: Report, cancelled: Asked) -> Spectra:
    """Return averaged Hann periodograms of the beats; cost: one pass of FFTs of 4096 over the record."""
    window = np.hanning(BINS)
    scale = 1.0 / (recording.sample_rate_hz * float(window @ window))
    count = recording.samples // BINS
    frequency = np.fft.rfftfreq(BINS, 1 / recording.sample_rate_hz)
    power: dict[Role, Floats] = {}
    image = np.zeros((0, len(frequency)))
    for role in NAMES:
        column = recording.column(role)
        if column is None or count == 0:
            continue
        channel = recording.channels[column]
        total = np.zeros(len(frequency))
        rows: list[Floats] = []
        per_row = max(1, count // COLUMNS)
        for first in range(0, count - per_row + 1, per_row):
            if cancelled():
                raise Cancelled
            block = recording.counts[first * BINS : (first + per_row) * BINS, column].reshape(per_row, BINS)
            volts = block * channel.volts_per_count
            volts = volts - volts.mean(axis=1, keepdims=True)
            row = (np.abs(np.fft.rfft(volts * window, axis=1)) ** 2).mean(axis=0) * scale
            total += row
            rows.append(row)
            if first % (per_row * 16) == 0:
                report(f"spectrum of {NAMES[role]}", first / count)
        power[role] = 10 * np.log10(total / max(1, len(rows)) + 1e-30)
        if role is Role.MEASUREMENT:
            image = 10 * np.log10(np.array(rows) + 1e-30)
    centre = power.get(Role.REFERENCE, power.get(Role.MEASUREMENT))
    strongest = int(centre.argmax()) if centre is not None else 0
    reach = max(40, int(1.4e6 / (frequency[1] if len(frequency) > 1 else 1.0)))
    low, high = max(0, strongest - reach), min(len(frequency), strongest + reach)
    return Spectra(
        frequency,
        power,
        image[:, low:high],
        (-zero_s, -zero_s + recording.samples / recording.sample_rate_hz),
        (float(frequency[low]), float(frequency[high - 1])) if len(frequency) else (0.0, 1.0),
    )


class SpectrumPanel(QWidget):
    """Spectrum above, spectrogram of PD1 below."""

    wanted = Signal()

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 2)
        self._say = QLabel(self)
        self._say.setProperty("faint", True)
        column.addWidget(self._say)
        self._legend = Legend(self)
        column.addWidget(self._legend)
        split = QSplitter(Qt.Orientation.Vertical, self)
        self._spectrum = pg.PlotWidget(split, enableMenu=False)
        self._image = pg.PlotWidget(split, enableMenu=False)
        for widget, left, bottom in (
            (self._spectrum, "power (dB above 1 V²/Hz)", "frequency (MHz)"),
            (self._image, "frequency of PD1 (MHz)", "time from first touch (ms)"),
        ):
            item = widget.getPlotItem()
            item.hideButtons()
            item.setLabel("left", left)
            item.setLabel("bottom", bottom)
            item.getAxis("left").setWidth(AXIS_WIDTH)
            for side in ("left", "bottom"):
                item.getAxis(side).enableAutoSIPrefix(False)
        self._spectrum.setAccessibleName("Spectrum of the beats")
        self._image.setAccessibleName("Spectrogram of PD1")
        self._curves = {Role.REFERENCE: pg.PlotCurveItem(), Role.MEASUREMENT: pg.PlotCurveItem()}
        for curve in self._curves.values():
            self._spectrum.addItem(curve)
        self._picture = pg.ImageItem()
        self._picture.setColorMap(pg.colormap.get("viridis"))
        self._image.addItem(self._picture)
        column.addWidget(split, 1)
        self.dress(colours)
        self.show_spectra(None)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        pens = {Role.REFERENCE: under(colours.simulated), Role.MEASUREMENT: thin(colours.measured)}
        for role, curve in self._curves.items():
            curve.setPen(pens[role])
        for widget in (self._spectrum, self._image):
            widget.setBackground(colours.plot)
            for side in ("left", "bottom"):
                widget.getPlotItem().getAxis(side).setPen(pg.mkPen(colours.edge))
                widget.getPlotItem().getAxis(side).setTextPen(pg.mkPen(colours.text))
        self._spectrum.getPlotItem().showGrid(x=True, y=True, alpha=0.18)
        self._legend.show_entries([("PD0, at rest", pens[Role.REFERENCE]), ("PD1, moving", pens[Role.MEASUREMENT])])

    def has_spectra(self) -> bool:
        """Return whether spectra are shown."""
        return self._picture.image is not None

    def say(self, words: str) -> None:
        """Say what is being done or missing."""
        self._say.setText(words)

    def show_spectra(self, spectra: Spectra | None) -> None:
        """Show spectra, or say that there are none."""
        if spectra is None or not spectra.power_db:
            self._say.setText("Select a shot whose raw recording is at hand.")
            for curve in self._curves.values():
                curve.setData(np.empty(0), np.empty(0))
            self._picture.clear()
            return
        self._say.setText("")
        for role, curve in self._curves.items():
            power = spectra.power_db.get(role, np.empty(0))
            curve.setData(1e-6 * spectra.frequency_hz[: len(power)], power)
        low, high = 1e-6 * spectra.image_span_hz[0], 1e-6 * spectra.image_span_hz[1]
        left, right = 1e3 * spectra.image_span_s[0], 1e3 * spectra.image_span_s[1]
        highest = max(float(power[2:].max()) for power in spectra.power_db.values())
        lowest = min(float(np.median(power)) for power in spectra.power_db.values())
        self._spectrum.setRange(xRange=(low, high), yRange=(lowest - 10, highest + 5), padding=0)
        if spectra.image_db.size:
            floor = float(np.median(spectra.image_db))
            self._picture.setImage(spectra.image_db, levels=(floor, float(spectra.image_db.max())))
            self._picture.setRect(QRectF(left, low, right - left, high - low))
            self._image.setRange(xRange=(left, right), yRange=(low, high), padding=0)

"""SPECTRUM: what the beats are made of, over the whole record and over time."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt, Signal, Slot
from PySide6.QtWidgets import QLabel, QSplitter, QVBoxLayout, QWidget

from analysis.recording import Role
from app.plots.legend import Legend
from app.plots.plain_plot import PlainPlot
from app.spectra import NAMES, Spectra
from app.theme import Colours, thin, under


class SpectrumPanel(QWidget):
    """Spectrum above, spectrogram of PD1 below."""

    export_wanted = Signal(object, str)

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
        self._spectrum = PlainPlot("Spectrum of the beats", "power (dB above 1 V²/Hz)", "frequency (MHz)", split)
        self._image = PlainPlot(
            "Spectrogram of PD1", "frequency of PD1 (MHz)", "time from first touch (ms)", split, samples=False
        )
        for plot in (self._spectrum, self._image):
            plot.export_wanted.connect(self._export)
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
        for plot in (self._spectrum, self._image):
            plot.dress(colours)
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
        self._spectrum.show_range((low, high), spectra.power_span_db)
        named = {f"{NAMES[role]} (dB above 1 V²/Hz)": power for role, power in spectra.power_db.items()}
        self._spectrum.columns = {"frequency (MHz)": 1e-6 * spectra.frequency_hz, **named}
        if spectra.image_db.size:
            self._picture.setImage(spectra.image_db, levels=spectra.image_levels_db)
            self._picture.setRect(QRectF(left, low, right - left, high - low))
            self._image.show_range((left, right), (low, high))

    @Slot(object, str)
    def _export(self, plot: PlainPlot, kind: str) -> None:
        self.export_wanted.emit(plot, kind)

    @Slot()
    def open_menu(self) -> None:
        """Open the menu of the plot that has the keyboard, else of the spectrum."""
        (self._image if self._image.hasFocus() else self._spectrum).open_menu()

    @Slot()
    def reset(self) -> None:
        """Bring both plots back to their whole."""
        self._spectrum.reset()
        self._image.reset()

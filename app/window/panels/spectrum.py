"""SPECTRUM page: spectra of the beats, and the spectrogram of PD1."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtWidgets import QSplitter, QWidget

from analysis.shot import Role, Shot
from app.report import time_zero
from app.session import BEATS, Spectra
from app.window.controls.widgets import added, text_label, vertical
from app.window.plots.cursors import TIME, CursorAxis, CursorReadout
from app.window.plots.legend import Legend
from app.window.plots.lines import MEASURED, LineStyle
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.plot_notes import NoteAxes
from instrument.live import CHANNEL_NAMES

FREQUENCY = CursorAxis("MHz", "MHz")
LOOKS = {Role.REFERENCE: LineStyle("residual", width=3), Role.MEASUREMENT: MEASURED}
LEGEND = [("PD0, at rest", LOOKS[Role.REFERENCE]), ("PD1, moving", LOOKS[Role.MEASUREMENT])]


class SpectrumPanel(QWidget):
    """The SPECTRUM page: spectra above, spectrogram of PD1 below."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = vertical(self, (6, 6, 6, 2))
        self.said = text_label("", self, faint=True)
        self._legend = added(column, Legend(self))
        self._legend.show_entries(LEGEND)
        column.addWidget(self.said)
        split = QSplitter(Qt.Orientation.Vertical, self)
        self._spectrum = PlainPlot(
            "Spectrum of the beats", ("power", "dB above 1 V²/Hz"), "frequency", FREQUENCY, split
        )
        self._image = PlainPlot(
            "Spectrogram of PD1", ("frequency of PD1", "MHz"), "time from first touch", TIME, split, False
        )
        self.plots = (self._spectrum, self._image)
        self._curves = {role: self._spectrum.add_curve(CHANNEL_NAMES[role], LOOKS[role]) for role in BEATS}
        self._spectrum.legend = LEGEND
        self.picture = pg.ImageItem()
        self.picture.setColorMap(pg.colormap.get("viridis"))
        self._image.plot.addItem(self.picture)
        column.addWidget(split, 1)
        for plot in self.plots:
            column.addWidget(CursorReadout(plot, self))
        self.show_spectra(None)

    def show_spectra(self, spectra: Spectra | None, shot: Shot | None = None, words: str = "") -> None:
        """Show the spectra of a shot with the title ``words``; None: say that there are none."""
        for plot in self.plots:
            plot.set_shots((shot,) if spectra is not None else (), words)
        if spectra is None or not spectra.power_db:
            self.said.setText("Select a shot whose raw recording is available.")
            for curve in self._curves.values():
                curve.clear_samples()
            self.picture.clear()
            return
        self.said.setText("")
        for role, curve in self._curves.items():
            power = spectra.power_db.get(role, np.empty(0))
            curve.show_points(1e-6 * spectra.frequency_hz[: len(power)], power)
        low, high = 1e-6 * spectra.image_span_hz[0], 1e-6 * spectra.image_span_hz[1]
        left, right = 1e3 * spectra.image_span_s[0], 1e3 * spectra.image_span_s[1]
        self._spectrum.show_range((low, high), spectra.power_span_db)
        named = {f"{CHANNEL_NAMES[role]} (dB above 1 V²/Hz)": power for role, power in spectra.power_db.items()}
        self._spectrum.columns = {"frequency (MHz)": 1e-6 * spectra.frequency_hz, **named}
        if shot is not None:
            self._spectrum.notes.describe(self._spectrum.plot, NoteAxes("spectrum", 0.0, 1e-6))
            on_image = NoteAxes("spectrogram", time_zero(shot)[0], 1e3, 1e-6)
            self._image.notes.describe(self._image.plot, on_image)
        if spectra.image_db.size:
            self.picture.setImage(spectra.image_db, levels=spectra.image_levels_db)
            self.picture.setRect(QRectF(left, low, right - left, high - low))
            self._image.show_range((left, right), (low, high))

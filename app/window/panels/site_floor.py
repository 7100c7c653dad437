"""Site vibration on the LIVE page: third-octave spectrum with vibration criteria, spectral lines, expected u(COR)."""

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtWidgets import QVBoxLayout, QWidget

from analysis.reading import CENTRES_HZ, CRITERIA_M_PER_S, SiteFloor
from app.window.plots.cursors import CursorAxis, CursorReadout
from app.window.plots.lines import LineStyle
from app.window.plots.plain_plot import LogPlot
from app.window.theme import Colours, Themed
from app.window.widgets import horizontal, text_label
from app.words import localised_number, localised_text, with_prefix

FREQUENCY = CursorAxis("Hz", "Hz", logarithmic=True)
UM_PER_S = 1e6
SHOWN = ("VC-A", "VC-B", "VC-C", "VC-D", "VC-E", "VC-F", "VC-G")
LABELLED = ("VC-A", "VC-D", "VC-G")  # all seven names would overlap
MOST_LINES = 4
NO_FLOOR = "Floor vibration: leave the block at rest for one to two seconds."


def line_words(floor: SiteFloor) -> list[str]:
    """Return the strongest spectral lines with their probable causes, one text per line."""
    strongest = sorted(floor.lines, key=lambda line: -line.amplitude_m * line.frequency_hz)[:MOST_LINES]
    return [
        f"{localised_number(f'{line.frequency_hz:.2f}')} Hz  {with_prefix(line.amplitude_m, 'm')}  {line.cause}"
        for line in sorted(strongest, key=lambda line: line.frequency_hz)
    ]


def floor_words(floor: SiteFloor) -> str:
    """Return the vibration criterion met and the expected u(COR) in one line."""
    meets = f"meets {floor.criterion}" if floor.criterion else "meets no criterion"
    return localised_text(f"Floor vibration {meets}. Expected u(COR) now: {floor.cor_std:.1g}")


class SiteFloorPanel(Themed, QWidget):
    """The third-octave plot and its summary; the last floor vibration stays until a new one is measured."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shown: SiteFloor | None = None
        row = horizontal(self)
        self.plot = LogPlot("Floor vibration in third-octaves", ("velocity", "µm/s"), "frequency (Hz)", FREQUENCY, self)
        self.plot.setFixedHeight(150)
        self._names: list[pg.TextItem] = []
        self._criteria = [self.plot.add_curve(name, LineStyle("marker")) for name in SHOWN]
        self._curve = self.plot.add_curve("floor vibration", LineStyle("measured", width=3))
        for name, curve in zip(SHOWN, self._criteria, strict=True):
            level = UM_PER_S * CRITERIA_M_PER_S[name]
            curve.show_points(np.array([8.0, 80.0]), np.array([level, level]))
            label = pg.TextItem(name, anchor=(0.0, 0.5))
            label.setPos(np.log10(82.0), np.log10(level))
            label.setVisible(name in LABELLED)
            self.plot.plot.addItem(label)
            self._names.append(label)
        row.addWidget(self.plot, 1)
        words = QVBoxLayout()
        self.summary, self.lines, self.advice = said = [
            text_label(text, self, selectable=True, wrap=True) for text in (NO_FLOOR, "", "")
        ]
        for line in said:
            words.addWidget(line)
        words.addWidget(CursorReadout(self.plot, self))
        words.addStretch(1)
        row.addLayout(words, 1)
        self._show_levels(np.empty(0))

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        for label in self._names:
            label.setColor(colours.faint)

    def show_floor(self, floor: SiteFloor | None) -> None:
        """Show a measured floor vibration; None: nothing measured yet."""
        if floor is self._shown:
            return
        self._shown = floor
        if floor is None:
            self.summary.setText(NO_FLOOR)
            self.lines.setText("")
            self.advice.setText("")
            self._curve.clear_samples()
            self._show_levels(np.empty(0))
            return
        level = UM_PER_S * np.maximum(floor.third_octave_m_per_s, 1e-12)
        self._curve.show_points(CENTRES_HZ, level)
        self._show_levels(level)
        self.plot.columns = {"frequency (Hz)": CENTRES_HZ, "rms velocity (m/s)": floor.third_octave_m_per_s}
        self.summary.setText(floor_words(floor))
        self.lines.setText("\n".join(line_words(floor)))
        self.advice.setText("\n".join(f"{sentence}." for sentence in floor.advice))

    def _show_levels(self, level: NDArray[np.float64]) -> None:
        """Set the plot's range to contain the criteria and these levels in µm/s, (k,)."""
        levels = [*level, *(UM_PER_S * CRITERIA_M_PER_S[name] for name in (SHOWN[0], SHOWN[-1]))]
        self.plot.show_range((float(CENTRES_HZ[0]), float(CENTRES_HZ[-1])), (min(levels) / 1.6, 1.6 * max(levels)))

"""A plot axis without cut labels or overlapping numbers, and with a sparse grid."""

import math
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QTimer, Signal, Slot
from PySide6.QtGui import QFontMetricsF, QPainter

from analysis.uncertainty import with_unit
from app.window.plots.lines import straight
from app.words import localised_number

BEHIND = -1000


def _round_up(distance: float) -> float:
    """Round a distance up to the next of 1, 2, 5, 10, 20 ..."""
    decade = 10.0 ** math.floor(math.log10(max(distance, 1e-300)))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= distance * (1.0 - 1e-9))


class PlainAxis(pg.AxisItem):
    """The axis; only its coarsest ticks have grid lines."""

    fitted = Signal(bool)  # True: the whole label is shown

    def __init__(self, orientation: str) -> None:
        self.whole = self._unit = self._label_shown = ""
        self._fits = True
        self._group = [self]
        self._later = QTimer()
        self._later.setSingleShot(True)
        super().__init__(orientation)
        self._later.setParent(self)
        self._later.timeout.connect(self._fit_label)
        self._grid_pen = pg.mkPen("#e4e8ed")
        # redrawn only when it changes: most frames of LIVE show the same axis
        self.setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)

    def apply_colours(self, line: str, text: str, grid: str) -> None:
        self._grid_pen = straight(grid)
        self.setPen(straight(line))
        self.setTextPen(pg.mkPen(text))
        self.setGrid(255)
        self.setZValue(BEHIND)

    def resizeEvent(self, ev: Any = None) -> None:
        """Fit the label after this event, because Qt crashes if the label changes while it is drawn."""
        super().resizeEvent(ev)
        self._later.start()

    @Slot()
    def _fit_label(self) -> None:
        """Show the whole label if it fits, else only the unit, else nothing.

        A vertical axis never shows its unit alone ("V" on its side reads as ">"); the plot then shows a caption.
        """
        if not self.whole:
            return
        self._fits = self._has_room(self.whole)
        for axis in self._group:
            axis._show_label(all(other._fits for other in self._group if other.isVisible()))

    def _has_room(self, text: str) -> bool:
        room = self.size().height() if self.orientation == "left" else self.size().width()
        return QFontMetricsF(self.label.font()).horizontalAdvance(text) + 8 <= room

    def _show_label(self, whole: bool) -> None:
        text = self.whole if whole else self._unit if self.orientation != "left" and self._has_room(self._unit) else ""
        if text != self._label_shown:
            self._label_shown = self.labelText = text
            self.label.setHtml(self.labelString())
        super().resizeEvent(None)  # centre the label again
        self.fitted.emit(text == self.whole)

    def share_labels(self, others: "list[PlainAxis]") -> None:
        """Join the group of axes ``others``, which show their whole labels only if all labels fit."""
        others.append(self)
        self._group = others

    def name_quantity(self, quantity: str, unit: str) -> None:
        """Set the label: a quantity and its unit, "" for none."""
        self.whole = self._label_shown = with_unit(quantity, unit)
        self._unit = unit
        self.setLabel(self.whole)
        self._fit_label()  # fitted at once, so that a cut label is never drawn

    def generateDrawSpecs(self, p: QPainter) -> Any:
        """Keep only the grid lines of the coarsest ticks."""
        specs = super().generateDrawSpecs(p)
        if specs is None or not specs[1]:
            return specs
        axis, ticks, texts = specs
        strongest = max(pen.color().alpha() for pen, _, _ in ticks)
        kept = [(self._grid_pen, a, b) for pen, a, b in ticks if pen.color().alpha() >= strongest]
        return axis, kept, texts

    def tickSpacing(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, float]]:
        """Return only tick spacings at which the numbers do not overlap."""
        found: list[tuple[float, float]] = super().tickSpacing(minVal, maxVal, size)
        if not found or size <= 0.0 or self.logMode:
            return found
        metrics = QFontMetricsF(self.style["tickFont"] or self.font())

        def least(spacing: float) -> float:
            room = metrics.height()
            if self.orientation != "left":  # the wider of the numbers at both ends, plus a gap
                ends = self.tickStrings([minVal, maxVal], self.autoSIPrefixScale, spacing)
                room = max(map(metrics.horizontalAdvance, ends)) + metrics.horizontalAdvance("0")
            return room * abs(maxVal - minVal) / size

        kept = [(spacing, offset) for spacing, offset in found if spacing >= least(spacing)]
        if kept or self.orientation == "left":
            return kept or [(_round_up(least(found[0][0])), 0.0)]
        spacing = found[0][0]  # use a multiple of this spacing, with a tick near the middle
        middle = round(0.5 * (minVal + maxVal) / spacing) * spacing
        return [(math.ceil(least(spacing) / spacing) * spacing, middle)]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the tick numbers in the system's decimal format."""
        return [localised_number(text) for text in super().tickStrings(values, scale, spacing)]

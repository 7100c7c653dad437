"""An axis whose grid is one opaque line a labelled tick, behind the data: half-transparent grids cost half a frame."""

from typing import Any

import pyqtgraph as pg
from PySide6.QtGui import QPainter

from app.window.pens import straight
from app.words.wording import local

BEHIND = -1000


class PlainAxis(pg.AxisItem):
    """Draws the grid of the strongest ticks only, in one pen."""

    def __init__(self, orientation: str) -> None:
        super().__init__(orientation)
        self._grid_pen = pg.mkPen("#e4e8ed")

    def dress(self, line: str, text: str, grid: str) -> None:
        """Set the colours."""
        self._grid_pen = straight(grid)
        self.setPen(straight(line))
        self.setTextPen(pg.mkPen(text))
        self.setGrid(255)
        self.setZValue(BEHIND)

    def generateDrawSpecs(self, p: QPainter) -> Any:
        """Keep the lines of the labelled ticks."""
        specs = super().generateDrawSpecs(p)
        if specs is None or not specs[1]:
            return specs
        axis, ticks, texts = specs
        strongest = max(pen.color().alpha() for pen, _, _ in ticks)
        kept = [(self._grid_pen, a, b) for pen, a, b in ticks if pen.color().alpha() >= strongest]
        return axis, kept, texts

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the ticks in the system's decimal format."""
        return [local(text) for text in super().tickStrings(values, scale, spacing)]

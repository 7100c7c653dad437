"""Grid of small residual plots, one per shot, on a common symmetric-log axis, with the overlay of a candidate.

It is painted directly, because redrawing dozens of pyqtgraph plots would delay a frame whenever a candidate is hovered.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from analysis.shot import Floats
from app.window.controls.theme import Themed, Tone
from app.window.plots.curve import Pyramid
from app.words import number, prefix_for

MOST = 12  # most shots drawn
WIDEST = 4  # most cells in a row


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """Residuals of one shot, (n,) in m; ``before_m`` None: only the residual after is drawn."""

    title: str
    time_ms: Floats
    before_m: Floats | None
    after_m: Floats
    noise_m: Floats  # standard deviation


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """A candidate's contribution to a shot's residual, and the remaining residual, each (n,) in m."""

    signature_m: Floats
    remains_m: Floats


class ResidualGrid(Themed, QWidget):
    """The grid of residual plots on the DIAGNOSIS page."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.cells: tuple[Cell, ...] = ()
        self.overlays: tuple[Overlay | None, ...] = ()
        self.scale = SymLog(1.0, 10.0)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(13 * self.fontMetrics().lineSpacing())
        self.setAccessibleName("Residuals of all shots, before and after")

    def show_cells(self, cells: Sequence[Cell]) -> None:
        self.cells, self.overlays = tuple(cells[:MOST]), ()
        curves = [c for cell in self.cells for c in (cell.before_m, cell.after_m) if c is not None]
        noises = [noise for cell in self.cells if math.isfinite(noise := float(np.nanmedian(cell.noise_m)))]
        self.scale = scale_of(curves, 2.0 * float(np.median(noises)) if noises else math.nan)
        factor, unit = prefix_for(self.scale.most, "m")
        most, linear = number(factor * self.scale.most, 3), number(factor * self.scale.linear, 3)
        self.setAccessibleDescription(f"{len(self.cells)} shots; up to {most} {unit}, noise band {linear} {unit}")
        self.update()

    def overlay(self, overlays: Sequence[Overlay | None]) -> None:
        """Overlay a candidate's contribution and the remaining residual of each shot; empty: remove the overlay."""
        self.overlays = tuple(overlays)
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(self.colours.plot))
        if not self.cells:
            return
        metrics = self.fontMetrics()
        factor, unit = prefix_for(self.scale.most, "m")
        labels = [number(factor * tick, 3) for tick in self.scale.ticks()]
        left = max(metrics.horizontalAdvance(label) for label in [*labels, unit]) + 8
        bottom = metrics.height() + 4
        count = len(self.cells)
        columns = min(WIDEST, count, max(1, (self.width() - left) // (14 * metrics.horizontalAdvance("M"))))
        rows = math.ceil(count / columns)
        wide, high = (self.width() - left) / columns, (self.height() - bottom) / rows
        for place, cell in enumerate(self.cells):
            row, column = divmod(place, columns)
            area = QRectF(left + column * wide, row * high, wide - 8, high - 8)
            over = self.overlays[place] if place < len(self.overlays) else None
            self._draw(painter, area, cell, over)
            if column == 0:
                self._draw_axis(painter, area, labels, unit)
            if place + columns >= count:
                ends = cell.time_ms[[0, -1]] if cell.time_ms.size else np.array([0.0, 1.0])
                span = f"{number(float(ends[0]), 3)} … {number(float(ends[1]), 3)} ms"
                under = QRectF(area.left(), area.bottom(), area.width(), bottom)
                painter.setPen(QColor(self.colours.faint))
                painter.drawText(under, Qt.AlignmentFlag.AlignCenter, span)

    def _draw_axis(self, painter: QPainter, area: QRectF, labels: Sequence[str], unit: str) -> None:
        painter.setPen(QColor(self.colours.faint))
        height = self.fontMetrics().height()
        last = math.inf
        for tick, label in zip(self.scale.ticks(), labels, strict=True):
            y = self._y(area, np.array([tick]))[0]
            if last - y < height or y < area.top() + 1.4 * height:  # room for the unit at the top
                continue
            last = y
            box = QRectF(0.0, y - height / 2, area.left() - 4, height)
            painter.drawText(box, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, label)
        painter.drawText(QRectF(2.0, area.top(), area.left() - 4, height), Qt.AlignmentFlag.AlignLeft, unit)

    def _y(self, area: QRectF, values: Floats) -> Floats:
        return area.center().y() - 0.5 * area.height() * self.scale.place(values)

    def _draw(self, painter: QPainter, area: QRectF, cell: Cell, over: Overlay | None) -> None:
        c = self.colours
        self._band(painter, area, cell.noise_m)
        painter.setPen(QPen(QColor(c.grid)))
        for tick in self.scale.ticks():
            y = self._y(area, np.array([tick]))[0]
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
        painter.drawRect(area)
        if cell.before_m is not None:
            self._curve(painter, area, cell.before_m, QColor(c.marker), 1)
        self._curve(painter, area, cell.after_m, QColor(c.residual), 1)
        if over is not None:
            self._curve(painter, area, over.signature_m, QColor(c.simulated), 3)
            self._curve(painter, area, over.remains_m, QColor(c.signs[Tone.GOOD]), 1)
        painter.setPen(QColor(c.text))
        title = self.fontMetrics().elidedText(cell.title, Qt.TextElideMode.ElideRight, int(area.width()) - 8)
        painter.drawText(area.adjusted(5, 2, -3, -2), Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft, title)

    def _band(self, painter: QPainter, area: QRectF, noise_m: Floats) -> None:
        """Fill the band of two standard deviations of the noise."""
        at = np.linspace(0, noise_m.size - 1, max(16, int(area.width())) // 2).astype(int)
        x, high = np.linspace(area.left(), area.right(), at.size), np.nan_to_num(2.0 * noise_m[at])
        edge = [*zip(x, self._y(area, high), strict=True), *zip(x[::-1], self._y(area, -high[::-1]), strict=True)]
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(self.colours.band))
        painter.drawPolygon(QPolygonF([QPointF(*corner) for corner in edge]))
        painter.setBrush(Qt.BrushStyle.NoBrush)

    def _curve(self, painter: QPainter, area: QRectF, values: Floats, colour: QColor, width: int) -> None:
        """Draw a curve with at most two points per pixel, keeping its extremes."""
        columns = max(16, int(area.width()))
        places, y = Pyramid(values).view(0, values.size, columns)
        x, at = area.left() + places * (area.width() / max(1, values.size - 1)), self._y(area, y)
        pen = QPen(colour)
        pen.setWidth(width)
        painter.setPen(pen)
        for part in np.ma.clump_unmasked(np.ma.masked_invalid(at)):  # NaN interrupts the curve
            painter.drawPolyline(pg.functions.arrayToQPolygonF(x[part], at[part]))


MIN_DECADES = 0.7  # least decades beyond the linear part


@dataclass(frozen=True, slots=True)
class SymLog:
    """Symmetric-log map of values to -1 ... 1; ``linear`` is the end of the linear part, ``most`` the largest value."""

    linear: float
    most: float

    def place(self, values: Floats) -> Floats:
        """Return values mapped to -1 ... 1 and clipped; NaN stays NaN."""
        top = math.log10(1.0 + self.most / self.linear)
        with np.errstate(invalid="ignore"):
            at = np.sign(values) * np.log10(1.0 + np.abs(values) / self.linear) / top
            return np.clip(at, -1.0, 1.0)

    def ticks(self) -> list[float]:
        """Return zero and up to three decades of each sign."""
        first = math.ceil(math.log10(self.linear) - 1e-9)
        last = math.floor(math.log10(self.most) + 1e-9)
        step = max(1, math.ceil((last - first + 1) / 3))
        decades = [10.0**power for power in range(last, first - 1, -step)]
        return [-value for value in decades] + [0.0] + decades[::-1]


def scale_of(curves: Sequence[Floats], noise: float) -> SymLog:
    """Return a common scale for the curves that is linear up to the noise."""
    sizes = [float(np.nanmax(np.abs(curve))) for curve in curves if curve.size and np.isfinite(curve).any()]
    linear = noise if math.isfinite(noise) and noise > 0.0 else max(sizes, default=1.0) / 100.0 or 1.0
    return SymLog(linear, max([*sizes, linear * 10.0**MIN_DECADES]))

"""Pens and curves that look equally wide on screens of any pixel density and draw quickly even for noise.

The pen is one device pixel wide, because a wider zigzag takes seconds per frame.  On a dense screen the line is drawn
again one device pixel to the left and above.  Where samples are closer than pixels, each column of pixels is filled
from its least to its greatest value instead.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyqtgraph as pg
from pyqtgraph.Qt.internals import PrimitiveArray
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPen, QTransform
from PySide6.QtWidgets import QWidget

from analysis.shot import Floats
from app.window.controls.theme import LIGHT, Colours

DASHES = (
    Qt.PenStyle.SolidLine,
    Qt.PenStyle.DashLine,
    Qt.PenStyle.DotLine,
    Qt.PenStyle.DashDotLine,
)


def density() -> float:
    """Return the device pixels per logical pixel of the densest screen."""
    application = QGuiApplication.instance()
    return float(application.devicePixelRatio()) if isinstance(application, QGuiApplication) else 1.0


def straight(colour: str, dash: Qt.PenStyle = Qt.PenStyle.SolidLine, width: int = 1) -> QPen:
    """Return a pen for lines with few segments, such as straight lines and smooth curves."""
    return pg.mkPen(QColor(colour), width=max(1, round(width * density())), style=dash)


@dataclass(frozen=True, slots=True)
class LineStyle:
    """Style of a line or band, independent of the colour scheme."""

    colour: str  # name of a field of ``Colours``
    dash: Qt.PenStyle = Qt.PenStyle.SolidLine
    width: int = 0  # in logical pixels, for few segments; 0: one device pixel, for many points
    place: int = 0  # index of the colour if the field has several
    edges: str = ""  # field of the edges' colour if this is a band, else ""

    def of(self, colours: Colours) -> str:
        """Return the colour in a scheme."""
        colour: str | tuple[str, ...] = getattr(colours, self.colour)
        return colour if isinstance(colour, str) else colour[self.place % len(colour)]

    def pen(self, colours: Colours) -> QPen:
        """Return the pen; for many points it is one device pixel wide; ``CrispCurve`` widens it on a dense screen."""
        colour = self.of(colours)
        if self.width:
            return straight(colour, self.dash, self.width)
        return pg.mkPen(QColor(colour), width=1, style=self.dash)


MEASURED, RESIDUAL = LineStyle("measured"), LineStyle("residual")
SIMULATED = LineStyle("simulated", width=3)  # wider than the measured curve above it, so that both are visible
BAND = LineStyle("band", edges="band_edge")


def series(index: int) -> LineStyle:
    """Return the look of the index-th overlaid shot: a different colour, and a new dash when the colours repeat."""
    turn, place = divmod(index, len(LIGHT.series))
    return LineStyle("series", DASHES[turn % len(DASHES)], place=place)


DENSE = 1.5  # least device pixels per logical pixel of a dense screen


class CrispCurve(pg.PlotCurveItem):
    """A curve that is visible on screens of any pixel density; without a look it is not drawn."""

    def __init__(self, *points: Floats, look: LineStyle | None = None, **how: Any) -> None:
        super().__init__(*points, **how)
        self.look = look

    def apply_colours(self, colours: Colours) -> None:
        self.setPen(self.look.pen(colours) if self.look is not None else pg.mkPen(None))

    def boundingRect(self) -> QRectF:
        """Return the whole view, which is quicker than finding the bounds of all points after each change."""
        view = self.getViewBox()
        return super().boundingRect() if view is None else view.viewRect()

    def paint(self, painter: QPainter, option: object, widget: QWidget | None) -> None:
        if not _has_room(painter):
            return
        super().paint(painter, option, widget)
        ratio = painter.device().devicePixelRatioF()
        if ratio < DENSE or self.opts["pen"].widthF() > 1.0:
            return
        upright = painter.worldTransform()
        for right, down in ((-1.0, 0.0), (0.0, -1.0)):
            painter.setWorldTransform(upright * QTransform.fromTranslate(right / ratio, down / ratio))
            super().paint(painter, option, widget)
        painter.setWorldTransform(upright)


class ColumnCurve(CrispCurve):
    """A curve that is drawn as filled columns of pixels when it is decimated to extremes."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self._columns: tuple[Floats, Floats, Floats] | None = None
        self._rectangles = PrimitiveArray(QRectF, 4)

    def show_line(self, x: Floats, y: Floats) -> None:
        """Show a line through points with x (n,) and y (n,)."""
        self._columns = None
        self.setData(x, y)

    def show_columns(self, x: Floats, y: Floats) -> None:
        """Show (2n,) points: the least, then the greatest value of each column of pixels, both at the same x."""
        least, greatest = y[0::2], y[1::2]
        reach, depth = least.copy(), greatest.copy()  # extended to the neighbour to close gaps
        np.fmin(least[1:], greatest[:-1], out=reach[1:])
        np.fmax(greatest[1:], least[:-1], out=depth[1:])
        seen = np.isfinite(least) & np.isfinite(greatest)
        self._columns = x[0::2][seen], reach[seen], depth[seen]
        self.setData(x, y)

    def paint(self, painter: QPainter, option: object, widget: QWidget | None) -> None:
        if not _has_room(painter):
            return
        if self._columns is None or len(self._columns[0]) < 2:
            super().paint(painter, option, widget)
            return
        x, least, greatest = self._columns
        scale = painter.worldTransform()
        wide, high = abs(1 / scale.m11()), abs(1 / scale.m22())  # size of a logical pixel
        pen = self.opts["pen"]
        thick = max(1.0, pen.widthF() / painter.device().devicePixelRatioF())
        self._rectangles.resize(len(x))
        memory = self._rectangles.ndarray()
        memory[:, 0] = x - 0.5 * thick * wide
        memory[:, 1] = least - 0.5 * thick * high
        memory[:, 2] = max(thick * wide, float(x[1] - x[0]))
        memory[:, 3] = greatest - least + thick * high
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.setPen(pg.mkPen(None))
        painter.setBrush(pen.color())
        painter.drawRects(*self._rectangles.drawargs())


def _has_room(painter: QPainter) -> bool:
    """Return whether the plot has an area; Qt crashes if all values map to one position."""
    scale = painter.worldTransform()
    return abs(scale.determinant()) > 0.0

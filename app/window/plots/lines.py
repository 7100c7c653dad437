"""Lines that look equally wide on screens of any density: their pens, and curves drawn quickly also with noise.

The pen is one device pixel wide, as a wider zigzag takes seconds per frame; on a dense screen the line is drawn again
one device pixel to the left and above.  Where samples are closer than pixels, each column of pixels is filled from its
least to its greatest value instead.
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
from app.window.theme import LIGHT, Colours

DASHES = (
    Qt.PenStyle.SolidLine,
    Qt.PenStyle.DashLine,
    Qt.PenStyle.DotLine,
    Qt.PenStyle.DashDotLine,
)


def density() -> float:
    """Return device pixels per logical pixel of the densest screen."""
    application = QGuiApplication.instance()
    return float(application.devicePixelRatio()) if isinstance(application, QGuiApplication) else 1.0


def straight(colour: str, dash: Qt.PenStyle = Qt.PenStyle.SolidLine, width: int = 1) -> QPen:
    """Return the pen for few segments: a straight line, a smooth curve."""
    return pg.mkPen(QColor(colour), width=max(1, round(width * density())), style=dash)


@dataclass(frozen=True, slots=True)
class Look:
    """How a line is drawn in any scheme of colours."""

    colour: str  # a field of ``Colours``
    dash: Qt.PenStyle = Qt.PenStyle.SolidLine
    width: int = 0  # of few segments, in logical pixels; 0: as thin as many points need
    place: int = 0  # of the colour, where the field has several
    edges: str = ""  # the colour of a band's edges, which makes it a band

    def of(self, colours: Colours) -> str:
        """Return the colour itself."""
        colour: str | tuple[str, ...] = getattr(colours, self.colour)
        return colour if isinstance(colour, str) else colour[self.place % len(colour)]

    def pen(self, colours: Colours) -> QPen:
        """Return its pen; of many points one device pixel, opaque, which a ``CrispCurve`` widens on a dense screen."""
        colour = self.of(colours)
        if self.width:
            return straight(colour, self.dash, self.width)
        return pg.mkPen(QColor(colour), width=1, style=self.dash)


MEASURED, RESIDUAL = Look("measured"), Look("residual")
SIMULATED = Look("simulated", width=3)  # smooth and below another, so that both are visible where they agree
BAND = Look("band", edges="band_edge")


def series(index: int) -> Look:
    """Return the look of the index-th overlaid shot: another colour each, another dash when the colours repeat."""
    turn, place = divmod(index, len(LIGHT.series))
    return Look("series", DASHES[turn % len(DASHES)], place=place)


DENSE = 1.5  # device pixels to a logical one


class CrispCurve(pg.PlotCurveItem):
    """A curve that is visible at any density of the screen; without a look it is not drawn."""

    def __init__(self, *points: Floats, look: Look | None = None, **how: Any) -> None:
        super().__init__(*points, **how)
        self.look = look

    def dress(self, colours: Colours) -> None:
        self.setPen(self.look.pen(colours) if self.look is not None else pg.mkPen(None))

    def boundingRect(self) -> QRectF:
        """Return the whole of the view, which is quicker than a look at all points for every new set of them."""
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
    """A curve drawn as columns of pixels where it is decimated to extremes."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self._columns: tuple[Floats, Floats, Floats] | None = None
        self._rectangles = PrimitiveArray(QRectF, 4)

    def show_line(self, x: Floats, y: Floats) -> None:
        """Show a line through points (n,)."""
        self._columns = None
        self.setData(x, y)

    def show_columns(self, x: Floats, y: Floats) -> None:
        """Show (2n,) points: least and greatest value of each column of pixels in turn, at one x each."""
        least, greatest = y[0::2], y[1::2]
        reach, depth = least.copy(), greatest.copy()  # extended to the neighbour, so that there are no gaps
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
        wide, high = abs(1 / scale.m11()), abs(1 / scale.m22())  # a logical pixel
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
    """Return whether the plot has an area; Qt crashes where all values map to one."""
    scale = painter.worldTransform()
    return abs(scale.determinant()) > 0.0

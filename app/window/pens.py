"""The pens of the plots, as wide on a dense screen as on any other."""

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QGuiApplication, QPen

from app.window.theme import Colours

DASHES = (
    Qt.PenStyle.SolidLine,
    Qt.PenStyle.DashLine,
    Qt.PenStyle.DotLine,
    Qt.PenStyle.DashDotLine,
)


def density() -> float:
    """Return the device pixels to a logical one, on the densest screen there is."""
    application = QGuiApplication.instance()
    return float(application.devicePixelRatio()) if isinstance(application, QGuiApplication) else 1.0


def thin(colour: str, dash: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Return the only pen curves may use: one device pixel wide, opaque (a wider zigzag costs seconds a frame).

    A ``CrispCurve`` makes it as wide as it should be on a dense screen.
    """
    return pg.mkPen(QColor(colour), width=1, style=dash)


def under(colour: str) -> QPen:
    """Return the pen of a smooth curve that lies under another, wide enough that both are seen where they agree."""
    return straight(colour, width=3)


def straight(colour: str, dash: Qt.PenStyle = Qt.PenStyle.SolidLine, width: int = 1) -> QPen:
    """Return the pen of what has few segments: a line across the plot, a smooth curve."""
    return pg.mkPen(QColor(colour), width=max(1, round(width * density())), style=dash)


def series_pen(colours: Colours, index: int) -> QPen:
    """Return the pen of the index-th overlaid shot: its own colour, and its own dash each time the colours repeat."""
    turn, place = divmod(index, len(colours.series))
    return thin(colours.series[place], DASHES[turn % len(DASHES)])

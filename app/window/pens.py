"""The pens of the plots, equally wide on screens of any density."""

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
    """Return device pixels per logical pixel of the densest screen."""
    application = QGuiApplication.instance()
    return float(application.devicePixelRatio()) if isinstance(application, QGuiApplication) else 1.0


def thin(colour: str, dash: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Return the pen for curves of many points: one device pixel, opaque; a wider one takes seconds per frame.

    A ``CrispCurve`` widens it on a dense screen.
    """
    return pg.mkPen(QColor(colour), width=1, style=dash)


def under(colour: str) -> QPen:
    """Return the pen of a smooth curve below another, wider so that both are visible where they agree."""
    return straight(colour, width=3)


def straight(colour: str, dash: Qt.PenStyle = Qt.PenStyle.SolidLine, width: int = 1) -> QPen:
    """Return the pen for few segments: a straight line, a smooth curve."""
    return pg.mkPen(QColor(colour), width=max(1, round(width * density())), style=dash)


def series_pen(colours: Colours, index: int) -> QPen:
    """Return the pen of the index-th overlaid shot: another colour each, another dash when the colours repeat."""
    turn, place = divmod(index, len(colours.series))
    return thin(colours.series[place], DASHES[turn % len(DASHES)])

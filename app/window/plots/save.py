"""A plot as a file: picture, drawing, or the samples that are in view."""

import csv
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgGenerator

from app.window.plots.curve import SampledCurve
from app.window.plots.time_stack import TimeStack


def save_png(view: pg.GraphicsView, path: Path, scale: float = 2.0) -> None:
    """Write the plot as it looks, ``scale`` times finer than the screen.  Raises OSError."""
    image = QImage(view.size() * scale, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(scale)
    image.fill(view.backgroundBrush().color())
    painter = QPainter(image)
    view.render(painter, QRectF(0, 0, view.width(), view.height()))  # else it takes the device's pixels for its own
    painter.end()
    if not image.save(str(path), "PNG"):  # type: ignore[call-overload]  # its types want bytes, itself takes text
        raise OSError(f"{path}: could not be written")


def save_svg(view: pg.GraphicsView, path: Path) -> None:
    """Write the plot as lines and text.  Raises OSError."""
    generator = QSvgGenerator()
    generator.setFileName(str(path))
    size = view.size()
    generator.setSize(QSize(size.width(), size.height()))
    generator.setViewBox(QRectF(0, 0, size.width(), size.height()))
    generator.setTitle("Levimass")
    painter = QPainter()
    if not painter.begin(generator):
        raise OSError(f"{path}: could not be written")
    painter.fillRect(QRectF(0, 0, size.width(), size.height()), view.backgroundBrush())
    view.render(painter, QRectF(0, 0, size.width(), size.height()))
    painter.end()


def save_csv(stack: TimeStack, path: Path) -> None:
    """Write every sample in view, undecimated: one column of time a sampling grid, "." and ",".  Raises OSError."""
    left, right = stack.span
    groups: dict[tuple[float, float, int, int], list[tuple[str, SampledCurve]]] = {}
    for plot in stack.plots:
        for curve in plot.sampled:
            if curve.isVisible() and len(curve.samples):
                key = (*curve.grid, *curve.index_range(left, right))
                groups.setdefault(key, []).append((f"{plot.title} {curve.label} ({plot.unit})", curve))
    heads: list[str] = []
    columns: list[np.ndarray] = []
    for members in groups.values():
        x, _ = members[0][1].between(left, right)
        heads.append("time (ms)")
        columns.append(x)
        for head, curve in members:
            heads.append(head)
            columns.append(curve.between(left, right)[1])
    _write(heads, columns, path)


def save_columns(columns: dict[str, np.ndarray], path: Path) -> None:
    """Write named columns.  Raises OSError."""
    _write(list(columns), list(columns.values()), path)


def _write(heads: list[str], columns: list[np.ndarray], path: Path) -> None:
    longest = max((len(column) for column in columns), default=0)
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(heads)
        for index in range(longest):
            rows.writerow([f"{column[index]:.12g}" if index < len(column) else "" for column in columns])

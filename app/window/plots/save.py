"""Save a plot as PNG, SVG or CSV, or copy it as a picture."""

from collections.abc import Collection, Sequence
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgGenerator

from app.report import write_table
from app.window.plots.legend import legend_height, paint_legend
from app.window.plots.lines import LineStyle
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimeStack

SCALE = 2.0  # pixels of a picture per logical pixel of the screen


def save_png(view: pg.GraphicsView, path: Path) -> None:
    """Write the plot with title and legend as PNG.  Raises OSError."""
    if not picture(view).save(str(path), "PNG"):  # type: ignore[call-overload]  # the stub asks for bytes
        raise OSError(f"{path}: could not be written")


def picture(view: pg.GraphicsView) -> QImage:
    """Return the picture of ``save_png``, with twice the resolution of the screen."""
    size = _whole(view)
    image = QImage(size * SCALE, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(SCALE)
    painter = QPainter(image)
    _draw(painter, view, size)
    painter.end()
    return image


def _whole(view: pg.GraphicsView) -> QSize:
    above = legend_height(_legend(view), view.width(), view.font())
    return QSize(view.width(), view.height() + above + _heading_height(view))


def _heading_height(view: pg.GraphicsView) -> int:
    return view.fontMetrics().height() + 6 if view.accessibleDescription() else 0


def _legend(view: pg.GraphicsView) -> Sequence[tuple[str, LineStyle]]:
    return view.legend if isinstance(view, PlotView) else ()


def _draw(painter: QPainter, view: pg.GraphicsView, size: QSize) -> None:
    above = size.height() - view.height()
    painter.fillRect(QRectF(0, 0, size.width(), size.height()), view.backgroundBrush())
    painter.setFont(view.font())
    painter.setPen(view.palette().text().color())
    heading = _heading_height(view)
    if heading:  # the title with the name of the shot
        painter.drawText(QRectF(6, 2, size.width() - 12, heading), view.accessibleDescription())
    painter.save()
    painter.translate(0, heading)
    if isinstance(view, PlotView):
        paint_legend(painter, view.legend, size.width(), view.colours)
    painter.restore()
    view.render(painter, QRectF(0, above, view.width(), view.height()))  # the default target is in device pixels


def save_svg(view: pg.GraphicsView, path: Path) -> None:
    """Write the plot with title and legend as SVG.  Raises OSError."""
    generator = QSvgGenerator()
    generator.setFileName(str(path))
    size = _whole(view)
    generator.setSize(QSize(size.width(), size.height()))
    generator.setViewBox(QRectF(0, 0, size.width(), size.height()))
    generator.setTitle("Levimass")
    painter = QPainter()
    if not painter.begin(generator):
        raise OSError(f"{path}: could not be written")
    _draw(painter, view, size)
    painter.end()


def save_csv(stack: TimeStack, path: Path) -> None:
    """Write all samples in view as CSV, with one time column per set of equal times.  Raises RecordingError."""
    groups: list[tuple[np.ndarray, list[tuple[str, np.ndarray]]]] = []  # (times, [(heading, values)])
    for plot in stack.plots:
        for curve in plot.sampled:
            if curve.isVisible() and len(curve.samples):
                x, values = curve.between(*stack.span)
                group = next((of for times, of in groups if np.array_equal(times, x)), None)
                if group is None:
                    groups.append((x, group := []))
                group.append((f"{plot.title} {curve.label} ({plot.unit})", values))
    time = f"time ({stack.cursors.axis.unit})"
    save_columns([column for x, group in groups for column in ((time, x), *group)], path)


def save_columns(columns: Collection[tuple[str, np.ndarray]], path: Path) -> None:
    """Write columns, each with its heading, as CSV.  Raises RecordingError."""
    rows = zip_longest(*(values for _, values in columns))  # shorter columns are filled with None
    texts = ([f"{value:.12g}" if value is not None else "" for value in row] for row in rows)
    write_table([head for head, _ in columns], texts, path)

"""Save a plot as PNG, SVG or CSV, or copy it as a picture."""

from collections.abc import Collection
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPoint, QRectF, QSize
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QWidget

from app.report import write_table
from app.window.plots.legend import Legend
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimeStack

SCALE = 2.0  # pixels of a picture per logical pixel of the screen
_MARGIN = 6  # in pixels, of title and legend


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
    return QSize(view.width(), view.height() + _legend(view).height() + _heading_height(view))


def _heading_height(view: pg.GraphicsView) -> int:
    return view.fontMetrics().height() + 6 if view.accessibleDescription() else 0


def _legend(view: pg.GraphicsView) -> Legend:
    """Return the legend of a picture, which is as wide as the plot; without entries its height is 0."""
    legend, width = Legend(), view.width() - 2 * _MARGIN
    if isinstance(view, PlotView):
        legend.apply_colours(view.colours)
        legend.show_entries(view.legend)
    legend.resize(width, legend.layout().heightForWidth(width))
    return legend


def _draw(painter: QPainter, view: pg.GraphicsView, size: QSize) -> None:
    above = size.height() - view.height()
    painter.fillRect(QRectF(0, 0, size.width(), size.height()), view.backgroundBrush())
    painter.setFont(view.font())
    painter.setPen(view.palette().text().color())
    heading = _heading_height(view)
    if heading:  # the title with the name of the shot
        painter.drawText(QRectF(_MARGIN, 2, size.width() - 2 * _MARGIN, heading), view.accessibleDescription())
    _legend(view).render(painter, QPoint(_MARGIN, heading), renderFlags=QWidget.RenderFlag.DrawChildren)
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

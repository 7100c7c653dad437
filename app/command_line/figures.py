"""Draw figures 4 to 7 of the paper as PNG and SVG: measured on the left, simulated on the right.

They are drawn with pyqtgraph, which the window needs anyway, so that no other plotting library is required.
"""

from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from analysis.paper import Curve, Figure, Row, figures, load, paper_rig
from analysis.shot import Shot
from app.window import LIGHT, save_png, save_svg

WIDTH, HEIGHT = 1000, 380  # size of one row in logical pixels
AXIS_WIDTH = 64


def write_figures(shot: Shot | None, folder: Path) -> list[Path]:
    """Write ``figure-4`` to ``figure-7`` as PNG and SVG and return their paths.  Raises OSError.

    Without a shot, or for a shot without impact, the left column contains only a sentence that says so.
    """
    application = QApplication.instance() or QApplication([])
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for figure in figures(paper_rig(load()).collision, shot):
        view = draw(figure)
        application.processEvents()  # type: ignore[attr-defined]
        for ending, save in (("png", save_png), ("svg", save_svg)):
            path = folder / f"figure-{figure.number}.{ending}"
            save(view, path)
            written.append(path)
        view.close()
    return written


def draw(figure: Figure) -> pg.GraphicsLayoutWidget:
    """Return one figure, laid out; both plots of a row have the same ranges."""
    view = pg.GraphicsLayoutWidget()
    view.setAttribute(Qt.WidgetAttribute.WA_DontShowOnScreen)
    view.setBackground(LIGHT.plot)
    view.resize(WIDTH, HEIGHT * len(figure.rows) + 60)
    caption = f"Fig. {figure.number}  {figure.title}"
    view.addLabel(caption, row=0, col=0, colspan=2, color=LIGHT.text, size="12pt", bold=True)
    for number, row in enumerate(figure.rows):
        left = _plot(view, 2 * number + 1, 0, row, row.measured, "measured", LIGHT.measured)
        right = _plot(view, 2 * number + 1, 1, row, row.simulated, "simulated", LIGHT.simulated)
        ranges = [_span([c for c in (row.measured, row.simulated) if c is not None], axis) for axis in ("x", "y")]
        for plot in (left, right):
            plot.setRange(xRange=ranges[0], yRange=ranges[1], padding=0.03)
    view.show()  # computes the layout without showing a window
    return view


def _plot(
    view: pg.GraphicsLayoutWidget, line: int, column: int, row: Row, curve: Curve | None, title: str, colour: str
) -> pg.PlotItem:
    plot = view.addPlot(row=line, col=column)
    plot.setTitle(title, color=LIGHT.faint, size="10pt")
    plot.hideButtons()
    plot.setMenuEnabled(False)
    for side, label in (("left", row.y_label), ("bottom", row.x_label)):
        axis = plot.getAxis(side)
        axis.enableAutoSIPrefix(False)
        axis.setPen(pg.mkPen(LIGHT.edge))
        axis.setTextPen(pg.mkPen(LIGHT.text))
        plot.setLabel(side, label)
    plot.getAxis("left").setWidth(AXIS_WIDTH)
    if curve is None:
        words = pg.TextItem(row.missing, color=LIGHT.faint, anchor=(0.5, 0.5))
        (low, high), (bottom, top) = _span([row.simulated], "x"), _span([row.simulated], "y")
        words.setPos(0.5 * (low + high), 0.5 * (bottom + top))
        plot.addItem(words)
    else:
        plot.plot(curve.x, curve.y, pen=pg.mkPen(colour, width=2), antialias=True)
    return plot


def _span(curves: list[Curve], axis: str) -> tuple[float, float]:
    values = np.concatenate([getattr(curve, axis) for curve in curves])
    return float(values.min()), float(values.max())

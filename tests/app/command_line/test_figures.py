"""The paper's figures: titles, axes, curves and shared ranges of measured and simulated, as text."""

from pathlib import Path

import numpy as np
import pyqtgraph as pg

from analysis.paper.paper import load, paper_rig
from analysis.paper.paper_figures import figures
from app.command_line.figures import draw
from tests.app import synthetic
from tests.app.window.scene import check
from tests.app.window.shown import _numbers, _span

KEPT = Path(__file__).parent / "written"


def _said(view):
    """Return the lines of a figure: caption, then each plot with its axes, ranges and curve."""
    lines = [item.text for item in view.ci.items if isinstance(item, pg.LabelItem)]
    plots = sorted((cells[0], item) for item, cells in view.ci.items.items() if isinstance(item, pg.PlotItem))
    for (row, column), plot in plots:
        x, y = plot.viewRange()
        lines.append(f"{row}, {column}: {plot.titleLabel.text}, x {_span(*x)}, y {_span(*y)}")
        lines.append(f"    {plot.getAxis('left').labelText} against {plot.getAxis('bottom').labelText}")
        lines += [f"    curve: {_numbers(*curve.getData())}" for curve in plot.curves]
        lines += [f"    words: {item.toPlainText()}" for item in plot.items if isinstance(item, pg.TextItem)]
    return lines


def test_what_the_figures_show(qapp):
    rig = paper_rig(load()).collision
    parts = {}
    for name, shot in (("with a shot", synthetic.shot()), ("without one", None)):
        for figure in figures(rig, shot):
            view = draw(figure)
            for row in (1, 3):
                pair = [view.ci.getItem(row, column) for column in (0, 1)]
                if all(pair):
                    assert np.allclose(pair[0].viewRange(), pair[1].viewRange())  # to be compared by eye
            parts[f"figure {figure.number} {name}"] = _said(view)
            view.close()
    check("figures", parts, KEPT)

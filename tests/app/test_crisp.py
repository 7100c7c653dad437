"""What a curve drawn as columns of pixels covers: its extremes, at least a pixel wide and high, in any scale."""

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtGui import QImage, QPainter

from app.window.plots.lines import ColumnCurve, CrispCurve

SIZE = 200


def _inked(x: np.ndarray, y: np.ndarray, wide: float, high: float) -> np.ndarray:
    """Return which pixels, shape (rows, columns), columns of extremes cover at so many pixels per unit either way."""
    curve = ColumnCurve(pen=pg.mkPen("k", width=1))
    curve.show_columns(x, y)
    image = QImage(SIZE, SIZE, QImage.Format.Format_Grayscale8)
    image.fill(255)
    painter = QPainter(image)
    painter.scale(wide, high)
    curve.paint(painter, None, None)
    painter.end()
    return np.frombuffer(image.constBits(), np.uint8).reshape(SIZE, image.bytesPerLine())[:, :SIZE] < 128


@pytest.mark.parametrize(("wide", "high"), [(1.0, 1.0), (1.0, 100.0), (100.0, 1.0), (40.0, 0.5)])
def test_still_samples_are_a_line_one_pixel_high_in_any_scale(qtbot, wide: float, high: float) -> None:
    x = np.repeat((np.arange(10, 150) + 0.75) / wide, 2)  # clear of where a pixel changes hands
    inked = _inked(x, np.full(x.size, 100.25 / high), wide, high)
    assert list(np.flatnonzero(inked.any(axis=1))) in ([99], [100])
    assert inked.any(axis=0)[11:149].all() and not inked[:, :9].any() and not inked[:, 152:].any()


def test_a_column_reaches_from_its_least_to_its_greatest_value_and_to_its_neighbour(qtbot) -> None:
    x = np.repeat(np.arange(10.0, 60.0), 2)
    least, greatest = np.full(50, 40.0), np.full(50, 60.0)
    least[25:], greatest[25:] = 120.0, 140.0  # a jump: the columns on either side of it meet
    inked = _inked(x, np.stack([least, greatest], axis=1).ravel(), 1.0, 1.0)
    rows = [np.flatnonzero(inked[:, column]) for column in (15, 55)]
    for found, (low, high) in zip(rows, ((40, 60), (120, 140)), strict=True):
        assert abs(found[0] - low) <= 1 and abs(found[-1] - high) <= 1 and found.size == found[-1] - found[0] + 1
    assert inked[60:120, 34:36].any(axis=1).all()


def test_a_curve_takes_the_whole_view_wherever_its_points_are(qtbot) -> None:
    view, curve = pg.ViewBox(), CrispCurve(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    view.addItem(curve)
    view.setRange(xRange=(5.0, 9.0), yRange=(-2.0, 3.0), padding=0)
    assert curve.boundingRect() == view.viewRect()
    assert curve.boundingRect().left() == pytest.approx(5.0) and curve.boundingRect().width() == pytest.approx(4.0)

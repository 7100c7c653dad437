"""Curves that hold all samples and draw at most two points per pixel; noise bands."""

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QPen

from app.window.plots.lines import ColumnCurve, CrispCurve
from app.window.plots.pyramid import Array, Pyramid, is_whole


class SampledCurve(ColumnCurve):
    """A curve of uniform samples.

    The samples are not copied or decimated; their pyramid gives what is drawn at each change of the view.
    """

    def __init__(self, name: str, unit: str, pen: QPen) -> None:
        super().__init__(pen=pen, connect="finite", antialias=False, skipFiniteCheck=False)
        self.label = name
        self.unit = unit
        self._pyramid = Pyramid()
        self._start = 0.0
        self._step = 1.0

    @property
    def samples(self) -> Array:
        """Get the values, shape (n,)."""
        return self._pyramid.values

    @property
    def grid(self) -> tuple[float, float]:
        """Get the x of the first sample and the step, in the plot's own x unit."""
        return self._start, self._step

    def show_samples(self, start: float, step: float, values: Array | Pyramid) -> None:
        """Show ``values`` (n,) at x = start + i*step; a Pyramid built elsewhere is used as it is."""
        self._pyramid = values if isinstance(values, Pyramid) else Pyramid(values)
        self._start, self._step = start, step
        self.redraw()

    def clear_samples(self) -> None:
        self.show_samples(0.0, 1.0, np.empty(0))

    def index_range(self, left: float, right: float) -> tuple[int, int]:
        """Return the samples (start, stop) that lie between two x."""
        count = len(self._pyramid)
        if count == 0 or not (np.isfinite(left) and np.isfinite(right)):
            return 0, 0
        first = int(np.clip(np.ceil((left - self._start) / self._step - 1e-9), 0, count))
        last = int(np.clip(np.floor((right - self._start) / self._step + 1e-9) + 1, first, count))
        return first, last

    def between(self, left: float, right: float) -> tuple[NDArray[np.floating], Array]:
        """Return x and values of all samples between two x, undecimated."""
        first, last = self.index_range(left, right)
        return self._start + self._step * np.arange(first, last), self._pyramid.values[first:last]

    def extremes(self, left: float, right: float) -> tuple[float, float]:
        """Return the smallest and the largest value between two x; NaN where there are none."""
        first, last = self.index_range(left, right)
        return self._pyramid.extremes(first, last)

    def value_at(self, x: float) -> float:
        """Return the sample nearest to x; NaN outside."""
        count = len(self._pyramid)
        index = round((x - self._start) / self._step) if np.isfinite(x) else -1
        return float(self._pyramid.values[index]) if 0 <= index < count else float("nan")

    def viewRangeChanged(self, *_: object) -> None:
        self.redraw()

    def redraw(self) -> None:
        """Draw what the present view can show."""
        view = self.getViewBox()
        if view is None or len(self._pyramid) == 0:
            self.show_line(np.empty(0), np.empty(0))
            return
        (left, right), _ = view.viewRange()
        pixels = max(64, int(view.width()))
        first, last = self.index_range(left, right)
        positions, values = self._pyramid.view(first - 1, last + 1, pixels)
        show = self.show_line if is_whole(positions) else self.show_columns
        show(self._start + self._step * positions, values)


class PointCurve(SampledCurve):
    """A curve of points that are decimated already (least and greatest value of each bin)."""

    def __init__(self, name: str, unit: str, pen: QPen) -> None:
        super().__init__(name, unit, pen)
        self._x: NDArray[np.float64] = np.empty(0)
        self._y: NDArray[np.float64] = np.empty(0)

    @property
    def samples(self) -> Array:
        """Get the values, shape (n,)."""
        return self._y

    @property
    def grid(self) -> tuple[float, float]:
        """Get the first and the last x, which identify the set of points."""
        return (float(self._x[0]), float(self._x[-1])) if len(self._x) else (0.0, 0.0)

    def show_points(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Show points with rising x (n,)."""
        self._x, self._y = x, y
        self.setData(x, y)

    def index_range(self, left: float, right: float) -> tuple[int, int]:
        """Return the points (start, stop) that lie between two x."""
        first, last = np.searchsorted(self._x, (left, right), side="left")
        return int(first), int(last)

    def between(self, left: float, right: float) -> tuple[NDArray[np.float64], Array]:
        """Return x and values between two x."""
        first, last = self.index_range(left, right)
        return self._x[first:last], self._y[first:last]

    def extremes(self, left: float, right: float) -> tuple[float, float]:
        """Return the smallest and the largest value between two x; NaN where there are none."""
        seen = self.between(left, right)[1]
        seen = seen[np.isfinite(seen)]
        return (float(seen.min()), float(seen.max())) if len(seen) else (float("nan"), float("nan"))

    def value_at(self, x: float) -> float:
        """Return the value of the point nearest to x; NaN outside."""
        if len(self._x) == 0 or not self._x[0] <= x <= self._x[-1]:
            return float("nan")
        return float(self._y[int(np.argmin(np.abs(self._x - x)))])

    def redraw(self) -> None:
        """Do nothing: all points are drawn."""


class Band(pg.FillBetweenItem):
    """An opaque noise band about zero of at most 600 points; its edges are above the curves."""

    def __init__(self, colour: str, edge: str) -> None:
        self._upper = CrispCurve()
        self._lower = CrispCurve()
        super().__init__(self._upper, self._lower, brush=pg.mkBrush(colour), pen=pg.mkPen(None))
        self.setZValue(-10)
        self.edges = (self._upper, self._lower)
        self._typical = float("nan")
        self.dress(colour, edge)

    def dress(self, colour: str, edge: str) -> None:
        self.setBrush(pg.mkBrush(colour))
        for line in self.edges:
            line.setPen(pg.mkPen(edge, width=1, style=Qt.PenStyle.DashLine))
            line.setZValue(10)

    def show_band(self, start: float, step: float, half: NDArray[np.float64]) -> None:
        """Show ±half (n,) at x = start + i*step; a value that is not finite has no width."""
        finite = half[np.isfinite(half)]
        self._typical = float(np.median(finite)) if len(finite) else float("nan")
        stride = max(1, len(half) // 300)
        index = np.arange(0, len(half), stride)
        width = np.nan_to_num(half[index], nan=0.0, posinf=0.0)
        x = start + step * index
        self._upper.setData(x, width)
        self._lower.setData(x, -width)

    @property
    def typical(self) -> float:
        """Get the median half width; NaN without one."""
        return self._typical

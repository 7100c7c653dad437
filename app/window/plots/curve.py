"""Curves of uniform samples, drawn with at most two points per pixel and all peaks; of any points; noise bands."""

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt

from analysis.shot import Floats
from app.window.controls.theme import Colours
from app.window.plots.lines import BAND, ColumnCurve, CrispCurve, LineStyle

Array = NDArray[np.floating] | NDArray[np.integer]
BASE = 16  # number of values in one level per value in the next


class Pyramid:
    """Minima and maxima of uniform samples over blocks of 16, 256, 4096, ... samples.

    ``values`` are the samples, shape (n,).  A level contains only whole blocks; remaining samples are read from the
    level below.  NaN is ignored unless a block contains nothing else.
    """

    def __init__(self, values: Array) -> None:
        self.values = low = high = values
        self._lows, self._highs = [low], [high]
        while (whole := len(low) // BASE * BASE) > 0:
            low = np.fmin.reduce(low[:whole].reshape(-1, BASE), axis=1)
            high = np.fmax.reduce(high[:whole].reshape(-1, BASE), axis=1)
            self._lows.append(low)
            self._highs.append(high)

    def __len__(self) -> int:
        return len(self.values)

    def extremes(self, start: int, stop: int) -> tuple[float, float]:
        """Return the least and the greatest of samples ``start`` to ``stop`` (exclusive); NaN if there are none."""
        start, stop = max(0, start), min(len(self.values), stop)
        if stop <= start:
            return float("nan"), float("nan")
        low, high = np.inf, -np.inf
        for lows, highs in zip(self._lows, self._highs, strict=True):
            stop = min(stop, len(lows))
            last = lows is self._lows[-1]
            head = stop if last else min(stop, -(-start // BASE) * BASE)
            tail = stop if last else max(head, stop // BASE * BASE)
            for part in (slice(start, head), slice(tail, stop)):
                if part.stop > part.start:
                    low = np.fmin(low, float(np.fmin.reduce(lows[part])))
                    high = np.fmax(high, float(np.fmax.reduce(highs[part])))
            if tail <= head:
                break
            start, stop = head // BASE, tail // BASE
        return (float(low), float(high)) if low <= high else (float("nan"), float("nan"))

    def view(self, start: int, stop: int, pixels: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (sample positions, values) of samples ``start`` to ``stop`` with at most two points per pixel.

        With at most two samples per pixel these are the samples themselves, else the minimum and the maximum of each
        pixel's samples, both at the same position.
        """
        start, stop = max(0, start), min(len(self.values), stop)
        pixels = max(2, pixels)
        count = stop - start
        if count <= 0:
            return np.empty(0), np.empty(0)
        if count <= 2 * pixels:
            return np.arange(start, stop, dtype=np.float64), self.values[start:stop].astype(np.float64)
        level = 0
        while level + 1 < len(self._lows) and BASE ** (level + 1) * 2 * pixels <= count:
            level += 1
        unit = BASE**level
        lows, highs = self._lows[level], self._highs[level]
        first, end = start // unit, min(len(lows), -(-stop // unit))
        edges = first + (np.arange(pixels) * (end - first)) // pixels
        low = np.fmin.reduceat(lows[:end], edges).astype(np.float64)
        high = np.fmax.reduceat(highs[:end], edges).astype(np.float64)
        if end * unit < stop:  # the last samples do not fill a block of this level
            rest_low, rest_high = self.extremes(end * unit, stop)
            low[-1], high[-1] = np.fmin(low[-1], rest_low), np.fmax(high[-1], rest_high)
        middle = start + (np.arange(pixels) + 0.5) * (count / pixels)
        y = np.empty(2 * pixels)
        y[0::2], y[1::2] = low, high
        return np.repeat(middle, 2), y


class SampledCurve(ColumnCurve):
    """A curve of uniform samples.

    The samples are stored unchanged; at each change of the view their pyramid supplies the points to draw.
    """

    def __init__(self, label: str, look: LineStyle) -> None:
        super().__init__(look=look, connect="finite", antialias=False, skipFiniteCheck=False)
        self.label = label
        self._pyramid = Pyramid(np.empty(0))
        self._start = 0.0
        self._step = 1.0

    @property
    def samples(self) -> Array:
        """Get the values, shape (n,)."""
        return self._pyramid.values

    @property
    def grid(self) -> tuple[float, float]:
        """Get the x of the first sample and the step, in the plot's x unit."""
        return self._start, self._step

    def show_samples(self, start: float, step: float, values: Array | Pyramid) -> None:
        """Show ``values`` (n,) at x = start + i*step; a finished Pyramid is used directly."""
        self._pyramid = values if isinstance(values, Pyramid) else Pyramid(values)
        self._start, self._step = start, step
        self.redraw()

    def clear_samples(self) -> None:
        self.show_samples(0.0, 1.0, np.empty(0))

    def index_range(self, left: float, right: float) -> tuple[int, int]:
        """Return the index range (start, stop) of the samples between two x."""
        count = len(self._pyramid)
        if count == 0 or not (np.isfinite(left) and np.isfinite(right)):
            return 0, 0
        first = int(np.clip(np.ceil((left - self._start) / self._step - 1e-9), 0, count))
        last = int(np.clip(np.floor((right - self._start) / self._step + 1e-9) + 1, first, count))
        return first, last

    def between(self, left: float, right: float) -> tuple[NDArray[np.floating], Array]:
        """Return x and values of all samples between two x, without decimation."""
        first, last = self.index_range(left, right)
        return self._start + self._step * np.arange(first, last), self._pyramid.values[first:last]

    def extremes(self, left: float, right: float) -> tuple[float, float]:
        """Return the smallest and the largest value between two x; NaN where there are none."""
        first, last = self.index_range(left, right)
        return self._pyramid.extremes(first, last)

    def value_at(self, x: float) -> float:
        """Return the value of the sample nearest to x; NaN outside the record."""
        count = len(self._pyramid)
        index = round((x - self._start) / self._step) if np.isfinite(x) else -1
        return float(self._pyramid.values[index]) if 0 <= index < count else float("nan")

    def viewRangeChanged(self, *_: object) -> None:
        self.redraw()

    def redraw(self) -> None:
        """Draw the samples in view, decimated to the view's pixels."""
        view = self.getViewBox()
        if view is None or len(self._pyramid) == 0:
            self.show_line(np.empty(0), np.empty(0))
            return
        (left, right), _ = view.viewRange()
        pixels = max(64, int(view.width()))
        first, last = self.index_range(left, right)
        positions, values = self._pyramid.view(first - 1, last + 1, pixels)
        extremes = len(positions) > 1 and positions[0] == positions[1]
        show = self.show_columns if extremes else self.show_line
        show(self._start + self._step * positions, values)


class PointCurve(CrispCurve):
    """Points in any order of x; a curve without a look is not drawn, but the cursors read it."""

    def __init__(self, label: str, look: LineStyle | None = None) -> None:
        super().__init__(look=look, connect="finite")
        self.label = label
        self._x: Floats = np.empty(0)
        self._y: Floats = np.empty(0)

    def show_points(self, x: Floats, y: Floats) -> None:
        """Show points with x (n,) and y (n,)."""
        self._x, self._y = x, y
        self.setData(x, y)

    def clear_samples(self) -> None:
        self.show_points(np.empty(0), np.empty(0))

    @property
    def samples(self) -> Floats:
        """Get the values, shape (n,)."""
        return self._y

    def between(self, left: float, right: float) -> tuple[Floats, Floats]:
        """Return the points between two x, in their stored order."""
        inside = (self._x >= left) & (self._x <= right)
        return self._x[inside], self._y[inside]

    def extremes(self, left: float, right: float) -> tuple[float, float]:
        """Return the smallest and the largest value between two x; NaN where there are none."""
        seen = self.between(left, right)[1]
        seen = seen[np.isfinite(seen)]
        return (float(seen.min()), float(seen.max())) if len(seen) else (float("nan"), float("nan"))

    def value_at(self, x: float) -> float:
        """Return the value of the point nearest in x; NaN outside the points' range."""
        placed = np.isfinite(self._x)
        if not placed.any() or not self._x[placed].min() <= x <= self._x[placed].max():
            return float("nan")
        return float(self._y[placed][int(np.argmin(np.abs(self._x[placed] - x)))])

    def redraw(self) -> None:
        """Do nothing: all points are drawn."""


class Band(pg.FillBetweenItem):
    """An opaque noise band about zero, of at most 600 points; its edges are drawn above the curves."""

    def __init__(self) -> None:
        self.edges = tuple(CrispCurve(look=LineStyle(BAND.edges, Qt.PenStyle.DashLine)) for _ in ("upper", "lower"))
        super().__init__(*self.edges, pen=pg.mkPen(None))
        self.setZValue(-10)
        self.typical = float("nan")  # median half width
        for line in self.edges:
            line.setZValue(10)

    def apply_colours(self, colours: Colours) -> None:
        self.setBrush(pg.mkBrush(BAND.of(colours)))

    def show_band(self, start: float, step: float, half: NDArray[np.float64]) -> None:
        """Show the band ±half (n,) at x = start + i*step; non-finite values get zero width."""
        finite = half[np.isfinite(half)]
        self.typical = float(np.median(finite)) if len(finite) else float("nan")
        stride = max(1, len(half) // 300)
        index = np.arange(0, len(half), stride)
        width = np.nan_to_num(half[index], nan=0.0, posinf=0.0)
        x = start + step * index
        for line, sign in zip(self.edges, (1.0, -1.0), strict=True):
            line.setData(x, sign * width)

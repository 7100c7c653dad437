"""Min/max pyramid of a long record: fast decimation at every zoom without losing a peak."""

import numpy as np
from numpy.typing import NDArray

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


def is_whole(positions: NDArray[np.float64]) -> bool:
    """Return whether these positions from ``Pyramid.view`` are of samples, not of pairs of extremes."""
    return len(positions) < 2 or positions[0] != positions[1]

"""Cubic Hermite interpolation between nodes that know their slopes."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def with_slope(node_s: Floats, value: Floats, slope: Floats, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the cubic Hermite interpolant of nodes at ascending times, and its slope.  Cost: about 10 ns a time."""
    result, rate = np.empty(time_s.shape[0]), np.empty(time_s.shape[0])
    j = 0
    last = node_s.shape[0] - 2
    for i in range(time_s.shape[0]):
        t = time_s[i]
        while j < last and node_s[j + 1] <= t:
            j += 1
        h = node_s[j + 1] - node_s[j]
        u = (t - node_s[j]) / h if h > 0.0 else 0.0
        d = value[j + 1] - value[j]
        a = h * slope[j] - d
        b = d - h * slope[j + 1]
        w = 1.0 - u
        result[i] = value[j] + u * (d + w * (a * w + b * u))
        rate[i] = (d + (w - u) * (a * w + b * u) + u * w * (b - a)) / h if h > 0.0 else slope[j]
    return result, rate


def at_times(node_s: Floats, value: Floats, slope: Floats, time_s: Floats) -> Floats:
    """Return the cubic Hermite interpolant of nodes at ascending times."""
    result: Floats = with_slope(node_s, value, slope, time_s)[0]
    return result

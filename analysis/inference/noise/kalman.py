"""Kalman filter of white noise plus two wandering (Ornstein-Uhlenbeck) parts (njit).

Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter", ch. 3.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.shot import Floats

Mask = NDArray[np.bool_]


class Series(NamedTuple):
    """The residuals on which noise models are compared: all shots concatenated, shot j starting at ``first[j]``.

    ``white`` are the shots' relative white variances; ``samples`` is the number of valid values.
    """

    values: Floats
    valid: Mask
    first: NDArray[np.int64]
    white: Floats
    spacing_s: float
    samples: int


@njit(cache=True, nogil=True, error_model="numpy")
def steps_of(one, memory_s, two, other_s, spacing_s):  # type: ignore[no-untyped-def]
    """Return (step variance, memory of a step, variance) of each of two parts of rms ``one`` and ``two``."""
    return (
        one * one * -math.expm1(-2 * spacing_s / memory_s), math.exp(-spacing_s / memory_s), one * one,
        two * two * -math.expm1(-2 * spacing_s / other_s), math.exp(-spacing_s / other_s), two * two,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _predicted(a, b, c, parts):  # type: ignore[no-untyped-def]
    """Return the variances a, c and the covariance b of the two parts one sample later; ``parts`` as for ``gains``."""
    q0, phi0, _, q1, phi1, _ = parts
    return phi0 * phi0 * a + q0, phi0 * phi1 * b, phi1 * phi1 * c + q1


@njit(cache=True, nogil=True, error_model="numpy")
def _updated(a, b, c, white):  # type: ignore[no-untyped-def]
    """Return both Kalman gains, the innovation's variance, and (a, b, c) given a sample of ``white`` variance."""
    variance = a + 2 * b + c + white
    k0, k1 = (a + b) / variance, (b + c) / variance
    return k0, k1, variance, a - k0 * (a + b), b - k0 * (b + c), c - k1 * (b + c)


@njit(cache=True, nogil=True, error_model="numpy")
def gains(valid, white, parts, gain, scale):  # type: ignore[no-untyped-def]
    """Write the Kalman gains, shape (n, 2), and 1/std of the innovations, shape (n,); about 15 ns per sample.

    ``parts`` are (step variance, memory of a step, variance) of the first wandering part, then of the second.
    """
    a, b, c = parts[2], 0.0, parts[5]
    for i in range(valid.size):
        if i > 0:
            a, b, c = _predicted(a, b, c, parts)
        if not valid[i]:
            gain[i, 0], gain[i, 1], scale[i] = 0.0, 0.0, 0.0
            continue
        gain[i, 0], gain[i, 1], variance, a, b, c = _updated(a, b, c, white)
        scale[i] = 1.0 / math.sqrt(variance)


@njit(cache=True, nogil=True, error_model="numpy")
def innovations(columns, gain, scale, phi0, phi1, out):  # type: ignore[no-untyped-def]
    """Write the innovations of every column, divided by their std; about 5 ns per value."""
    n, width = columns.shape
    state = np.zeros((2, width))
    row = 0
    for i in range(n):
        if scale[i] == 0.0:
            for k in range(width):
                state[0, k] *= phi0
                state[1, k] *= phi1
            continue
        k0, k1, s = gain[i, 0], gain[i, 1], scale[i]
        for k in range(width):
            error = columns[i, k] - state[0, k] - state[1, k]
            out[row, k] = error * s
            state[0, k] = phi0 * (state[0, k] + k0 * error)
            state[1, k] = phi1 * (state[1, k] + k1 * error)
        row += 1


@njit(cache=True, nogil=True, error_model="numpy")
def normalised(series, parts):  # type: ignore[no-untyped-def]
    """Return (sum of squared innovations over their variances, sum of log variances) of all shots.

    ``parts`` is the result of ``steps_of`` for rms in units of the white noise.  Variances are no longer updated once
    they are stationary.  About 10 ns per sample.
    """
    _, phi0, p0, _, phi1, p1 = parts
    values, valid, first, white = series.values, series.valid, series.first, series.white
    square, logs = 0.0, 0.0
    for shot in range(white.size):
        a, b, c = p0, 0.0, p1
        s0, s1 = 0.0, 0.0
        k0, k1, variance, log_variance = 0.0, 0.0, 1.0, 0.0
        steady = False
        for i in range(first[shot], first[shot + 1]):
            if i > first[shot]:
                s0, s1 = phi0 * s0, phi1 * s1
                if not steady:
                    a, b, c = _predicted(a, b, c, parts)
            if not valid[i]:
                if steady:  # the state's variance grows across a gap
                    a, b, c = _predicted(a, b, c, parts)
                steady = False
                continue
            if not steady:
                before = variance
                k0, k1, variance, a, b, c = _updated(a, b, c, white[shot])
                log_variance = math.log(variance)
                steady = abs(variance - before) < 1e-9 * variance
            error = values[i] - s0 - s1
            square += error * error / variance
            logs += log_variance
            s0, s1 = s0 + k0 * error, s1 + k1 * error
    return square, logs

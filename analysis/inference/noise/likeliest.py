"""Maximise the likelihood of white noise plus wandering (Ornstein-Uhlenbeck) parts (njit)."""

import math

import numpy as np
from numba import njit

from analysis.inference.noise.kalman import normalised, steps_of

SHORTEST_TAU_S, LONGEST_TAU_S = 3e-4, 1.0
_MIN_RATIO, _MAX_RATIO, _MAX_SHARE = -12.0, 14.0, 40.0  # limits of the search coordinates


@njit(cache=True, nogil=True, error_model="numpy")
def likelihood(series, shape):  # type: ignore[no-untyped-def]
    """Return the log-likelihood of parts of ``shape``, (rms over white, tau in s) of both, and the likeliest white rms.

    The white rms follows in closed form from the normalised innovations.
    """
    square, logs = normalised(series, steps_of(shape[0], shape[1], shape[2], shape[3], series.spacing_s))
    variance = max(square / series.samples, 1e-40)
    value = -0.5 * (series.samples * math.log(2 * math.pi * variance) + logs + series.samples)
    return value, math.sqrt(variance)


@njit(cache=True, nogil=True, error_model="numpy")
def shape_at(z):  # type: ignore[no-untyped-def]
    """Return the shape (rms over white, tau in s of two parts) at search coordinates ``z``, shape (2,) or (4,)."""
    span = math.log(LONGEST_TAU_S / SHORTEST_TAU_S)
    shape = np.array([0.0, 1e-2, 0.0, 1e-2])
    for j in range(z.size // 2):
        shape[2 * j] = math.exp(min(max(z[2 * j], _MIN_RATIO), _MAX_RATIO))
        share = 1 / (1 + math.exp(-min(max(z[2 * j + 1], -_MAX_SHARE), _MAX_SHARE)))
        shape[2 * j + 1] = SHORTEST_TAU_S * math.exp(span * share)
    return shape


@njit(cache=True, nogil=True, error_model="numpy")
def likeliest(series, start, side, most, near, alike):  # type: ignore[no-untyped-def]
    """Return the search coordinates (``shape_at``) of the likeliest parts near ``start``, shape (2,) or (4,).

    Searched by a simplex (Nelder and Mead, Computer J. 7 (1965) 308) of ``side``, in at most ``most`` evaluations,
    until its corners lie within ``near`` of the best and their log-likelihoods within ``alike``.
    """
    n = start.size
    corners, values = np.empty((n + 1, n)), np.empty(n + 1)
    for k in range(n + 1):
        corners[k] = start
        if k > 0:
            corners[k, k - 1] += side
        values[k] = -likelihood(series, shape_at(corners[k]))[0]
    used = n + 1
    while used < most:
        order = np.argsort(values)
        corners, values = corners[order], values[order]
        if np.max(np.abs(corners[1:] - corners[0])) <= near and values[n] - values[0] <= alike:
            break
        middle = np.sum(corners[:n], axis=0) / n
        away = middle - corners[n]
        there = middle + away
        value = -likelihood(series, shape_at(there))[0]
        used += 1
        if values[0] <= value < values[n - 1]:
            corners[n], values[n] = there, value
            continue
        if used >= most:
            if value < values[n]:
                corners[n], values[n] = there, value
            break
        further = middle + 2.0 * away if value < values[0] else middle + (0.5 if value < values[n] else -0.5) * away
        other = -likelihood(series, shape_at(further))[0]
        used += 1
        if value < values[0]:
            if other < value:
                there, value = further, other
            corners[n], values[n] = there, value
        elif other <= min(value, values[n]):
            corners[n], values[n] = further, other
        else:
            for k in range(1, n + 1):
                corners[k] = corners[0] + 0.5 * (corners[k] - corners[0])
                values[k] = -likelihood(series, shape_at(corners[k]))[0]
            used += n
    return corners[np.argmin(values)]

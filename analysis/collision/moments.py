"""Moments in which a shot moves as neither its model nor the noise it is weighed by would have it."""

import math

import numpy as np

from analysis.collision.parameters import Floats

WINDOW = 150  # samples
LOUD_SIGMAS = 8.0  # of what noise alone makes of a window's chi^2
MOST_LOUD = 0.4  # of all windows: more is a model that lacks something, no moment


def rings(whitened: Floats) -> bool:
    """Return whether a remainder of unit white noise, shape (n,), is loud for a moment and quiet else."""
    count = whitened.size // WINDOW
    if count < 2:
        return False
    chi2 = (whitened[: count * WINDOW] ** 2).reshape(count, WINDOW).sum(axis=1)
    quiet = float(np.median(chi2)) / WINDOW
    loud = chi2 / max(quiet, 1e-300) - WINDOW > LOUD_SIGMAS * math.sqrt(2.0 * WINDOW)
    return bool(loud.any() and loud.mean() <= MOST_LOUD)

"""Find knocks: moments in which a flight vibrates far more than at other times."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LOUD = 25.0  # times the power of the quiet part: five times its amplitude
FADED = 4.0
WINDOW = 4  # bins
FEWEST_LEFT = 10  # bins of a flight that must remain


def find_knocks(rest_m: Floats, into: Mask, white_m: float) -> tuple[list[tuple[int, int]], bool]:
    """Return (start, stop) of the bins of every knock, and whether one fills a flight and could not be left out.

    ``rest_m`` (n,) is the residual of the flights' parabolas, in bins.  A knock is where the power of its
    second differences, which suppress slow motion, is far above that of the quiet half of both flights.
    """
    power = np.zeros(rest_m.size)
    for side in (into, ~into):
        index = np.flatnonzero(side)
        if index.size >= 3:
            second = np.zeros(index.size)
            second[1:-1] = np.diff(rest_m[index], 2) ** 2
            second[0], second[-1] = second[1], second[-2]
            power[index] = np.convolve(second, np.ones(WINDOW) / WINDOW, mode="same")
    quiet = max(float(np.quantile(power, 0.35)), 6.0 * white_m**2)
    loud = power > LOUD * quiet
    if not loud.any() or loud.mean() > 0.5:
        return [], bool(loud.any())
    found: list[tuple[int, int]] = []
    kept = False
    for side in (into, ~into):
        index = np.flatnonzero(side)
        hot = np.flatnonzero(loud[index])
        if hot.size == 0:
            continue
        start, stop = int(hot[0]), int(hot[-1]) + 1
        ringing = power[index] > FADED * quiet
        while stop < index.size and ringing[stop]:
            stop += 1
        start, stop = max(0, start - WINDOW), min(index.size, stop + WINDOW)
        if start < FEWEST_LEFT and index.size - stop >= FEWEST_LEFT:
            start = 0  # the part before it is too short for a line
        if index.size - (stop - start) < FEWEST_LEFT:
            kept = True
            continue
        found.append((int(index[start]), int(index[stop - 1]) + 1))
    return found, kept

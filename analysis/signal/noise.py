"""Estimate the noise of a phase, a displacement or a column of a record from its own samples."""

import numpy as np

from analysis.shot import AnalysisError, Floats
from analysis.signal.filters import stretches

CHI2_MEDIAN = 0.45494  # median of a squared standard normal
_NOISE_BLOCK = 512  # samples per local variance
BLOCK = 32  # samples per mean
_FORCE_SIGMAS = 8.0  # standard deviations of acceleration above which a force acts
_FORCE_MARGIN = 100  # samples on each side of a force that are excluded
_MIN_DIFFERENCES = 40  # second differences needed
_SIGMA = 4.0
MIN_NOISE_M = 1e-15  # rounding noise of a constant displacement


def white_noise(third: Floats) -> float:
    """Return the standard deviation of white noise from its third differences, shape (n,); 0 if there are none.

    Third differences contain little of a smooth motion and 20 times the variance of white noise.  Their median is used,
    which a few outliers do not affect.
    """
    return 1.4826 * float(np.median(np.abs(third))) / float(np.sqrt(20.0)) if third.size else 0.0


def random_walk_growth(
    displacement_m: Floats, std_m: Floats, acceleration: Floats, acceleration_std: Floats, rate: float
) -> float:
    """Return the growth w of a random walk in the displacement, in m/s^0.5; 0.0 if white noise accounts for all.

    Arrays have shape (n,).  In flight, second differences of neighbouring means over a time tau have the variance
    6 sigma^2 / BLOCK from white noise plus w^2 tau from a random walk; their median over the flight yields w.
    """
    with np.errstate(invalid="ignore"):
        forced = ~(np.abs(acceleration) < _FORCE_SIGMAS * acceleration_std)
    # not mode "same", which would return the shield's length for a record shorter than the shield
    near = np.convolve(forced, np.ones(2 * _FORCE_MARGIN + 1))[_FORCE_MARGIN:-_FORCE_MARGIN] > 0.5
    squares = []
    for start, stop in stretches(~near & np.isfinite(displacement_m)):
        count = (stop - start) // BLOCK
        if count >= 3:
            means = displacement_m[start : start + count * BLOCK].reshape(count, BLOCK).mean(axis=1)
            squares.append(np.diff(means, 2) ** 2)
    if not squares:
        return 0.0
    joined = np.concatenate(squares)
    if joined.size < _MIN_DIFFERENCES:
        return 0.0
    total = float(np.median(joined)) / CHI2_MEDIAN
    white = 6.0 * float(np.nanmedian(std_m)) ** 2 / BLOCK
    unsure = 2.0 / np.sqrt(joined.size)  # relative uncertainty of a variance from a median
    if total < white * (1 + _SIGMA * unsure):
        return 0.0
    return float(np.sqrt((total - white) * rate / BLOCK))


def noise_of_column(column: Floats, name: str) -> float:
    """Return a column's white noise, at least its rounding, by its median squared 4th difference (70 sigma^2)."""
    fourth = np.diff(column, 4)
    fourth = fourth[np.isfinite(fourth)]
    known = column[np.isfinite(column)]
    if fourth.size < 8:
        raise AnalysisError(f"{name}: too few rows without a gap")
    if known.max() == known.min():
        raise AnalysisError(f"{name}: constant at {known[0]:g}")
    noise = float(np.sqrt(np.median(fourth**2) / CHI2_MEDIAN / 70.0))
    levels = np.diff(np.unique(known))
    return max(noise, float(levels.min()) / np.sqrt(12.0) if levels.size < known.size / 2 else 0.0, 1e-30)


def local_variance(rough: Floats) -> Floats:
    """Return the local variance from squared normal deviates, shape (n,): medians of 512, linearly interpolated."""
    each = min(_NOISE_BLOCK, rough.size)
    count = rough.size // each
    blocks = rough[: count * each].reshape(count, each)
    enough = np.count_nonzero(np.isfinite(blocks), axis=1) > 8
    if not enough.any():
        return np.full(rough.shape, np.nan)
    blocks = blocks[enough]
    levels = np.median(blocks, axis=1)
    for holed in np.flatnonzero(np.isnan(levels)):
        levels[holed] = np.median(blocks[holed][np.isfinite(blocks[holed])])
    centres = (np.flatnonzero(enough) + 0.5) * each
    return np.asarray(np.interp(np.arange(rough.size), centres, levels / CHI2_MEDIAN))

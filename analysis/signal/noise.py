"""The noise of a phase, a displacement or a column of a record, estimated from its own samples."""

import numpy as np

from analysis.shot import AnalysisError, Floats
from analysis.signal.filters import stretches

CHI2_MEDIAN = 0.45494  # of one squared standard normal
_NOISE_BLOCK = 512  # samples per local variance
BLOCK = 32  # samples per mean
_FORCED = 8.0  # standard deviations of acceleration: above it a force acts
_SHIELD = 100  # samples about such a force that are left out
_LEAST = 40  # second differences
_SIGMA = 4.0
LEAST_NOISE_M = 1e-15  # a place that is never another one has it from rounding alone


def white_noise(third: Floats) -> float:
    """Return the standard deviation of white noise with these third differences, shape (n,); 0 where there are none.

    Third differences hold little of a smooth motion, and 20 times the variance of white noise; from their median, which
    a few loud samples do not move.
    """
    return 1.4826 * float(np.median(np.abs(third))) / float(np.sqrt(20.0)) if third.size else 0.0


def wander(displacement_m: Floats, std_m: Floats, acceleration: Floats, acceleration_std: Floats, rate: float) -> float:
    """Return the growth w of a random walk in the displacement, in m/s^0.5; 0.0 where white noise accounts for all.

    Arrays of shape (n,).  In flight the second difference of neighbouring means over tau has the variance
    6 sigma^2 / BLOCK from white noise and w^2 tau from a walk; the median over the flight tells them apart.
    """
    with np.errstate(invalid="ignore"):
        forced = ~(np.abs(acceleration) < _FORCED * acceleration_std)
    # mode "same" would return the shield's length where the record is shorter
    near = np.convolve(forced, np.ones(2 * _SHIELD + 1))[_SHIELD:-_SHIELD] > 0.5
    squares = []
    for start, stop in stretches(~near & np.isfinite(displacement_m)):
        count = (stop - start) // BLOCK
        if count >= 3:
            means = displacement_m[start : start + count * BLOCK].reshape(count, BLOCK).mean(axis=1)
            squares.append(np.diff(means, 2) ** 2)
    if not squares:
        return 0.0
    joined = np.concatenate(squares)
    if joined.size < _LEAST:
        return 0.0
    total = float(np.median(joined)) / CHI2_MEDIAN
    white = 6.0 * float(np.nanmedian(std_m)) ** 2 / BLOCK
    unsure = 2.0 / np.sqrt(joined.size)  # relative, of a variance from a median
    if total < white * (1 + _SIGMA * unsure):
        return 0.0
    return float(np.sqrt((total - white) * rate / BLOCK))


def noise_of_column(column: Floats, name: str) -> float:
    """Return the white noise of a smooth column: median square of its fourth differences (variance 70 sigma^2)."""
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
    """Return the local variance of squared normal deviates, shape (n,): medians of 512, linearly interpolated."""
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

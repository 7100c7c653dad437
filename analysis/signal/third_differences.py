"""White noise of a smooth record from its third differences: they hold little motion, and 20 times its variance."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LEAST_NOISE_M = 1e-15  # a place that is never another one has it from rounding alone


def white_noise(third: Floats) -> float:
    """Return the standard deviation of white noise with these third differences, shape (n,); 0 where there are none.

    From their median, which a few loud samples do not move.
    """
    return 1.4826 * float(np.median(np.abs(third))) / float(np.sqrt(20.0)) if third.size else 0.0

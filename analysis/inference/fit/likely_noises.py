"""How well parameters are known where nobody knows how strongly the frame moved: over all likely noises."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.noise.site_strengths import Likely, over_likely


def under_likely_noises(fitted: Fitted) -> Fitted:
    """Return a fit in a building with the covariance of its parameters under all likely strengths of the frame's bands.

    That under the likeliest ones alone is too small by a third: slow bands turn a few times in a shot.  A fit where no
    frame moves comes back as it is.
    """
    if fitted.hypothesis.data.site is None or not fitted.floor.site:
        return fitted
    free = np.ones(fitted.hypothesis.size, dtype=np.bool_)
    free[fitted.hypothesis.unseen] = False
    likely = likely_beside(fitted, free)
    return fitted if likely is None else replace(fitted, inverse=likely.covariance)


def likely_beside(fitted: Fitted, free: NDArray[np.bool_]) -> Likely | None:
    """Return what all likely strengths make of the ``free`` parameters, shape (p,); None where they are not determined.

    What is not free has no variance.
    """
    data = fitted.hypothesis.data
    assert data.site is not None
    tangents = fitted.hypothesis.arrow([line for _, line in fitted.hypothesis.linearised(fitted.z)])
    tangents = tangents.without(np.flatnonzero(~free))
    try:
        likely = over_likely(fitted.residual_m, tangents, data.shots, data.site, fitted.floor)
    except np.linalg.LinAlgError:  # two parameters that do the same
        return None
    return replace(likely, covariance=np.where(np.outer(free, free), likely.covariance, 0.0))

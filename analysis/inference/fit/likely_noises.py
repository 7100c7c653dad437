"""Covariance of parameters where the strength of the frame's motion is unknown: over all likely strengths."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.noise.site_strengths import Likely, over_likely


def under_likely_noises(fitted: Fitted) -> Fitted:
    """Return a fit on a moving frame with its covariance under all likely strengths of the frame's bands.

    Under the likeliest strengths alone it is a third too small, since slow bands swing only a few times in a shot.  A
    fit without a moving frame is returned unchanged.
    """
    if fitted.hypothesis.data.site is None or not fitted.floor.site:
        return fitted
    free = np.ones(fitted.hypothesis.size, dtype=np.bool_)
    free[fitted.hypothesis.unseen] = False
    likely = over_likely_strengths(fitted, free)
    return fitted if likely is None else replace(fitted, inverse=likely.covariance)


def over_likely_strengths(fitted: Fitted, free: NDArray[np.bool_]) -> Likely | None:
    """Return the parameters' covariance under all likely strengths, zero where not ``free``, shape (p,).

    None where the free parameters are not determined.
    """
    data = fitted.hypothesis.data
    assert data.site is not None
    tangents = fitted.hypothesis.arrow([line for _, line in fitted.hypothesis.linearised(fitted.z)])
    tangents = tangents.without(np.flatnonzero(~free))
    try:
        likely = over_likely(fitted.residual_m, tangents, data.shots, data.site, fitted.floor)
    except np.linalg.LinAlgError:  # two parameters have the same effect
        return None
    return replace(likely, covariance=np.where(np.outer(free, free), likely.covariance, 0.0))

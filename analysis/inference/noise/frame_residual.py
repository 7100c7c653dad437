"""The part of a frame's motion that remains in the residual of a fit that includes that motion as noise.

Generalised least squares leaves C - J (J^T C^-1 J)^-1 J^T of the noise covariance C, with J the derivatives by the
parameters (Rao, "Linear Statistical Inference and Its Applications", section 4a).  The fit follows the samples about
the contact most closely, so the remaining part grows towards both ends of the record.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor

Floats = NDArray[np.float64]
_ROUNDING = 1e-13
_POINTS = 128  # over the fitted stretch: the frame's motion varies slowly


def sway_left_std_m(shot: Samples, noise: Floor, derivatives: Floats) -> Floats:
    """Return the std in m of the frame's motion in a fit's residual, on the motion's own grid, shape (n,).

    ``derivatives`` are those of the averaged displacement by the fit's parameters.  Cost about 5 ms.
    """
    assert shot.sway is not None
    rows = np.flatnonzero(shot.valid)
    some = np.unique(np.linspace(0, rows.size - 1, _POINTS).astype(np.intp))
    size = np.exp(0.5 * np.asarray(noise.site))[shot.sway.band]
    sines = shot.sway.basis[some] @ (shot.sway.factors * size)
    columns = derivatives[rows[some]]
    columns = columns[:, np.abs(columns).max(axis=0) > 0.0]
    every = (noise.white_m * shot.weight) ** 2 * some.size / rows.size  # a point stands for the samples around it
    covariance = sines @ sines.T
    every = max(every, _ROUNDING * float(np.trace(covariance)))
    root = np.linalg.cholesky(covariance + every * np.eye(some.size))
    whitened = np.linalg.solve(root, columns)
    taken = root @ np.linalg.qr(whitened / np.linalg.norm(whitened, axis=0))[0]
    left_m2 = np.sum(sines**2, axis=1) - np.sum(taken**2, axis=1)
    return np.asarray(np.interp(shot.time_s, shot.centre_s[rows[some]], np.sqrt(np.maximum(left_m2, 0.0))))

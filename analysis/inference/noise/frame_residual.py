"""What a frame that sways leaves of a shot's displacement once a fit that weighs the sway has taken its share.

Such a fit (generalised least squares) leaves C - J (J^T C^-1 J)^-1 J^T of its noise's covariance C, with J the
derivatives by its parameters (Rao, "Linear Statistical Inference and Its Applications", section 4a).  It holds on to
the stretch about the contact, which tells it most, so what is left grows towards both ends of the record.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.collision.parameters import Floats
from analysis.inference.noise.sway import Swayed

_POINTS = 128  # over the fitted stretch: what matters turns slowly


def sway_left_std_m(noise: Swayed, time_s: Floats, used: NDArray[np.bool_], derivatives: Floats) -> Floats:
    """Return the std of what stays of the sway in a fit's residual, at ``time_s``, shape (n,).

    ``used`` says which of those samples were fitted, ``derivatives``, shape (n, p), are by the parameters that were.
    Cost about 5 ms.
    """
    rows = np.flatnonzero(used)
    points = rows[np.unique(np.linspace(0, rows.size - 1, _POINTS).astype(np.intp))]
    sines = noise.sines_at(time_s[points])
    columns = derivatives[points]
    columns = columns[:, np.abs(columns).max(axis=0) > 0.0]
    every = noise.std_m**2 * points.size / rows.size  # what a point knows, as if it were all samples about it
    root = np.linalg.cholesky(sines @ sines.T + every * np.eye(points.size))
    whitened = np.linalg.solve(root, columns)
    taken = root @ np.linalg.qr(whitened / np.linalg.norm(whitened, axis=0))[0]
    left_m2 = np.sum(sines**2, axis=1) - np.sum(taken**2, axis=1)
    return np.asarray(np.interp(time_s, time_s[points], np.sqrt(np.maximum(left_m2, 0.0))))

"""How sure an attraction is: the likelihood itself, where its curvature at the best point says too little.

An attraction's force and reach lie in a bent valley, and samples that come within reach one by one make it rough.  The
profile likelihood (Venzon and Moolgavkar, Appl. Statist. 37 (1988) 87) follows the valley to where the fit is worse by
one standard deviation.
"""

from dataclasses import replace

import numpy as np

from analysis.collision.parameters import Infeasible
from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit.hypothesis_fit import Fitted, square_of, whitened_residual
from analysis.inference.fit.least_squares import minimise
from analysis.shot.shot import Stop

_TRIES = 3
_FLAT = 0.05  # of chi^2: not even a tenth of the way
_WIDEST = 4.0  # times, from one try to the next


def with_profile_std(fitted: Fitted, stop: Stop) -> Fitted:
    """Return the fit with uncertainties of its attraction as wide as the wider side of the profile likelihood.

    Never narrower than the curvature says.  Any other fit comes back as it is.  Cost: 0.3 s a parameter.
    """
    hypothesis = fitted.hypothesis
    places = [
        k for k, (effect, _, _) in enumerate(hypothesis.free_parameters, hypothesis.offset) if effect.range_at >= 0
    ]
    if not places or not np.all(np.isfinite(fitted.inverse)):
        return fitted
    sides = side_by_side(lambda one: _off(fitted, *one, stop), [(at, side) for at in places for side in (-1.0, 1.0)])
    inverse = fitted.inverse.copy()
    for k, at in enumerate(places):
        factor = max(1.0, *sides[2 * k : 2 * k + 2])
        inverse[at, :] *= factor
        inverse[:, at] *= factor
    return replace(fitted, inverse=inverse)


def _off(fitted: Fitted, at: int, side: float, stop: Stop) -> float:
    """Return how many of its standard deviations a parameter lies off where chi^2 has grown by one; 1 if unknown."""
    hypothesis = fitted.hypothesis
    low, high = hypothesis.bounds
    best = fitted.chi2(fitted.floor)
    std = float(np.sqrt(fitted.inverse[at, at]))
    along = fitted.inverse[:, at] / fitted.inverse[at, at]
    off = 1.0
    for _ in range(_TRIES):
        z = np.clip(fitted.z + along * side * off * std, low, high)
        least, most = low.copy(), high.copy()
        least[at] = most[at] = z[at]
        try:
            found = minimise(
                lambda q: square_of(hypothesis, fitted.floor, q),
                z,
                bounds=(least, most),
                evaluations=8,
                tolerance=1e-2,
                residual=lambda q: whitened_residual(hypothesis, fitted.floor, q),
                cancelled=stop,
            )
        except (Infeasible, np.linalg.LinAlgError):
            return 1.0
        grown = float(found.square.chi2) - best
        wanted = off / np.sqrt(grown) if grown > _FLAT else off * _WIDEST
        if abs(wanted / off - 1) < 0.1:
            return float(wanted)
        off = min(float(wanted), _WIDEST * off)
    return off

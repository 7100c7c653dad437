"""The rest beat's phase as a smooth curve: its frequency and drift, to be subtracted from the moving beat's phase."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot import AnalysisError, Quantity

Floats = NDArray[np.float64]
_HIGHEST_DEGREE = 4
_MEANS = 1024  # to which the phases are averaged before curves are fitted
_WORTH = 25.0  # decrease of chi^2 that a further term of the polynomial must bring (5 sigma)


@dataclass(frozen=True, slots=True)
class RestPhase:
    """The rest beat's smooth phase minus the oscillator's: a polynomial over ``middle_s`` +- ``half_s``."""

    coefficients: Floats  # Legendre
    middle_s: float
    half_s: float
    frequency_hz: Quantity  # mean over the record
    unsteady_cycles: float  # rms residual of the smooth curve, beyond noise
    degree: int

    def phase_at(self, time_s: Floats) -> Floats:
        """Return the phase in cycles, minus the oscillator's, at times of shape (n,)."""
        return np.asarray(np.polynomial.Legendre(self.coefficients)((time_s - self.middle_s) / self.half_s))


def fit_rest_phase(time_s: Floats, phase_cycles: Floats, std_cycles: float, oscillator_hz: float) -> RestPhase:
    """Fit PD0's phase (NaN where not measured) with the polynomial of lowest degree that describes it.

    A straight line is a constant frequency; further terms are added only where they are worth 5 sigma.  The
    uncertainty of the frequency is that of the slope, from the actual residual.
    """
    middle = 0.5 * (time_s[0] + time_s[-1])
    half = max(0.5 * (time_s[-1] - time_s[0]), 1e-12)
    u = (time_s - middle) / half
    known = np.isfinite(phase_cycles)
    each = max(1, int(known.sum()) // _MEANS)
    count = int(known.sum()) // each
    mean_u = u[known][: count * each].reshape(count, each).mean(axis=1)
    mean_phase = phase_cycles[known][: count * each].reshape(count, each).mean(axis=1)
    best: tuple[int, Floats, float] | None = None
    for degree in range(1, _HIGHEST_DEGREE + 1):
        if count <= 4 * degree:
            break
        series = np.polynomial.Legendre.fit(mean_u, mean_phase, degree, domain=[-1, 1])
        left = float(np.sum((mean_phase - series(mean_u)) ** 2)) * each
        if best is None or best[2] - left > _WORTH * max(std_cycles, 1e-9) ** 2:
            best = (degree, np.asarray(series.coef, dtype=np.float64), left)
    if best is None:
        raise AnalysisError("reference channel: too short for a rest frequency")
    degree, coefficients, left = best
    series = np.polynomial.Legendre(coefficients)
    slow = np.sqrt(left / max(1, count - degree - 1))  # of a single phase, if the means' residual were white
    remainder = max(slow, float(np.sqrt(np.mean((phase_cycles[known] - series(u[known])) ** 2))))
    std = np.sqrt(3.0 / known.sum()) * max(slow, std_cycles) / half
    mean = oscillator_hz + float(series(1.0) - series(-1.0)) / (2 * half)
    return RestPhase(
        coefficients,
        middle,
        half,
        Quantity(mean, float(std), f"PD0's phase over the record, polynomial of degree {degree}"),
        float(np.sqrt(max(0.0, remainder**2 - std_cycles**2))),
        degree,
    )

"""The rest beat: its frequency, its drift, and what of its phase is taken off the moving beat's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError

Floats = NDArray[np.float64]
_HIGHEST_DEGREE = 4
_MEANS = 1024  # the phases are averaged down to, before curves are tried on them
_WORTH = 25.0  # drop of chi^2 that a further term of the polynomial must bring (5 sigma)


@dataclass(frozen=True, slots=True)
class Rest:
    """The rest beat's smooth phase: a polynomial over ``middle_s`` +- ``half_s``, the oscillator taken off."""

    coefficients: Floats  # Legendre
    middle_s: float
    half_s: float
    frequency_hz: Quantity  # mean over the record
    drift_hz: float  # change over the record
    unsteady_cycles: float  # rms of what a smooth curve leaves, beyond noise
    degree: int

    def phase_at(self, time_s: Floats) -> Floats:
        """Return the phase in cycles, less the oscillator's, at times of shape (n,)."""
        return np.asarray(np.polynomial.Legendre(self.coefficients)((time_s - self.middle_s) / self.half_s))


def smooth(time_s: Floats, phase_cycles: Floats, std_cycles: float, oscillator_hz: float) -> Rest:
    """Fit PD0's phase (NaN where not measured) with the lowest polynomial that accounts for it.

    A straight line is a constant frequency; further terms are taken only where they are worth 5 sigma.  The
    uncertainty of the frequency is that of the slope with the remainder that was really left.
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
    slope = series.deriv()
    slow = np.sqrt(left / max(1, count - degree - 1))  # of a single phase, if the means' remainder were white
    remainder = max(slow, float(np.sqrt(np.mean((phase_cycles[known] - series(u[known])) ** 2))))
    std = np.sqrt(3.0 / known.sum()) * max(slow, std_cycles) / half
    ends = (float(slope(-1.0)) / half, float(slope(1.0)) / half)
    mean = oscillator_hz + float(series(1.0) - series(-1.0)) / (2 * half)
    return Rest(
        coefficients,
        middle,
        half,
        Quantity(mean, float(std), f"PD0's phase over the record, polynomial of degree {degree}"),
        ends[1] - ends[0],
        float(np.sqrt(max(0.0, remainder**2 - std_cycles**2))),
        degree,
    )

"""A free flight as a polynomial: its velocity at any instant, with uncertainty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Motion

Floats = NDArray[np.float64]

LONGEST_FLIGHT_S = 0.040  # of flight used on each side: a longer one adds drift, not information
FEWEST_SAMPLES = 400  # ... but a slow record needs this many
SHORTEST_CURVED_S = 0.003  # a shorter flight carries a straight line only


@dataclass(frozen=True, slots=True)
class Flight:
    """A polynomial through the displacement of a free flight, about ``time_zero_s``.

    ``coefficients`` are position, velocity, half acceleration, ... (SI); ``covariance`` is over them.
    ``noise_std_m`` is that of one sample against its neighbours.
    """

    time_zero_s: float
    coefficients: Floats
    covariance: Floats
    noise_std_m: float
    first: int
    last: int

    @property
    def acceleration_m_per_s2(self) -> float:
        """Get the flight's own constant acceleration; 0 where it was too short to show one."""
        return 2.0 * float(self.coefficients[2]) if self.coefficients.size > 2 else 0.0

    def position_m(self, time_s: Floats) -> Floats:
        """Return the flight's displacement in m, continued to any times in s."""
        return np.asarray(np.polynomial.polynomial.polyval(time_s - self.time_zero_s, self.coefficients))

    def velocity(self, time_s: float) -> tuple[float, float]:
        """Return velocity and its standard deviation in m/s at one time in s."""
        tau = time_s - self.time_zero_s
        powers = np.arange(self.coefficients.size)
        row = np.where(powers > 0, powers * tau ** np.maximum(powers - 1, 0), 0.0)
        return float(row @ self.coefficients), float(np.sqrt(row @ self.covariance @ row))


def fit_flight(motion: Motion, first: int, last: int, *, nearest: int, curved: bool = False) -> Flight | None:
    """Fit the flight between samples ``first`` and ``last`` (inclusive), its time zero at sample ``nearest``.

    Quadratic where the flight is long enough, so that drag and tilt do not bias the velocity at its end, or where it is
    ``curved``; straight where it is short.  All noise counts as white.  None with fewer than 4 valid samples.
    """
    index = np.arange(max(first, 0), min(last, motion.time_s.size - 1) + 1)
    index = index[motion.valid[index] & np.isfinite(motion.displacement_m[index])]
    if index.size < 4:
        return None
    zero = float(motion.time_s[min(max(nearest, 0), motion.time_s.size - 1)])
    tau = motion.time_s[index] - zero
    degree = 2 if (curved or tau[-1] - tau[0] >= SHORTEST_CURVED_S) and index.size >= 12 else 1
    scale = float(np.abs(tau).max())
    design = np.vander(tau / scale, degree + 1, increasing=True)
    values = motion.displacement_m[index]
    freedom = max(index.size - degree - 1, 1)
    solution, *_ = np.linalg.lstsq(design, values, rcond=None)
    residual = values - design @ solution
    stated = float(np.nanmedian(motion.displacement_std_m[index]))
    std = float(np.sqrt(residual @ residual / freedom)) if freedom >= 8 else stated
    covariance = np.linalg.inv(design.T @ design) * max(std, 1e-30) ** 2
    unscale = scale ** -np.arange(degree + 1.0)
    return Flight(zero, solution * unscale, covariance * np.outer(unscale, unscale), std, int(index[0]), int(index[-1]))

"""A building's floor under the shots: what stands in the flights as well may be no law of the collision.

The diagnosis's floor (white noise and two wandering parts) does not know the lines and resonances of a building, and
takes them for something that the model lacks.  A remainder in contact that is no larger than what a quadratic leaves
of the flights may be the site's.  It need not be: a friction that bends the flights leaves little else, and a law may
reach far.  So this is said beside a verdict; all it decides is that a curve which explains only a part is not told.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.hypothesis_fit import Fitted

Floats = NDArray[np.float64]
_WINDOW = 0.4  # of the contact: shots begin 12 ms before a touch of 28 ms
_FEWEST = 12  # averaged samples in a window, to look at


def in_building(fitted: Fitted) -> bool:
    """Return whether the floor wanders so far above the beat's noise that it is a building's."""
    return fitted.floor.std_m > CRITERIA.building_floor * fitted.floor.white_m


def may_be_site(fitted: Fitted) -> bool:
    """Return whether what is left in contact is about as large as what a quadratic leaves of the flights.

    Looked at in windows of ``_WINDOW`` of the contact.  False where no flight is that long, or the floor is not a
    building's.
    """
    if not in_building(fitted):
        return False
    flights, contacts = [], []
    for shot, left_m in zip(fitted.hypothesis.data.shots, fitted.residual_m, strict=True):
        touch_s, contact_s = shot.course.touch_time_s, shot.course.contact_time_s
        release_s, length_s = touch_s + contact_s, _WINDOW * contact_s
        time_s = shot.centre_s
        contacts += _windows(time_s, left_m, shot.valid, touch_s, release_s, length_s)
        flights += _windows(time_s, left_m, shot.valid, time_s[0], touch_s, length_s)
        flights += _windows(time_s, left_m, shot.valid, release_s, time_s[-1], length_s)
    if not flights or not contacts:
        return False
    return float(np.mean(contacts)) < CRITERIA.above_site**2 * float(np.mean(flights))


def _windows(
    time_s: Floats, left_m: Floats, valid: NDArray[np.bool_], start_s: float, end_s: float, length_s: float
) -> list[float]:
    """Return the mean squares that a quadratic leaves in each window of ``length_s`` within the limits, in m^2."""
    out = []
    for k in range(int((end_s - start_s) / length_s + 1e-6)):
        from_s = start_s + k * length_s
        here = valid & (time_s >= from_s) & (time_s < from_s + length_s)
        if here.sum() >= _FEWEST:
            u = (time_s[here] - from_s) / length_s
            left = left_m[here] - np.polynomial.Polynomial.fit(u, left_m[here], 2)(u)
            out.append(float(np.mean(left**2)))
    return out

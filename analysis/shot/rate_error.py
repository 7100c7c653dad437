"""What a contradicted sample rate may make wrong, carried into the uncertainty of every number that it scales.

With PD0 a displacement is a number of fringes and knows no rate; a time goes with 1 / rate, so a velocity with the
rate and a force with its square.  Without PD0 the stated rest frequency does not go with the rate, and every velocity
is off by half a wavelength times what the rest beat seems to have moved.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity, Reading
from analysis.shot.units import power_of_time

_POWERS = {
    "velocity_in_m_per_s": 1,
    "velocity_out_m_per_s": 1,
    "force_peak_n": 2,
    "stiffness_slope_n_per_m": 2,
    "contact_time_s": 1,
    "force_fwhm_s": 1,
}


def with_rate_error(impact: Impact, motion: Motion) -> Impact:
    """Return the readings with what the sample rate may be wrong by in their standard uncertainties."""
    if not motion.rate_error:
        return impact
    added = {name: _carried(impact, name, power * motion.rate_error) for name, power in _POWERS.items()}
    offset = velocity_offset_m_per_s(motion)
    if offset > 0.0:
        for name in ("velocity_in_m_per_s", "velocity_out_m_per_s"):
            added[name] = math.hypot(added[name], offset)
        added |= _of_ratios(impact, offset)
    readings = {name: wider(getattr(impact, name), std) for name, std in added.items()}
    return replace(impact, **readings)  # type: ignore[arg-type]


def velocity_offset_m_per_s(motion: Motion) -> float:
    """Return what a wrong rate adds to every velocity where the rest frequency was stated and not recorded."""
    rest = motion.rest_frequency_hz
    if motion.reference is not None or motion.wavelength_m is None or not isinstance(rest, Quantity):
        return 0.0
    return 0.5 * motion.wavelength_m * rest.value * motion.rate_error


def fit_with_rate_error(fit: Fit, motion: Motion) -> Fit:
    """Return a fit with its parameters, and its covariance, as uncertain as a contradicted rate leaves them.

    A parameter's unit says how it goes with the rate; all of them go together, so what is a ratio stays as it was.
    """
    error = motion.rate_error
    if not error or not fit.parameters:
        return fit
    moved = np.array([-error * power_of_time(name) * q.value for name, q in fit.parameters.items()])
    parameters = dict(zip(fit.parameters, map(wider, fit.parameters.values(), np.abs(moved)), strict=True))
    covariance = fit.covariance
    if covariance.shape == (moved.size, moved.size):
        covariance = covariance + np.outer(moved, moved)
    offset = velocity_offset_m_per_s(motion)
    shots = tuple(
        replace(
            part,
            velocity_in_m_per_s=_velocity(part.velocity_in_m_per_s, error, offset),
            velocity_out_m_per_s=_velocity(part.velocity_out_m_per_s, error, offset),
        )
        for part in fit.shots
    )
    return replace(fit, parameters=_quantities(parameters), covariance=covariance, shots=shots)


def wider(reading: Reading, std: float) -> Reading:
    """Return a reading with a further, independent standard uncertainty."""
    return replace(reading, std=math.hypot(reading.std, float(std))) if isinstance(reading, Quantity) else reading


def _velocity(velocity: Quantity, error: float, offset: float) -> Quantity:
    return replace(velocity, std=math.hypot(velocity.std, error * velocity.value, offset))


def _quantities(readings: Mapping[str, Reading]) -> dict[str, Quantity]:
    return {name: reading for name, reading in readings.items() if isinstance(reading, Quantity)}


def _carried(impact: Impact, name: str, share: float) -> float:
    reading = getattr(impact, name)
    return share * abs(reading.value) if isinstance(reading, Quantity) else 0.0


def _of_ratios(impact: Impact, offset_m_per_s: float) -> dict[str, float]:
    """Return what one velocity added to both flights does to what is made of them, and to how deep the turn lies."""
    added = {}
    into, lasts = impact.velocity_in_m_per_s, impact.contact_time_s
    for name in ("cor_quasi_static", "cor_impulse"):
        ratio = getattr(impact, name)
        if isinstance(into, Quantity) and isinstance(ratio, Quantity) and into.value:
            added[name] = (1.0 + abs(ratio.value)) * offset_m_per_s / abs(into.value)
    if isinstance(lasts, Quantity):
        added["deflection_max_m"] = 0.5 * lasts.value * offset_m_per_s
    return added

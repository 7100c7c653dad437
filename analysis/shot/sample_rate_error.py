"""Detect a wrong sample rate, by PD0 or the computer's clock, and add its effect to the uncertainty of every number.

With PD0 a displacement is a number of fringes and independent of the rate.  A time scales with 1 / rate, a velocity
with the rate and a force with its square.  Without PD0 the stated rest frequency does not scale with the rate, and
every velocity is off by half a wavelength times the apparent shift of the rest beat.
"""

import math
from dataclasses import replace

import numpy as np

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity, power_of_time
from analysis.shot.recording import Recording

RATE_CONTRADICTED = "rate_contradicted"
DELIVERED_KEY = "lmm:delivered_rate_hz"  # global key: rate by the computer's clock, if it differs from the stated rate
REST_STATED_U = 5e-4  # relative tolerance of a rest frequency stated without uncertainty: a laser's drift over months
RATE_SIGMAS = 2.0  # standard uncertainties by which the rates must differ
_SCALED = (
    *("velocity_in_m_per_s", "velocity_out_m_per_s", "force_peak_n", "stiffness_slope_n_per_m"),
    *("contact_time_s", "force_fwhm_s"),
)


def rate_error(recording: Recording, rest_hz: Quantity | None) -> float:
    """Return the relative error of the stated sample rate, the larger by PD0 and by the clock; 0 if neither differs.

    ``rest_hz`` is the rest frequency measured with PD0, or None without PD0.
    """
    return max(_error_by_pd0(recording, rest_hz), _error_by_clock(recording))


def _error_by_pd0(recording: Recording, rest_hz: Quantity | None) -> float:
    stated = recording.setup.rest_frequency_hz
    if not stated or rest_hz is None:
        return 0.0
    std = recording.setup.rest_frequency_u_hz or 0.0
    own = RATE_SIGMAS * std if std > 0.0 else REST_STATED_U * stated
    error = abs(rest_hz.value - stated)
    # limited to 1: an error by a whole factor says only that something is wrong, not by how much
    return min(error / stated, 1.0) if error > math.hypot(own, RATE_SIGMAS * rest_hz.std) else 0.0


def _error_by_clock(recording: Recording) -> float:
    metadata = recording.extra.get("global", {})
    delivered = metadata.get(DELIVERED_KEY) if isinstance(metadata, dict) else None
    if isinstance(delivered, bool) or not isinstance(delivered, int | float):
        return 0.0
    try:
        error = abs(float(delivered) / recording.sample_rate_hz - 1.0)
    except OverflowError:
        return 1.0
    return min(error, 1.0) if math.isfinite(error) else 1.0


def with_rate_error(impact: Impact, motion: Motion) -> Impact:
    """Return the readings with the error of the sample rate added to their standard uncertainties."""
    if not motion.rate_error:
        return impact
    added = {name: _std_by_share(impact, name, abs(power_of_time(name)) * motion.rate_error) for name in _SCALED}
    offset = velocity_offset_m_per_s(motion)
    if offset > 0.0:
        for name in ("velocity_in_m_per_s", "velocity_out_m_per_s"):
            added[name] = math.hypot(added[name], offset)
        added |= _ratio_errors(impact, offset)
    read = {name: (getattr(impact, name), std) for name, std in added.items()}
    wider = {name: _wider(reading, std) for name, (reading, std) in read.items() if isinstance(reading, Quantity)}
    return replace(impact, **wider)  # type: ignore[arg-type]


def velocity_offset_m_per_s(motion: Motion) -> float:
    """Return the error of every velocity from a wrong sample rate if the rest frequency was stated; 0 with PD0."""
    rest = motion.rest_frequency_hz
    if motion.reference is not None or motion.wavelength_m is None or not isinstance(rest, Quantity):
        return 0.0
    return 0.5 * motion.wavelength_m * rest.value * motion.rate_error


def fit_with_rate_error(fit: Fit, motion: Motion) -> Fit:
    """Return a fit with the error of the sample rate added to its parameters' uncertainties and their covariance.

    A parameter scales with the power of time in its unit.  All scale together, so their ratios are unaffected.
    """
    error = motion.rate_error
    if not error:
        return fit
    moved = np.array([-error * power_of_time(name) * q.value for name, q in fit.parameters.items()])
    parameters = dict(zip(fit.parameters, map(_wider, fit.parameters.values(), moved.tolist()), strict=True))
    covariance = fit.covariance
    if covariance.shape == (moved.size, moved.size):
        covariance = covariance + np.outer(moved, moved)
    offset = velocity_offset_m_per_s(motion)
    shots = tuple(
        replace(
            part,
            velocity_in_m_per_s=_wider(part.velocity_in_m_per_s, error * part.velocity_in_m_per_s.value, offset),
            velocity_out_m_per_s=_wider(part.velocity_out_m_per_s, error * part.velocity_out_m_per_s.value, offset),
        )
        for part in fit.shots
    )
    return replace(fit, parameters=parameters, covariance=covariance, shots=shots)


def _wider(quantity: Quantity, *further: float) -> Quantity:
    """Return a quantity with ``further`` independent standard uncertainties added in quadrature."""
    return replace(quantity, std=math.hypot(quantity.std, *further))


def _std_by_share(impact: Impact, name: str, share: float) -> float:
    reading = getattr(impact, name)
    return share * abs(reading.value) if isinstance(reading, Quantity) else 0.0


def _ratio_errors(impact: Impact, offset_m_per_s: float) -> dict[str, float]:
    """Return the errors of both CORs and of the deflection from one velocity offset common to both flights."""
    added = {}
    into, lasts = impact.velocity_in_m_per_s, impact.contact_time_s
    for name in ("cor_quasi_static", "cor_impulse"):
        ratio = getattr(impact, name)
        if isinstance(into, Quantity) and isinstance(ratio, Quantity) and into.value:
            added[name] = (1.0 + abs(ratio.value)) * offset_m_per_s / abs(into.value)
    if isinstance(lasts, Quantity):
        added["deflection_max_m"] = 0.5 * lasts.value * offset_m_per_s
    return added

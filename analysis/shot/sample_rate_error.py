"""Detect a wrong sample rate, by PD0 or the computer's clock, and add its effect to the uncertainty of every number.

With PD0 a displacement is a number of fringes and independent of the rate.  A time scales with 1 / rate, a velocity
with the rate and a force with its square.  Without PD0 the stated rest frequency does not scale with the rate, and
every velocity is off by half a wavelength times the apparent shift of the rest beat.
"""

import math
from collections.abc import Mapping
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
_VELOCITIES, _RATIOS = ("velocity_in_m_per_s", "velocity_out_m_per_s"), ("cor_quasi_static", "cor_impulse")
_OTHERS = ("force_peak_n", "stiffness_slope_n_per_m", "contact_time_s", "force_fwhm_s", "deflection_max_m")


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
    names = (*_VELOCITIES, *_RATIOS, *_OTHERS)
    read = {name: reading for name in names if isinstance(reading := getattr(impact, name), Quantity)}
    of_offset = _errors_by_offset(read, velocity_offset_m_per_s(motion))
    wider = {
        name: _wider(reading, power_of_time(name) * motion.rate_error * reading.value, of_offset.get(name, 0.0))
        for name, reading in read.items()
    }
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


def _errors_by_offset(read: Mapping[str, Quantity], offset_m_per_s: float) -> dict[str, float]:
    """Return the errors of velocities, CORs and deflection from one velocity offset common to both flights."""
    errors = dict.fromkeys(_VELOCITIES, offset_m_per_s)
    into, lasts = read.get("velocity_in_m_per_s"), read.get("contact_time_s")
    if into is not None and into.value:
        ratios = {name: abs(read[name].value) for name in _RATIOS if name in read}
        errors |= {name: (1.0 + ratio) * offset_m_per_s / abs(into.value) for name, ratio in ratios.items()}
    if lasts is not None:
        errors["deflection_max_m"] = 0.5 * lasts.value * offset_m_per_s
    return errors

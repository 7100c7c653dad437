"""Consistency checks on a shot's numbers: flags for impossible values and for values that contradict one another.

``NUMBERS_AFFECTED`` maps a flag to the numbers that it affects, by their names in Impact and in the fit's parameters,
so that the flag can be shown next to the number.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from analysis.shot.fit import Fit, ShotFit
from analysis.shot.impact import Impact
from analysis.shot.quantity import NotSeen, Quantity, Reading
from analysis.shot.sample_rate_error import RATE_CONTRADICTED

RESTITUTION_SIGMAS = 2.0
AGREEMENT_SIGMAS = 3.0  # between quasi-static COR and impulse ratio
MOMENTUM_SIGMAS = 5.0
FIT_SIGMAS = 5.0
NOT_CONVERGED, FIT_DISAGREES, CHI2_FAR_FROM_ONE = "fit_not_converged", "fit_disagrees", "chi2_far_from_one"
PLATE_SHAKEN, KNOCK_SUSPECTED = "plate_shaken", "knock_suspected"
CONTACT_DISAGREES = "contact_disagrees"
FIT_FLAGS = (FIT_DISAGREES, CONTACT_DISAGREES, CHI2_FAR_FROM_ONE, PLATE_SHAKEN, KNOCK_SUSPECTED)
PLATE_RINGS = "plate_rings"  # fit flag: the residual is an oscillation of the plate before the touch
FRAME_MOVES_FAR = "frame_moves_far"  # fit flag: fit and computed frame response did not come to agree
VIBRATION = "vibration"  # reading flag: the plate moves before it is touched
CHI2_FAR = 2.0  # reduced chi^2 above this or below its inverse is flagged
_VELOCITIES = ("velocity_in_m_per_s", "velocity_out_m_per_s", "cor_quasi_static")
_OF_FORCE = ("force_peak_n", "force_fwhm_s", "cor_impulse", "stiffness_slope_n_per_m")
_BOUNCES = ("cor_kinetic.force_peaks", "cor_kinetic.onsets", "cor_kinetic.flights")
_FITTED = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
    "cor_kinetic.contact",
)

NUMBERS_AFFECTED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "restitution_above_one": ("cor_quasi_static",),
        "no_turn": ("velocity_out_m_per_s", "cor_quasi_static", "deflection_max_m", *_FITTED),
        "no_release": ("velocity_out_m_per_s", "cor_quasi_static", "contact_time_s"),
        "momentum_disagrees": ("force_peak_n", "velocity_in_m_per_s", "velocity_out_m_per_s"),
        "impulse_disagrees": ("cor_quasi_static", "cor_impulse"),
        "bounces_disturbed": _BOUNCES,
        "flight_cut": _VELOCITIES,
        VIBRATION: (*_VELOCITIES, "force_peak_n", "deflection_max_m"),
        "knock": (*_VELOCITIES, *_OF_FORCE, *_FITTED, "contact_time_s", "deflection_max_m"),
        "samples_lost": (*_OF_FORCE, *_BOUNCES, "contact_time_s", "deflection_max_m"),
        "cross_talk": ("deflection_max_m", "contact_time_s"),
        RATE_CONTRADICTED: (*_VELOCITIES, *_OF_FORCE, "contact_time_s", "deflection_max_m"),
        FIT_DISAGREES: ("velocity_in_m_per_s", "velocity_out_m_per_s", *_FITTED),
        CONTACT_DISAGREES: ("contact_time_s", "deflection_max_m"),
        CHI2_FAR_FROM_ONE: _FITTED,
        PLATE_SHAKEN: _FITTED,
        PLATE_RINGS: _FITTED,
        FRAME_MOVES_FAR: _FITTED,
        KNOCK_SUSPECTED: (*_OF_FORCE, *_BOUNCES, *_FITTED),
        NOT_CONVERGED: _FITTED,
    }
)


def flags_affecting(name: str, flags: tuple[str, ...]) -> tuple[str, ...]:
    """Return the flags among ``flags`` that affect the number ``name``."""
    return tuple(flag for flag in flags if name in NUMBERS_AFFECTED.get(flag, ()))


def reading_flags(impact: Impact, momentum: tuple[Quantity, Quantity] | None) -> tuple[str, ...]:
    """Return the flags of impossible readings, and of readings that contradict one another.

    ``momentum`` is (impulse of the whole force pulse, m (v_out - v_in)) in N s; None if either was not read.
    """
    flags = []
    ratio = impact.cor_quasi_static
    if _sigmas_apart(ratio, impact.cor_impulse) > AGREEMENT_SIGMAS:
        flags.append("impulse_disagrees")
    if isinstance(ratio, Quantity) and ratio.value - RESTITUTION_SIGMAS * ratio.std > 1.0:
        flags.append("restitution_above_one")
    if momentum is not None and _sigmas_apart(*momentum) > MOMENTUM_SIGMAS:
        flags.append("momentum_disagrees")
    return tuple(flags)


def fit_flags(impact: Impact, fit: Fit) -> tuple[str, ...]:
    """Return the flags of a fit that contradicts the readings or does not describe the shot; () if not converged."""
    if not fit.converged:
        return ()
    # the model's plate is at rest until touched, so the fit's uncertainties do not include plate motion before
    flags = [PLATE_SHAKEN] if VIBRATION in impact.flags and not fit.on_frames else []
    if len(fit.shots) != 1:
        return tuple(flags)
    own = fit.shots[0]
    # steady frame motion is already part of the fit's noise, so this excess has another cause
    if fit.on_frames and (own.rings or fit.reduced_chi2 > CHI2_FAR):
        flags.append(KNOCK_SUSPECTED)
    pairs = (
        (impact.velocity_in_m_per_s, own.velocity_in_m_per_s),
        (impact.velocity_out_m_per_s, own.velocity_out_m_per_s),
    )
    if any(_sigmas_apart(read, fitted) > FIT_SIGMAS for read, fitted in pairs):
        flags.append(FIT_DISAGREES)
    # a fit that describes the shot knows touch and release better than the reading, which strong motion misleads
    if fit.reduced_chi2 <= CHI2_FAR and _sigmas_apart(impact.contact_time_s, _contact_time(own)) > FIT_SIGMAS:
        flags.append(CONTACT_DISAGREES)
    if np.isfinite(fit.reduced_chi2) and not 1.0 / CHI2_FAR <= fit.reduced_chi2 <= CHI2_FAR:
        flags.append(CHI2_FAR_FROM_ONE)
    return tuple(flags)


def _contact_time(fitted: ShotFit) -> Reading:
    """Return the time from the first touch to the last release of a fitted shot, without its uncertainty."""
    times = {kind: [time_s for one, time_s in fitted.overlay.events_s if one == kind] for kind in ("touch", "release")}
    if not all(times.values()):
        return NotSeen("the fitted block is not released")
    return Quantity(times["release"][-1] - times["touch"][0], 0.0)


def _sigmas_apart(one: Reading, other: Reading) -> float:
    """Return the difference of two readings in combined standard uncertainties; 0 if these are unknown or zero."""
    if not (isinstance(one, Quantity) and isinstance(other, Quantity)):
        return 0.0
    spread = float(np.hypot(one.std, other.std))
    return abs(one.value - other.value) / spread if np.isfinite(spread) and spread > 0.0 else 0.0

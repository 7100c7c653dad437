"""One shot by the quick integrator: named parameters in, what the optics would show out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis import quick
from analysis.model.least_squares import Infeasible

Floats = NDArray[np.float64]
Values = Mapping[str, Mapping[str, float]]
FINE, COARSE = 0.05, 0.3  # radians of the fastest swing a step
_MOST_PIECES = 200
_TWO_PI = 2 * math.pi

# Where each mechanical parameter goes, and by what it is multiplied on the way.
SLOTS: Mapping[str, Mapping[str, tuple[int, float]]] = {
    "coulomb_friction": {"force_n": (quick.COULOMB, 1.0)},
    "viscous_drag": {"coefficient_n_s_per_m": (quick.VISCOUS, 1.0)},
    "quadratic_drag": {"coefficient_n_s2_per_m2": (quick.QUADRATIC, 1.0)},
    "tilt": {"angle_rad": (quick.ANGLE, 1.0)},
    "bearing_gradient": {"stiffness_n_per_m": (quick.GRADIENT, 1.0)},
    "block_mode": {
        "mass_kg": (quick.INSIDE_MASS, 1.0),
        "frequency_hz": (quick.INSIDE_OMEGA, _TWO_PI),
        "damping_ratio": (quick.INSIDE_ZETA, 1.0),
    },
    "cubic_stiffness": {"coefficient_n_per_m3": (quick.CUBIC, 1.0)},
    "plate_damping": {"coefficient_n_s_per_m": (quick.PLATE_DAMPING, 1.0)},
    "viscoelastic_arm": {
        "stiffness_n_per_m": (quick.ARM_STIFFNESS, 1.0),
        "relaxation_time_s": (quick.ARM_TIME, 1.0),
    },
    "second_plate_mode": {
        "mass_kg": (quick.MODE_INVERSE_MASS, 1.0),
        "frequency_hz": (quick.MODE_OMEGA, _TWO_PI),
        "damping_ratio": (quick.MODE_ZETA, 1.0),
    },
    "support_compliance": {
        "compliance_m_per_n": (quick.COMPLIANCE, 1.0),
        "frequency_hz": (quick.CLAMP_OMEGA, _TWO_PI),
    },
    "plate_motion": {"velocity_m_per_s": (quick.START_U, 1.0), "displacement_m": (quick.START_Y, 1.0)},
    "contact_exponent": {"delta": (quick.DELTA, 1.0)},
    "nonlinear_contact_damping": {"coefficient_n_s_per_m2": (quick.OVERLAP_DAMPING, 1.0)},
    "adhesion": {"force_n": (quick.ATTRACTION, 1.0), "range_m": (quick.REACH, 1.0)},
}


@dataclass(frozen=True, slots=True)
class Optics:
    """What the sensor's effects need: wavelength in m (None: no optics) and the record's sample rate in Hz."""

    wavelength_m: float | None
    sample_rate_hz: float


@dataclass(frozen=True, slots=True)
class Run:
    """One shot's modelled motion, arrays of shape (n,).

    ``displacement_m`` as the optics see it, with the offset; ``gap_m`` negative: overlap; ``changes_s`` are touch,
    release, touch, ... on the record's clock.
    """

    displacement_m: Floats
    velocity_m_per_s: Floats
    plate_m: Floats
    gap_m: Floats
    changes_s: tuple[float, ...]


def respond(
    time_s: Floats, base: Floats, own: Floats, values: Values, mass_kg: float, optics: Optics, step: float = FINE
) -> Run:
    """Solve one shot; ``base`` is (k_p, m_p*, k_N, gamma_N), m_p* infinite for a locked plate, ``own`` (v_i, t, x_0).

    Raises Infeasible where the parameters give no trajectory.
    """
    if not (base[1] > 0 and base[2] > 0 and base[0] >= 0):
        raise Infeasible("a mass or a stiffness is not positive")
    p = np.zeros(quick.PARAMETERS)
    p[: quick.CONTACT_DAMPING + 1] = (mass_kg, *base)
    for name, given in values.items():
        for key, (slot, factor) in SLOTS.get(name, {}).items():
            p[slot] = given[key] * factor
    if p[quick.MODE_INVERSE_MASS] != 0.0:
        p[quick.MODE_INVERSE_MASS] = 1.0 / p[quick.MODE_INVERSE_MASS]
    if p[quick.INSIDE_MASS] >= mass_kg or np.any(np.isnan(p)):
        raise Infeasible("the hidden part outweighs the block")
    spacing = float(time_s[1] - time_s[0])
    pieces = math.ceil(_fastest(p) * spacing / step)
    if pieces > _MOST_PIECES:
        raise Infeasible("something would swing faster than any record can show")
    apart = math.ceil(_ringing(p) * spacing / (4 * step if step < COARSE else step))
    n = time_s.size
    x, v, plate, changes = np.empty(n), np.empty(n), np.empty(n), np.zeros(64)
    # Where something attracts, the motion is followed from the edge of its reach, which lies before the touch.
    ahead = p[quick.REACH] / abs(float(own[0])) if p[quick.ATTRACTION] != 0.0 else 0.0
    count = quick.integrate(
        time_s - own[1] + ahead, p, float(own[0]), max(1, pieces), max(1, apart), x, v, plate, changes
    )
    if count < 0 or not np.isfinite(x[-1]):
        raise Infeasible("no trajectory")
    seen = _seen(x, v, time_s, values, optics) + own[2]
    touches = tuple(float(c + own[1] - ahead) for c in (changes[:count] if ahead else (0.0, *changes[:count])))
    return Run(seen, v, plate, x - plate, touches)


def _fastest(p: Floats) -> float:
    """Return the fastest rate in rad/s of anything that swings or fades."""
    inverse = 1 / p[quick.BLOCK_MASS] + 1 / p[quick.PLATE_MASS]
    stiff = p[quick.CONTACT_STIFFNESS] * inverse + p[quick.PLATE_STIFFNESS] / p[quick.PLATE_MASS]
    swing = math.sqrt(stiff + p[quick.CONTACT_STIFFNESS] * p[quick.MODE_INVERSE_MASS])
    fade = (p[quick.CONTACT_DAMPING] + 5e-5 * p[quick.OVERLAP_DAMPING]) * (inverse + p[quick.MODE_INVERSE_MASS])
    arm = 1 / p[quick.ARM_TIME] if p[quick.ARM_STIFFNESS] != 0.0 else 0.0
    modes = (p[quick.INSIDE_OMEGA], p[quick.MODE_OMEGA], p[quick.CLAMP_OMEGA])
    return float(max(swing, fade, arm, p[quick.PLATE_DAMPING] / p[quick.PLATE_MASS], *modes))


def _ringing(p: Floats) -> float:
    """Return the fastest rate in rad/s of what rings on while the bodies are apart."""
    plate = math.sqrt(p[quick.PLATE_STIFFNESS] / p[quick.PLATE_MASS])
    return float(max(plate, p[quick.INSIDE_OMEGA], p[quick.MODE_OMEGA], p[quick.CLAMP_OMEGA]))


def _seen(x: Floats, v: Floats, time_s: Floats, values: Values, optics: Optics) -> Floats:
    """Return what the optics show of a motion (the sensor's effects)."""
    out = x
    if (lag := values.get("demodulation_lag", {}).get("time_s", 0.0)) > 0:
        out = quick.lagged(x, v, float(time_s[1] - time_s[0]), lag)
    if drift := values.get("sensor_drift"):
        out = out + 0.5 * drift["ramp_m_per_s2"] * (time_s - time_s[0]) ** 2
    if shake := values.get("frame_vibration"):
        omega = _TWO_PI * shake["frequency_hz"]
        out = out - shake["amplitude_m_per_s"] / omega * np.cos(omega * time_s + shake["phase_rad"])
    if (leak := values.get("cyclic_error")) and optics.wavelength_m is not None:
        order = leak["order"]
        # The demodulator passes the chirp near the turnaround only: below 0.4 of the record's rate, nothing above 0.5.
        turns = 2 * np.abs(v) / optics.wavelength_m * order / optics.sample_rate_hz
        passed = 0.5 + 0.5 * np.cos(np.pi * np.clip((turns - 0.4) / 0.1, 0.0, 1.0))
        out = out + leak["amplitude_m"] * passed * np.sin(
            order * 2 * _TWO_PI / optics.wavelength_m * x + leak["phase_rad"]
        )
    return out

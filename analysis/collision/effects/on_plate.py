"""Effects on the plate: its spring, its losses, its other modes, its clamp."""

import math
from typing import Any

from analysis.collision.effects.kernel import (
    FORCE,
    ON_PLATE,
    PAIR,
    PLATE_STIFFNESS,
    Q_RATE,
    TOUCHING,
    W_RATE,
    XI,
    Q,
    U,
    W,
    Y,
)
from analysis.collision.effects.row import Acts, Effect, Parameter, frequencies, second_as_frequency
from analysis.collision.parameters import Collision, Floats

_LIGHTEST = 1e-300  # lower limit of a mode's mass, because a search may try zero


def cubic_stiffness(s: Any, p: Any, out: Any) -> None:
    """Add -k_3 y^3; p = (k_3 in N/m^3).  The plate stiffens or softens with its deflection; Duffing, 1918."""
    out[ON_PLATE] -= p[0] * s[Y] * s[Y] * s[Y]


def cubic_contact(s: Any, p: Any, out: Any) -> None:
    """Add k_3 xi^3 between one body and its spring when the plate is locked; p = (k_3 in N/m^3)."""
    if s[TOUCHING].real > 0.5:
        out[PAIR] += p[0] * s[XI] * s[XI] * s[XI]


def plate_damping(s: Any, p: Any, out: Any) -> None:
    """Add -c_p y'; p = (c_p in N s/m).  Kelvin-Voigt: a dashpot parallel to the plate's spring."""
    out[ON_PLATE] -= p[0] * s[U]


def viscoelastic_arm(s: Any, p: Any, out: Any) -> None:
    """Add -F_m with F_m' = k_1 y' - F_m / tau; p = (k_1 in N/m, tau in s).  A Maxwell element."""
    out[ON_PLATE] -= s[Q]
    out[Q_RATE] += p[0] * s[U] - s[Q] / p[1]


def second_plate_mode(s: Any, p: Any, out: Any) -> None:
    """Displace the contact point by q: m_2 (q'' + 2 zeta omega q' + omega^2 q) = -F_N.

    p = (m_2 in kg, f in Hz, zeta); m_2 is the modal mass at the contact point.  A torsional or the second bending mode
    of the arm.
    """
    omega = 2.0 * math.pi * p[1]
    out[Q_RATE] += s[W]
    out[W_RATE] -= s[FORCE] / p[0] + 2.0 * p[2] * omega * s[W] + omega * omega * s[Q]


def support_compliance(s: Any, p: Any, out: Any) -> None:
    """Displace the clamp by z, z'' = omega^2 (C k_p (y - z) - z); y - z bends the spring; p = (C in m/N, f in Hz).

    The clamp's mass follows from C and f.  At low frequency z is C times the plate's spring force.
    """
    omega = 2.0 * math.pi * p[1]
    out[ON_PLATE] += s[PLATE_STIFFNESS] * s[Q]
    out[Q_RATE] += s[W]
    out[W_RATE] += omega * omega * (p[0] * s[PLATE_STIFFNESS] * (s[Y] - s[Q]) - s[Q])


def damping_rate(values: Floats, collision: Collision) -> float:
    """Return the rate at which a dashpot stops the plate; ``values`` are (c in N s/m)."""
    return float(values[0]) / collision.plate_mass_kg


def relaxation_rate(values: Floats, _collision: Collision) -> float:
    """Return the rate of an effect whose second value is its relaxation time in s."""
    return 1 / float(values[1])


def light_mode_factor(values: Floats, collision: Collision) -> float:
    """Return the factor by which a mode between block and plate, of ``values[0]`` kg, stiffens the contact."""
    inverse = 1 / collision.block_mass_kg + 1 / collision.plate_mass_kg
    return 1 + 1 / max(_LIGHTEST, float(values[0]) * inverse)


ROWS = (
    Effect(
        "cubic_stiffness",
        "a cubic stiffness of the plate",
        Acts.ON_PLATE,
        (Parameter("coefficient_n_per_m3", "N/m³", 1e5),),
        "coefficient_n_per_m3",
        cubic_stiffness,
        locked=cubic_contact,
        look_alikes=("contact_exponent",),
    ),
    Effect(
        "plate_damping",
        "damping of the plate",
        Acts.ON_PLATE,
        (Parameter("coefficient_n_s_per_m", "N s/m", 2e-4, lower=0.0),),
        "coefficient_n_s_per_m",
        plate_damping,
        fastest=damping_rate,
        look_alikes=("viscoelastic_arm",),
    ),
    Effect(
        "viscoelastic_arm",
        "a viscoelastic arm",
        Acts.ON_PLATE,
        (
            Parameter("stiffness_n_per_m", "N/m", 0.5, lower=0.0),
            Parameter(
                "relaxation_time_s", "s", 2e-3, 2e-5, 0.5, (2e-4, 5e-4, 1.2e-3, 3e-3, 7e-3, 2e-2), logarithmic=True
            ),
        ),
        "stiffness_n_per_m",
        viscoelastic_arm,
        hidden=1,
        fastest=relaxation_rate,
        look_alikes=("plate_damping",),
    ),
    Effect(
        "second_plate_mode",
        "a second mode of the plate",
        Acts.ON_PLATE,
        (
            Parameter("mass_kg", "kg", 5e-3, lower=1e-5, upper=1e4, tried=(0.1,), logarithmic=True),
            Parameter("frequency_hz", "Hz", 900.0, 1.0, 2e4, frequencies(300, 8000), logarithmic=True),
            Parameter("damping_ratio", "", 0.02, 1e-4, 0.6, (0.005, 0.03, 0.15), (0.01,), logarithmic=True),
        ),
        "mass_kg",
        second_plate_mode,
        hidden=2,
        shift=1.0,
        inverse=True,
        stiffens=light_mode_factor,
        fastest=second_as_frequency,
    ),
    Effect(
        "support_compliance",
        "a compliant support",
        Acts.ON_PLATE,
        (
            Parameter("compliance_m_per_n", "m/N", 1e-5, lower=0.0, upper=1e-2, tried=(1e-6,)),
            Parameter("frequency_hz", "Hz", 300.0, 1.0, 1e4, frequencies(200, 3000, 0.012), logarithmic=True),
        ),
        "compliance_m_per_n",
        support_compliance,
        hidden=2,
        in_series=("compliance_m_per_n", "frequency_hz"),
        fastest=second_as_frequency,
        look_alikes=("coulomb_friction", "viscous_drag"),
    ),
    Effect(
        "plate_motion",
        "a plate already swinging at first touch",
        Acts.AT_START,
        (
            Parameter("velocity_m_per_s", "m/s", 1e-4, own=True),
            Parameter("displacement_m", "m", 1e-7, own=True),
        ),
        "velocity_m_per_s",
        look_alikes=("coulomb_friction",),
    ),
)

"""Effects on the plate: its spring, its losses, its other modes, its clamp (njit by the integrator)."""

import math
from typing import Any

from analysis.model.effects.kernel import (
    FORCE,
    ON_PLATE,
    PLATE_STIFFNESS,
    Q_RATE,
    W_RATE,
    Q,
    U,
    W,
    Y,
)
from analysis.model.effects.row import Acts, Effect, Parameter, frequencies


def cubic_stiffness(s: Any, p: Any, out: Any) -> None:
    """Add -k_3 y^3; p = (k_3 in N/m^3).  A plate that stiffens (or softens) with its deflection; Duffing, 1918."""
    out[ON_PLATE] -= p[0] * s[Y] * s[Y] * s[Y]


def plate_damping(s: Any, p: Any, out: Any) -> None:
    """Add -c_p y'; p = (c_p in N s/m).  Kelvin-Voigt: the plate's dashpot beside its spring."""
    out[ON_PLATE] -= p[0] * s[U]


def viscoelastic_arm(s: Any, p: Any, out: Any) -> None:
    """Add -F_m with F_m' = k_1 y' - F_m / tau; p = (k_1 in N/m, tau in s).  A Maxwell arm beside the spring."""
    out[ON_PLATE] -= s[Q]
    out[Q_RATE] += p[0] * s[U] - s[Q] / p[1]


def second_plate_mode(s: Any, p: Any, out: Any) -> None:
    """Let the contact point move by q more: m_2 (q'' + 2 zeta omega q' + omega^2 q) = -F_N.

    p = (m_2 in kg, f in Hz, zeta); m_2 is the modal mass seen at the contact point; a torsion or the second
    bending of the arm.
    """
    omega = 2.0 * math.pi * p[1]
    out[Q_RATE] += s[W]
    out[W_RATE] -= s[FORCE] / p[0] + 2.0 * p[2] * omega * s[W] + omega * omega * s[Q]


def support_compliance(s: Any, p: Any, out: Any) -> None:
    """Let the clamp give by z: z'' = omega^2 (C k_p (y - z) - z), the spring feels y - z; p = (C in m/N, f in Hz).

    The clamp's own mass follows from both; at low frequency z = C times the plate's spring force.
    """
    omega = 2.0 * math.pi * p[1]
    out[ON_PLATE] += s[PLATE_STIFFNESS] * s[Q]
    out[Q_RATE] += s[W]
    out[W_RATE] += omega * omega * (p[0] * s[PLATE_STIFFNESS] * (s[Y] - s[Q]) - s[Q])


ROWS = (
    Effect(
        "cubic_stiffness",
        "a plate that stiffens as it bends",
        Acts.ON_PLATE,
        (Parameter("coefficient_n_per_m3", "N/m³", 2e5),),
        "coefficient_n_per_m3",
        cubic_stiffness,
        look_alikes=("contact_exponent",),
    ),
    Effect(
        "plate_damping",
        "a plate that loses energy as it bends",
        Acts.ON_PLATE,
        (Parameter("coefficient_n_s_per_m", "N s/m", 2e-4, lower=0.0),),
        "coefficient_n_s_per_m",
        plate_damping,
        fastest=lambda values: float(values[0]) / 1e-4,
        look_alikes=("viscoelastic_arm",),
    ),
    Effect(
        "viscoelastic_arm",
        "a plate whose force creeps back",
        Acts.ON_PLATE,
        (
            Parameter("stiffness_n_per_m", "N/m", 0.5, lower=0.0),
            Parameter("relaxation_time_s", "s", 2e-3, lower=2e-5, upper=1.0, grid=(2e-4, 6e-4, 2e-3, 6e-3, 2e-2, 6e-2)),
        ),
        "stiffness_n_per_m",
        viscoelastic_arm,
        hidden=1,
        fastest=lambda values: 1 / float(values[1]),
        look_alikes=("plate_damping",),
    ),
    Effect(
        "second_plate_mode",
        "a second way in which the plate swings",
        Acts.ON_PLATE,
        (
            Parameter("mass_kg", "kg", 5e-3, lower=1e-6),
            Parameter("frequency_hz", "Hz", 900.0, lower=20.0, upper=2e4, grid=frequencies(80, 6000, 150)),
            Parameter("damping_ratio", "", 0.02, lower=0.0, upper=0.7, grid=(0.005, 0.03, 0.15)),
        ),
        "mass_kg",
        second_plate_mode,
        hidden=2,
        shift=1.0,
        inverse=True,
        stiffens=lambda values: 1 + 2e-4 / float(values[0]),
        fastest=lambda values: 2 * math.pi * float(values[1]),
    ),
    Effect(
        "support_compliance",
        "a clamp that gives under the plate",
        Acts.ON_PLATE,
        (
            Parameter("compliance_m_per_n", "m/N", 1e-6, lower=0.0),
            Parameter("frequency_hz", "Hz", 300.0, lower=20.0, upper=1e4, grid=frequencies(40, 4000, 156)),
        ),
        "compliance_m_per_n",
        support_compliance,
        hidden=2,
        fastest=lambda values: 2 * math.pi * float(values[1]),
        look_alikes=("coulomb_friction", "viscous_drag"),
    ),
    Effect(
        "plate_motion",
        "a plate that already swings when the block meets it",
        Acts.AT_START,
        (
            Parameter("velocity_m_per_s", "m/s", 1e-4, own=True),
            Parameter("displacement_m", "m", 1e-7, own=True),
        ),
        "velocity_m_per_s",
        look_alikes=("coulomb_friction",),
    ),
)

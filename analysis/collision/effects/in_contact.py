"""Effects between block and plate: other laws of the contact's spring, dashpot and range."""

from typing import Any

from analysis.collision.effects.kernel import CONTACT_STIFFNESS, NEAR, PAIR, TOUCHING, XI, XI_RATE, power
from analysis.collision.effects.row import Acts, Effect, Parameter
from analysis.collision.parameters import Collision, Floats

REFERENCE_OVERLAP_M = 50e-6  # xi_0, at which power law and linear law are equal; about the paper's largest overlap


def contact_exponent(s: Any, p: Any, out: Any) -> None:
    """Make the spring k_N xi (xi / xi_0)^delta, xi_0 = 50 um; p = (delta).  delta = 1/2: Hertz, 1882."""
    if s[TOUCHING].real > 0.5 and s[XI].real > 0.0:
        out[PAIR] += s[CONTACT_STIFFNESS] * s[XI] * (power(s[XI] / REFERENCE_OVERLAP_M, p[0]) - 1.0)


def nonlinear_contact_damping(s: Any, p: Any, out: Any) -> None:
    """Add c xi xi'; p = (c in N s/m^2).  Hunt and Crossley, J. Appl. Mech. 42 (1975) 440."""
    if s[TOUCHING].real > 0.5:
        out[PAIR] += p[0] * s[XI] * s[XI_RATE]


def adhesion(s: Any, p: Any, out: Any) -> None:
    """Add an attraction -F_a while the gap is smaller than d; p = (F_a in N, d in m).

    It acts on approach and retreat, so its net work is zero: the simplest model of a capillary bridge.  "Velocity in"
    is the velocity of the flight before the gap is d; the touch is where that flight would reach the plate.
    """
    out[PAIR] -= p[0] * s[NEAR].real


def exponent_factor(values: Floats, _collision: Collision) -> float:
    """Return the factor by which another exponent may stiffen the contact, up to four times the reference overlap."""
    return (1 + abs(float(values[0]))) * 4 ** abs(float(values[0]))


def overlap_damping_rate(values: Floats, collision: Collision) -> float:
    """Return the damping rate at the reference overlap; ``values`` are (c in N s/m^2)."""
    inverse = 1 / collision.block_mass_kg + 1 / collision.plate_mass_kg
    return REFERENCE_OVERLAP_M * float(values[0]) * inverse


ROWS = (
    Effect(
        "contact_exponent",
        "a contact that stiffens with overlap",
        Acts.IN_CONTACT,
        (Parameter("delta", "", 0.02, lower=-0.15, upper=2.0, tried=(0.01,)),),
        "delta",
        contact_exponent,
        rough=True,
        stiffens=exponent_factor,
        look_alikes=("cubic_stiffness",),
    ),
    Effect(
        "nonlinear_contact_damping",
        "a contact damping that grows with overlap",
        Acts.IN_CONTACT,
        (Parameter("coefficient_n_s_per_m2", "N s/m²", 1e3, lower=0.0),),
        "coefficient_n_s_per_m2",
        nonlinear_contact_damping,
        fastest=overlap_damping_rate,
        look_alikes=("plate_motion",),
    ),
    Effect(
        "adhesion",
        "adhesion at release",
        Acts.IN_CONTACT,
        (
            Parameter("force_n", "N", 1e-4, lower=0.0),
            Parameter("range_m", "m", 1e-5, 1e-7, 5e-3, (3e-6, 1e-5, 3e-5, 1e-4, 3e-4), logarithmic=True),
        ),
        "force_n",
        adhesion,
        range_at=1,
        look_alikes=("sensor_drift",),
    ),
)

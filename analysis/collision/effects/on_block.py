"""Effects on the block, in flight and in contact: friction, drag, bearing and tilt, an internal mode."""

import math
from typing import Any

from analysis.collision.effects.kernel import BLOCK_MASS, MASS, ON_BLOCK, Q_RATE, SIGN_V, W_RATE, Q, V, W, X, sine
from analysis.collision.effects.row import Acts, Effect, Parameter, frequencies, second_as_frequency

STANDARD_GRAVITY_M_PER_S2 = 9.80665


def coulomb_friction(s: Any, p: Any, out: Any) -> None:
    """Add -F_c sgn v; p = (F_c in N).  Coulomb, "Theorie des machines simples", 1785."""
    out[ON_BLOCK] -= p[0] * s[SIGN_V].real


def viscous_drag(s: Any, p: Any, out: Any) -> None:
    """Add -c v; p = (c in N s/m).  Shear of the bearing's air film (Newtonian, laminar)."""
    out[ON_BLOCK] -= p[0] * s[V]


def quadratic_drag(s: Any, p: Any, out: Any) -> None:
    """Add -c v |v|; p = (c in N s^2/m^2).  Rayleigh's drag on a blunt body in air."""
    out[ON_BLOCK] -= p[0] * s[V] * s[V] * s[SIGN_V].real


def tilt(s: Any, p: Any, out: Any) -> None:
    """Add m_b g sin(theta); p = (theta in rad), positive where the track falls to the right.  g = 9.80665 m/s^2."""
    out[ON_BLOCK] += s[BLOCK_MASS] * STANDARD_GRAVITY_M_PER_S2 * sine(p[0])


def bearing_gradient(s: Any, p: Any, out: Any) -> None:
    """Add -k_b (x - x_0), x_0 the point of first touch; p = (k_b in N/m).  A track that is not straight."""
    out[ON_BLOCK] -= p[0] * s[X]


def block_mode(s: Any, p: Any, out: Any) -> None:
    """Put a part m_h of the block's mass on a spring and dashpot; p = (m_h in kg, f in Hz, zeta).

    With z = Q the part's position from the block's rest, w = W its velocity and omega = 2 pi f:
    m_h w' = -R, R = m_h (omega^2 (z - x) + 2 zeta omega (w - v)), (m_b - m_h) v' = ... + R.
    A loose corner cube; Den Hartog, "Mechanical Vibrations", ch. 3.
    """
    omega = 2.0 * math.pi * p[1]
    pull = omega * omega * (s[Q] - s[X]) + 2.0 * p[2] * omega * (s[W] - s[V])
    out[MASS] -= p[0]
    out[ON_BLOCK] += p[0] * pull
    out[Q_RATE] += s[W]
    out[W_RATE] -= pull


def flight_acceleration(s: Any, p: Any, out: Any) -> None:
    """Add m_b a, a = p[0] on the way in and p[1] on the way out; p = (both in m/s^2), different in every shot.

    The track may be bent or tilted where this shot flew, and air and cable differ: the shots share no law of it.
    """
    out[ON_BLOCK] += s[BLOCK_MASS] * (p[0] if s[SIGN_V].real < 0.0 else p[1])


NUISANCES = (  # fitted per shot together with all other effects; never searched for or reported
    Effect(
        "flight_acceleration",
        "flight acceleration",
        Acts.ON_BLOCK,
        (
            Parameter("before_m_per_s2", "m/s²", 1e-3, tried=(0.0,), own=True),
            Parameter("after_m_per_s2", "m/s²", 1e-3, tried=(0.0,), own=True),
        ),
        "before_m_per_s2",
        flight_acceleration,
    ),
)

ROWS = (
    Effect(
        "coulomb_friction",
        "Coulomb friction on the block",
        Acts.ON_BLOCK,
        (Parameter("force_n", "N", 2e-5, lower=0.0),),
        "force_n",
        coulomb_friction,
        look_alikes=("viscous_drag", "sensor_drift"),
    ),
    Effect(
        "viscous_drag",
        "viscous drag on the block",
        Acts.ON_BLOCK,
        (Parameter("coefficient_n_s_per_m", "N s/m", 1e-4, lower=0.0),),
        "coefficient_n_s_per_m",
        viscous_drag,
        look_alikes=("quadratic_drag", "coulomb_friction"),
    ),
    Effect(
        "quadratic_drag",
        "quadratic drag on the block",
        Acts.ON_BLOCK,
        (Parameter("coefficient_n_s2_per_m2", "N s²/m²", 3e-4, lower=0.0),),
        "coefficient_n_s2_per_m2",
        quadratic_drag,
        look_alikes=("viscous_drag",),
    ),
    Effect(
        "tilt",
        "a tilt of the guideway",
        Acts.ON_BLOCK,
        (Parameter("angle_rad", "rad", 1e-4, lower=-0.5, upper=0.5),),
        "angle_rad",
        tilt,
        look_alikes=("sensor_drift",),
    ),
    Effect(
        "bearing_gradient",
        "a gradient of the bearing",
        Acts.ON_BLOCK,
        (Parameter("stiffness_n_per_m", "N/m", 1e-2),),
        "stiffness_n_per_m",
        bearing_gradient,
        look_alikes=("tilt",),
    ),
    Effect(
        "block_mode",
        "an internal mode of the block",
        Acts.ON_BLOCK,
        (
            Parameter("mass_kg", "kg", 1e-5, lower=0.0, upper=8e-3, tried=(2e-5,)),
            Parameter("frequency_hz", "Hz", 600.0, 1.0, 2e4, frequencies(10, 4000), logarithmic=True),
            Parameter("damping_ratio", "", 0.02, 1e-4, 0.6, (0.005, 0.03, 0.15), (0.015,), logarithmic=True),
        ),
        "mass_kg",
        block_mode,
        hidden=2,
        moves_with_block=True,
        fastest=second_as_frequency,
    ),
)

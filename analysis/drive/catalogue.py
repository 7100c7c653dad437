"""What a drive may have beside mass, viscous drag and a constant force: one row a law, one function a row.

A law adds a force to M a + c v + f_0, linear in some parameters ("linear") and not in others ("bent"), which are
searched.  Adding a law is adding a function and a row; nothing else changes.  Sources: H. Olsson, K. J. Astroem et al.,
"Friction models and friction compensation", Eur. J. Control 4 (1998); J. Swevers, W. Verdonck, J. De Schutter,
"Dynamic model identification for industrial robots", IEEE Control Syst. 27 (2007).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from analysis.drive.presliding import bristles
from analysis.drive.run import LONGEST_DELAY, Run

Floats = NDArray[np.float64]
Columns = tuple[Floats, ...]
BASE = ("moving_mass_kg", "viscous_coefficient_n_s_per_m", "offset_n")


class Span(Enum):
    """What a bent parameter is laid out against before it is searched."""

    SPEED = "the fastest speed"
    TRAVEL = "the travel"
    PITCH = "the travel, in equal steps of waves along it"
    TIME = "one period of the bandwidth"
    NUMBER = "nothing: a number without a unit"


@dataclass(frozen=True, slots=True)
class Bent:
    """A parameter in which the force is not linear: its bounds and the points tried first, in shares of ``span``."""

    name: str
    span: Span
    low: float
    high: float
    tried: tuple[float, ...] = ()
    logarithmic: bool = True

    def scaled(self, runs: Sequence[Run]) -> float:
        """Return what one share is worth in these records, in the parameter's unit."""
        if self.span is Span.SPEED:
            return max(float(np.abs(run.velocity_m_per_s[run.used]).max()) for run in runs)
        if self.span in (Span.TRAVEL, Span.PITCH):
            return max(float(np.ptp(run.displacement_m[run.used])) for run in runs)
        return 1.0 / runs[0].bandwidth_hz if self.span is Span.TIME else 1.0


@dataclass(frozen=True, slots=True)
class Law:
    """A row: ``force(run, bent)`` returns one column (n,) a linear parameter, in N a unit of it; ``formula`` says what.

    Without ``force`` the law moves the time of the measured force (its one bent parameter, in s).  ``of_force``: it is
    made of that force, and where it is nearly the force itself it would explain anything.
    """

    name: str
    linear: tuple[str, ...]
    formula: str
    force: Callable[[Run, Sequence[float]], Columns] | None
    bent: tuple[Bent, ...] = ()
    of_force: bool = False
    words: str = ""  # where the name alone does not say it

    @property
    def parameters(self) -> tuple[str, ...]:
        """Get the names of all parameters, the linear ones first."""
        return (*self.linear, *(bent.name for bent in self.bent))


def coulomb(run: Run, _bent: Sequence[float]) -> Columns:
    """F_c sgn v, in N."""
    return (np.sign(run.velocity_m_per_s),)


def directional_drag(run: Run, _bent: Sequence[float]) -> Columns:
    """Return c_d |v|, c_d in N s/m: the drag is c + c_d one way and c - c_d the other."""
    return (np.abs(run.velocity_m_per_s),)


def quadratic_drag(run: Run, _bent: Sequence[float]) -> Columns:
    """Return c v|v|, c in N s2/m2."""
    return (run.velocity_m_per_s * np.abs(run.velocity_m_per_s),)


def stribeck(run: Run, bent: Sequence[float]) -> Columns:
    """Return F_s sgn v exp(-|v|/v_s), F_s in N, above zero if friction rises towards rest (R. Stribeck, 1902)."""
    v = run.velocity_m_per_s
    return (np.sign(v) * np.exp(-np.abs(v) / bent[0]),)


def dahl(run: Run, bent: Sequence[float]) -> Columns:
    """Return F_d (z - sgn v), F_d in N: so much of the sliding friction builds up over a reach (m) after a turn."""
    v = run.velocity_m_per_s
    return (bristles(run.displacement_m, v, np.ones(v.size), bent[0]) - np.sign(v),)


def lugre(run: Run, bent: Sequence[float]) -> Columns:
    """Return F_l (z - sgn v), z bending to 1 + e exp(-(v/v_s)^2) over a reach (m); v_s in m/s, e without unit."""
    v = run.velocity_m_per_s
    level = 1.0 + bent[2] * np.exp(-((v / bent[1]) ** 2))
    return (bristles(run.displacement_m, v, level, bent[0]) - np.sign(v),)


def ripple(run: Run, bent: Sequence[float]) -> Columns:
    """Return s sin(2 pi x/p) + c cos(2 pi x/p), s and c in N, p in m: as of magnets or a screw."""
    angle = 2.0 * np.pi * run.displacement_m / bent[0]
    return np.sin(angle), np.cos(angle)


def place_friction(run: Run, _bent: Sequence[float]) -> Columns:
    """Return sgn v (s x + q x^2), s in N/m, q in N/m2: a guide that is tighter in places."""
    way, x = np.sign(run.velocity_m_per_s), run.displacement_m
    return way * x, way * x**2


def load_friction(run: Run, _bent: Sequence[float]) -> Columns:
    """Return m |F| sgn v, m without unit: friction that grows with the force a gear or screw passes on."""
    return (np.abs(run.force_n) * np.sign(run.velocity_m_per_s),)


def gradient(run: Run, _bent: Sequence[float]) -> Columns:
    """Return k x, k in N/m: a spring, a cable, a guide that is not level throughout."""
    return (run.displacement_m,)


def quadratic_spring(run: Run, _bent: Sequence[float]) -> Columns:
    """Return k_2 x^2, k_2 in N/m2."""
    return (run.displacement_m**2,)


def cubic_spring(run: Run, _bent: Sequence[float]) -> Columns:
    """Return k_3 x^3, k_3 in N/m3."""
    return (run.displacement_m**3,)


SPEED = Bent("speed_m_per_s", Span.SPEED, 3e-4, 1.0, tuple(np.geomspace(0.005, 0.3, 7)))
REACH = Bent("reach_m", Span.TRAVEL, 1e-7, 0.3, tuple(np.geomspace(1e-5, 0.03, 8)))
LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        Law("coulomb_friction", ("force_n",), "F_c sgn v", coulomb),
        Law("directional_viscous_drag", ("coefficient_n_s_per_m",), "c_d |v|", directional_drag,
            words="direction-dependent viscous drag"),
        Law("quadratic_drag", ("coefficient_n_s2_per_m2",), "c v|v|", quadratic_drag),
        Law("stribeck_friction", ("force_n",), "F_s sgn v exp(-|v|/v_s)", stribeck, (SPEED,),
            words="Stribeck friction"),
        Law("presliding_friction", ("force_n",), "F_d (z - sgn v), dz/dx = (1 - z sgn v)/reach", dahl, (REACH,)),
        Law(
            "lugre_friction", ("force_n",), "F_l (z - sgn v), z bending to 1 + e exp(-(v/v_s)^2) over a reach", lugre,
            (
                Bent("reach_m", Span.TRAVEL, 1e-7, 0.3, (1e-4, 1e-3)),
                Bent("speed_m_per_s", Span.SPEED, 3e-4, 1.0, (0.03, 0.1)),
                Bent("static_excess", Span.NUMBER, -0.95, 5.0, (0.5,), logarithmic=False),
            ),
            words="LuGre friction",
        ),
        Law(
            "position_ripple", ("sine_n", "cosine_n"), "s sin(2 pi x/p) + c cos(2 pi x/p)", ripple,
            (Bent("pitch_m", Span.PITCH, 1.0 / 400.0, 0.7),),
            words="a ripple along the travel",
        ),
        Law("place_dependent_friction", ("slope_n_per_m", "curvature_n_per_m2"), "sgn v (s x + q x^2)", place_friction,
            words="position-dependent friction"),
        Law("load_dependent_friction", ("fraction",), "m |F| sgn v", load_friction, of_force=True,
            words="load-dependent friction"),
        Law("bearing_gradient", ("stiffness_n_per_m",), "k x", gradient),
        Law("quadratic_stiffness", ("coefficient_n_per_m2",), "k_2 x^2", quadratic_spring,
            words="an asymmetric spring"),
        Law("cubic_stiffness", ("coefficient_n_per_m3",), "k_3 x^3", cubic_spring),
        Law(
            "drive_delay", (), "F(t - time)", None,
            (Bent("time_s", Span.TIME, -LONGEST_DELAY, LONGEST_DELAY, tuple(np.linspace(-0.2, 0.2, 17)), False),),
            words="a delay between force and motion",
        ),
    )
}  # fmt: skip

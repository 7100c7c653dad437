"""The laws that may act in a drive in addition to mass, viscous drag and a constant force.

A law adds a force to M a + c v + f_0.  Its linear parameters are solved for, its nonlinear parameters are searched.
To add a law, add a function and a row of ``LAWS``.  Sources: H. Olsson, K. J. Astroem et al.,
"Friction models and friction compensation", Eur. J. Control 4 (1998); J. Swevers, W. Verdonck, J. De Schutter,
"Dynamic model identification for industrial robots", IEEE Control Syst. 27 (2007).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numba import njit

from analysis.collision import Acts, Effect, Parameter
from analysis.drive.stretch import LONGEST_DELAY, Stretch
from analysis.shot import AnalysisError, Floats, split_unit

Columns = tuple[Floats, ...]
BASE = ("moving_mass_kg", "viscous_coefficient_n_s_per_m", "offset_n")


class ParameterScale(Enum):
    """The quantity of a record in units of which a nonlinear parameter's bounds and grid are given."""

    SPEED = "the fastest speed"
    TRAVEL = "the travel"
    PITCH = "the travel, in equal steps of waves along it"
    TIME = "one period of the bandwidth"
    NUMBER = "nothing: a number without a unit"


@dataclass(frozen=True, slots=True)
class NonlinearParameter:
    """A parameter in which the force is nonlinear, with bounds and starting grid as shares of ``scale``."""

    name: str
    scale: ParameterScale
    low: float
    high: float
    grid: tuple[float, ...] = ()
    logarithmic: bool = True

    def scale_in(self, stretches: Sequence[Stretch]) -> float:
        """Return the value of ``scale`` in these records, in the parameter's unit."""
        if self.scale is ParameterScale.SPEED:
            return max(float(np.abs(stretch.velocity_m_per_s[stretch.used]).max()) for stretch in stretches)
        if self.scale in (ParameterScale.TRAVEL, ParameterScale.PITCH):
            return max(float(np.ptp(stretch.displacement_m[stretch.used])) for stretch in stretches)
        return 1.0 / stretches[0].bandwidth_hz if self.scale is ParameterScale.TIME else 1.0


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class Law(Effect):
    """One law of a drive.

    ``force(stretch, nonlinear)`` returns a column (n,) for each linear parameter, in N per unit of it.  Without
    ``force`` the law delays the measured force by its one nonlinear parameter, in s.  ``of_force``: the law is computed
    from the measured force, and where it is nearly proportional to that force it would explain any motion.
    """

    linear: tuple[str, ...]
    formula: str
    force: Callable[[Stretch, Sequence[float]], Columns] | None
    nonlinear_parameters: tuple[NonlinearParameter, ...]
    of_force: bool


def _law(
    name: str,
    linear: tuple[str, ...],
    formula: str,
    force: Callable[[Stretch, Sequence[float]], Columns] | None,
    nonlinear: tuple[NonlinearParameter, ...] = (),
    *,
    of_force: bool = False,
    words: str = "",  # if they differ from the name
) -> Law:
    names = (*linear, *(parameter.name for parameter in nonlinear))
    return Law(
        name,
        words or name.replace("_", " "),
        Acts.IN_DRIVE,
        tuple(Parameter(one, split_unit(one)[1], 1.0) for one in names),
        names[0],
        linear=linear,
        formula=formula,
        force=force,
        nonlinear_parameters=nonlinear,
        of_force=of_force,
    )


def coulomb(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return F_c sgn v, F_c in N."""
    return (np.sign(stretch.velocity_m_per_s),)


def directional_drag(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return c_d |v|, c_d in N s/m: the drag is c + c_d in one direction and c - c_d in the other."""
    return (np.abs(stretch.velocity_m_per_s),)


def quadratic_drag(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return c v|v|, c in N s2/m2."""
    return (stretch.velocity_m_per_s * np.abs(stretch.velocity_m_per_s),)


def stribeck(stretch: Stretch, nonlinear: Sequence[float]) -> Columns:
    """Return F_s sgn v exp(-|v|/v_s), F_s in N; F_s > 0 if friction rises towards rest (R. Stribeck, 1902)."""
    v = stretch.velocity_m_per_s
    return (np.sign(v) * np.exp(-np.abs(v) / nonlinear[0]),)


def dahl(stretch: Stretch, nonlinear: Sequence[float]) -> Columns:
    """Return F_d (z - sgn v), F_d in N: sliding friction that builds up over a distance (m) after each reversal."""
    v = stretch.velocity_m_per_s
    return (bristle_deflection(stretch.displacement_m, v, np.ones(v.size), nonlinear[0]) - np.sign(v),)


def lugre(stretch: Stretch, nonlinear: Sequence[float]) -> Columns:
    """Return F_l (z - sgn v); z tends to 1 + e exp(-(v/v_s)^2) over a distance (m); v_s in m/s, e without unit."""
    v = stretch.velocity_m_per_s
    level = 1.0 + nonlinear[2] * np.exp(-((v / nonlinear[1]) ** 2))
    return (bristle_deflection(stretch.displacement_m, v, level, nonlinear[0]) - np.sign(v),)


@njit(cache=True, nogil=True, error_model="numpy")
def bristle_deflection(displacement_m: Floats, velocity_m_per_s: Floats, level: Floats, reach_m: float) -> Floats:
    """Return the bristle deflection z, shape (n,), relative to sliding friction: dz/dx = (level - z sgn v)/reach.

    ``level``, shape (n,), is the deflection in steady sliding: 1 for Dahl's law (P. Dahl, 1968), Stribeck's curve for
    LuGre (C. Canudas de Wit et al., IEEE Trans. Autom. Control 40, 1995).  Exact for a level constant over a step.
    The record is assumed to begin in steady sliding in its first direction.  Cost: one exponential per sample.
    """
    out = np.empty(displacement_m.size)
    deflection = 0.0
    for i in range(displacement_m.size):
        if velocity_m_per_s[i] != 0.0:
            deflection = np.sign(velocity_m_per_s[i]) * level[i]
            break
    for i in range(displacement_m.size):
        way = displacement_m[i] - displacement_m[max(0, i - 1)]
        end = np.sign(way) * level[i]
        deflection = end + (deflection - end) * np.exp(-abs(way) / (reach_m * level[i]))
        out[i] = deflection
    return out


def ripple(stretch: Stretch, nonlinear: Sequence[float]) -> Columns:
    """Return s sin(2 pi x/p) + c cos(2 pi x/p), s and c in N, p in m: the ripple of magnets or of a screw."""
    angle = 2.0 * np.pi * stretch.displacement_m / nonlinear[0]
    return np.sin(angle), np.cos(angle)


def place_friction(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return sgn v (s x + q x^2), s in N/m, q in N/m2: friction of a guide that is tighter at some positions."""
    way, x = np.sign(stretch.velocity_m_per_s), stretch.displacement_m
    return way * x, way * x**2


def load_friction(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return m |F| sgn v, m without unit: friction proportional to the force transmitted by a gear or screw."""
    return (np.abs(stretch.force_n) * np.sign(stretch.velocity_m_per_s),)


def gradient(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return k x, k in N/m: a spring, a cable, or a guide whose slope varies."""
    return (stretch.displacement_m,)


def quadratic_spring(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return k_2 x^2, k_2 in N/m2."""
    return (stretch.displacement_m**2,)


def cubic_spring(stretch: Stretch, _nonlinear: Sequence[float]) -> Columns:
    """Return k_3 x^3, k_3 in N/m3."""
    return (stretch.displacement_m**3,)


SPEED = NonlinearParameter("speed_m_per_s", ParameterScale.SPEED, 3e-4, 1.0, tuple(np.geomspace(0.005, 0.3, 7)))
REACH = NonlinearParameter("reach_m", ParameterScale.TRAVEL, 1e-7, 0.3, tuple(np.geomspace(1e-5, 0.03, 8)))
LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        _law("coulomb_friction", ("force_n",), "F_c sgn v", coulomb),
        _law("directional_viscous_drag", ("coefficient_n_s_per_m",), "c_d |v|", directional_drag,
            words="direction-dependent viscous drag"),
        _law("quadratic_drag", ("coefficient_n_s2_per_m2",), "c v|v|", quadratic_drag),
        _law("stribeck_friction", ("force_n",), "F_s sgn v exp(-|v|/v_s)", stribeck, (SPEED,),
            words="Stribeck friction"),
        _law("presliding_friction", ("force_n",), "F_d (z - sgn v), dz/dx = (1 - z sgn v)/reach", dahl, (REACH,)),
        _law(
            "lugre_friction", ("force_n",), "F_l (z - sgn v), z bending to 1 + e exp(-(v/v_s)^2) over a reach", lugre,
            (
                NonlinearParameter("reach_m", ParameterScale.TRAVEL, 1e-7, 0.3, (1e-4, 1e-3)),
                NonlinearParameter("speed_m_per_s", ParameterScale.SPEED, 3e-4, 1.0, (0.03, 0.1)),
                NonlinearParameter("static_excess", ParameterScale.NUMBER, -0.95, 5.0, (0.5,), logarithmic=False),
            ),
            words="LuGre friction",
        ),
        _law(
            "position_ripple", ("sine_n", "cosine_n"), "s sin(2 pi x/p) + c cos(2 pi x/p)", ripple,
            (NonlinearParameter("pitch_m", ParameterScale.PITCH, 1.0 / 400.0, 0.7),),
            words="a ripple along the travel",
        ),
        _law("place_dependent_friction", ("slope_n_per_m", "curvature_n_per_m2"), "sgn v (s x + q x^2)", place_friction,
            words="position-dependent friction"),
        _law("load_dependent_friction", ("fraction",), "m |F| sgn v", load_friction, of_force=True,
            words="load-dependent friction"),
        _law("bearing_gradient", ("stiffness_n_per_m",), "k x", gradient),
        _law("quadratic_stiffness", ("coefficient_n_per_m2",), "k_2 x^2", quadratic_spring,
            words="an asymmetric spring"),
        _law("cubic_stiffness", ("coefficient_n_per_m3",), "k_3 x^3", cubic_spring),
        _law(
            "drive_delay", (), "F(t - time)", None,
            (
                NonlinearParameter(
                    "time_s", ParameterScale.TIME, -LONGEST_DELAY, LONGEST_DELAY, tuple(np.linspace(-0.2, 0.2, 17)),
                    logarithmic=False,
                ),
            ),
            words="a delay between force and motion",
        ),
    )
}  # fmt: skip

GAIN_ERROR = Effect(  # a candidate of a diagnosis, but not a law that a model can include
    "gain_error", "an error of the force's scale", Acts.IN_DRIVE, (Parameter("fraction", "", 1e-3),), "fraction"
)


def laws_named(laws: Iterable[Effect | str]) -> tuple[Law, ...]:
    """Return a drive's laws, given as effects or by name.  Raises AnalysisError for anything else."""
    names = [law if isinstance(law, str) else law.name for law in laws]
    if unknown := [name for name in names if name not in LAWS]:
        raise AnalysisError(f"no effect of a drive is called {unknown[0]!r}; there are {', '.join(LAWS)}")
    return tuple(LAWS[name] for name in names)

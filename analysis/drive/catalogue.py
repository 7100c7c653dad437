"""The laws that may act in a drive in addition to mass, viscous drag and a constant force.

A law adds a force to M a + c v + f_0.  Its linear parameters are solved for, its nonlinear parameters are searched.
To add a law, add a row of ``LAWS``.  Sources: H. Olsson, K. J. Astroem et al., "Friction models and friction
compensation", Eur. J. Control 4 (1998); J. Swevers, W. Verdonck, J. De Schutter, "Dynamic model identification for
industrial robots", IEEE Control Syst. 27 (2007).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numba import njit

from analysis.collision import Acts, Effect, Parameter
from analysis.drive.stretch import LONGEST_DELAY, Stretch
from analysis.shot import AnalysisError, Floats, split_unit

Force = Callable[[Stretch, Sequence[float]], tuple[Floats, ...]]
BASE = ("moving_mass_kg", "viscous_coefficient_n_s_per_m", "offset_n")


class ParameterScale(Enum):
    """The quantity of a record in units of which a nonlinear parameter's bounds and grid are given."""

    SPEED = "the fastest speed"
    TRAVEL = "the travel"
    PITCH = "the travel, in equal steps of waves along it"
    TIME = "one period of the bandwidth"
    NUMBER = "nothing: a number without a unit"


@dataclass(frozen=True, slots=True, kw_only=True)
class NonlinearParameter(Parameter):
    """A parameter in which the force is nonlinear, with bounds and starting grid as shares of ``share_of``."""

    share_of: ParameterScale

    def scale_in(self, stretches: Sequence[Stretch]) -> float:
        """Return the value of ``share_of`` in these records, in the parameter's unit."""
        if self.share_of is ParameterScale.SPEED:
            return max(float(np.abs(stretch.velocity_m_per_s[stretch.used]).max()) for stretch in stretches)
        if self.share_of in (ParameterScale.TRAVEL, ParameterScale.PITCH):
            return max(float(np.ptp(stretch.displacement_m[stretch.used])) for stretch in stretches)
        return 1.0 / stretches[0].bandwidth_hz if self.share_of is ParameterScale.TIME else 1.0


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class Law(Effect):
    """One law of a drive.

    ``force(stretch, nonlinear)`` returns a column (n,) for each linear parameter, in N per unit of it.  Without
    ``force`` the law delays the measured force by its one nonlinear parameter, in s.  ``of_force``: the law is computed
    from the measured force, and where it is nearly proportional to that force it would explain any motion.  A law is
    sent to another process by its name, so its functions need none.
    """

    formula: str
    force: Force | None
    of_force: bool

    def __reduce__(self) -> tuple[Callable[[str], "Law"], tuple[str]]:
        return _row, (self.name,)

    @property
    def nonlinear_parameters(self) -> tuple[NonlinearParameter, ...]:
        """Get the parameters that are searched."""
        return tuple(p for p in self.parameters if isinstance(p, NonlinearParameter))

    @property
    def linear_names(self) -> tuple[str, ...]:
        """Get the full names, in a model, of the parameters that are solved for."""
        return tuple(f"{self.name}.{p.name}" for p in self.parameters if not isinstance(p, NonlinearParameter))

    @property
    def nonlinear_names(self) -> tuple[str, ...]:
        """Get the full names, in a model, of the parameters that are searched."""
        return tuple(f"{self.name}.{p.name}" for p in self.nonlinear_parameters)

    def values_in(self, nonlinear: Mapping[str, float]) -> tuple[float, ...]:
        """Return the nonlinear parameters' values out of those of a model by their full names."""
        return tuple(nonlinear[name] for name in self.nonlinear_names)


def _row(name: str) -> Law:
    return LAWS[name]


def _law(
    name: str,
    formula: str,
    force: Force | None,
    *parameters: str | NonlinearParameter,
    of_force: bool = False,
    words: str = "",  # if they differ from the name
) -> Law:
    rows = tuple(Parameter(p, split_unit(p)[1], 1.0) if isinstance(p, str) else p for p in parameters)
    return Law(
        name, words or name.replace("_", " "), Acts.IN_DRIVE, rows, rows[0].name,
        formula=formula, force=force, of_force=of_force,
    )  # fmt: skip


def _searched(
    name: str, share_of: ParameterScale, lower: float, upper: float, grid: Sequence[float] = (), *, log: bool = True
) -> NonlinearParameter:
    unit = split_unit(name)[1]
    return NonlinearParameter(name, unit, 1.0, lower, upper, tuple(grid), logarithmic=log, share_of=share_of)


def _dahl(stretch: Stretch, nonlinear: Sequence[float]) -> tuple[Floats, ...]:
    v = stretch.velocity_m_per_s
    return (bristle_deflection(stretch.displacement_m, v, np.ones(v.size), nonlinear[0]) - np.sign(v),)


def _lugre(stretch: Stretch, nonlinear: Sequence[float]) -> tuple[Floats, ...]:
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


def _ripple(stretch: Stretch, nonlinear: Sequence[float]) -> tuple[Floats, ...]:
    angle = 2.0 * np.pi * stretch.displacement_m / nonlinear[0]
    return np.sin(angle), np.cos(angle)


SPEED, TRAVEL = ParameterScale.SPEED, ParameterScale.TRAVEL
LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        _law("coulomb_friction", "F_c sgn v", lambda s, _: (np.sign(s.velocity_m_per_s),), "force_n"),
        # the drag is c + c_d in one direction and c - c_d in the other
        _law("directional_viscous_drag", "c_d |v|", lambda s, _: (np.abs(s.velocity_m_per_s),), "coefficient_n_s_per_m",
             words="direction-dependent viscous drag"),
        _law("quadratic_drag", "c v|v|", lambda s, _: (s.velocity_m_per_s * np.abs(s.velocity_m_per_s),),
             "coefficient_n_s2_per_m2"),
        # F_s > 0 if friction rises towards rest (R. Stribeck, 1902)
        _law("stribeck_friction", "F_s sgn v exp(-|v|/v_s)",
             lambda s, at: (np.sign(s.velocity_m_per_s) * np.exp(-np.abs(s.velocity_m_per_s) / at[0]),),
             "force_n", _searched("speed_m_per_s", SPEED, 3e-4, 1.0, np.geomspace(0.005, 0.3, 7).tolist()),
             words="Stribeck friction"),
        # sliding friction that builds up over a distance after each reversal
        _law("presliding_friction", "F_d (z - sgn v), dz/dx = (1 - z sgn v)/reach", _dahl,
             "force_n", _searched("reach_m", TRAVEL, 1e-7, 0.3, np.geomspace(1e-5, 0.03, 8).tolist())),
        _law("lugre_friction", "F_l (z - sgn v), z bending to 1 + e exp(-(v/v_s)^2) over a reach", _lugre,
             "force_n", _searched("reach_m", TRAVEL, 1e-7, 0.3, (1e-4, 1e-3)),
             _searched("speed_m_per_s", SPEED, 3e-4, 1.0, (0.03, 0.1)),
             _searched("static_excess", ParameterScale.NUMBER, -0.95, 5.0, (0.5,), log=False),
             words="LuGre friction"),
        # the ripple of magnets or of a screw
        _law("position_ripple", "s sin(2 pi x/p) + c cos(2 pi x/p)", _ripple,
             "sine_n", "cosine_n", _searched("pitch_m", ParameterScale.PITCH, 1.0 / 400.0, 0.7),
             words="a ripple along the travel"),
        # friction of a guide that is tighter at some positions
        _law("place_dependent_friction", "sgn v (s x + q x^2)",
             lambda s, _: tuple(np.sign(s.velocity_m_per_s) * s.displacement_m**power for power in (1, 2)),
             "slope_n_per_m", "curvature_n_per_m2", words="position-dependent friction"),
        # friction proportional to the force transmitted by a gear or screw
        _law("load_dependent_friction", "m |F| sgn v",
             lambda s, _: (np.abs(s.force_n) * np.sign(s.velocity_m_per_s),), "fraction",
             of_force=True, words="load-dependent friction"),
        # a spring, a cable, or a guide whose slope varies
        _law("bearing_gradient", "k x", lambda s, _: (s.displacement_m,), "stiffness_n_per_m"),
        _law("quadratic_stiffness", "k_2 x^2", lambda s, _: (s.displacement_m**2,), "coefficient_n_per_m2",
             words="an asymmetric spring"),
        _law("cubic_stiffness", "k_3 x^3", lambda s, _: (s.displacement_m**3,), "coefficient_n_per_m3"),
        _law("drive_delay", "F(t - time)", None,
             _searched("time_s", ParameterScale.TIME, -LONGEST_DELAY, LONGEST_DELAY,
                       np.linspace(-0.2, 0.2, 17).tolist(), log=False),
             words="a delay between force and motion"),
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

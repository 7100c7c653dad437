"""One shot as the fit sees it: its whitened samples, and what the model and its parameters do to them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.model.exact import TooManyEvents, Trajectory, solve
from analysis.model.least_squares import Infeasible
from analysis.model.parameters import Collision, Floats, Variant
from analysis.model.starts import Course
from analysis.noise import Noise

PLATE_NAMES = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
)
CONTACT_NAMES = ("contact_stiffness_n_per_m", "contact_damping_n_s_per_m")
_MOST_RADIANS = 1e5
OWN_NAMES = ("velocity_in_m_per_s", "touch_time_s", "offset_m")


@dataclass(frozen=True, slots=True)
class ShotData:
    """The samples of one shot that are fitted; arrays of shape (n,)."""

    time_s: Floats
    displacement_m: Floats
    valid: NDArray[np.bool_]
    block_mass_kg: float
    course: Course
    noise: Noise


@dataclass(frozen=True, slots=True)
class Base:
    """Which base model is fitted: the paper's two bodies, or one body on a contact whose plate does not move."""

    variant: Variant
    one_body: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Get the names of the shared parameters, in the fit's order."""
        return CONTACT_NAMES if self.one_body else PLATE_NAMES

    @property
    def columns(self) -> tuple[int, ...]:
        """Get where those parameters stand in the kernels' order."""
        return (2, 3) if self.one_body else (0, 1, 2, 3)

    def collision(self, shared: Floats, velocity_in_m_per_s: float, block_mass_kg: float) -> Collision:
        """Return the collision these parameters mean; Infeasible where there is none."""
        values = [float(value) for value in shared]
        k_p, m_p, k_n, gamma_n = (0.0, math.inf, *values) if self.one_body else values
        try:
            return Collision(block_mass_kg, float(velocity_in_m_per_s), k_p, m_p, k_n, gamma_n, variant=self.variant)
        except ValueError as why:
            raise Infeasible(str(why)) from why

    def shared(self, collision: Collision) -> Floats:
        """Return the shared parameters of a collision, in the fit's order."""
        return collision.vector[list(self.columns)]


@dataclass(frozen=True, slots=True)
class Response:
    """The model's displacement, shape (n,), its derivatives by (shared, own), shape (n, p), and the trajectory."""

    displacement_m: Floats
    derivatives: Floats
    trajectory: Trajectory


def respond(base: Base, shot: ShotData, shared: Floats, own: Floats, *, derivatives: bool = True) -> Response:
    """Solve the base model for one shot; ``own`` is (v_i, touch time, offset).  Infeasible where it cannot be."""
    collision = base.collision(shared, own[0], shot.block_mass_kg)
    if collision.fastest_rate_rad_per_s * (shot.time_s[-1] - shot.time_s[0]) > _MOST_RADIANS:
        raise Infeasible("the contact would swing faster than any that a record can show")
    try:
        run = solve(collision, shot.time_s - own[1], derivatives=derivatives)
    except TooManyEvents as why:
        raise Infeasible(str(why)) from why
    if not derivatives:
        return Response(run.displacement_m + own[2], np.empty((0, 0)), run)
    columns = [run.displacement_derivatives[:, k] for k in (*base.columns, 4)]
    columns += [-run.velocity_m_per_s, np.ones(shot.time_s.size)]
    return Response(run.displacement_m + own[2], np.stack(columns, axis=1), run)

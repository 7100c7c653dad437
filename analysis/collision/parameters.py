"""The parameters of the paper's model, in SI units, and the variants of its contact law."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Infeasible(ArithmeticError):
    """No trajectory exists for the parameters; a search rejects them."""


class Variant(IntEnum):
    """The variant of the contact law: the action of the dashpot while the two bodies part."""

    PAPER = 0  # Eq. 4, 9: damping both ways, tension allowed until the overlap is zero
    CLAMPED = 1  # Eq. 10 as printed: no damping while the bodies part
    NO_TENSION = 2  # the contact never pulls: release when the force reaches zero


@dataclass(frozen=True, slots=True)
class Collision:
    """A block that hits a spring plate (docs/physics.md, "the model"); time zero is the first touch, x points right.

    An infinite ``plate_mass_kg`` locks the plate: the one-body contact of a motion record.
    ``plate_displacement_m`` and ``plate_velocity_m_per_s`` are those of the plate at first touch.
    """

    block_mass_kg: float
    velocity_in_m_per_s: float
    plate_stiffness_n_per_m: float
    plate_mass_kg: float
    contact_stiffness_n_per_m: float
    contact_damping_n_s_per_m: float
    plate_displacement_m: float = 0.0
    plate_velocity_m_per_s: float = 0.0
    variant: Variant = Variant.PAPER

    def __post_init__(self) -> None:
        for name in ("block_mass_kg", "plate_mass_kg", "contact_stiffness_n_per_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)!r}")
        for name in ("plate_stiffness_n_per_m", "contact_damping_n_s_per_m"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must not be negative, it is {getattr(self, name)!r}")
        if not self.velocity_in_m_per_s < self.plate_velocity_m_per_s:
            raise ValueError("velocity_in_m_per_s must carry the block towards the plate (below the plate's velocity)")

    @property
    def vector(self) -> Floats:
        """Get the parameters in the order of ``KERNEL_ORDER``, as the kernels take them, shape (8,)."""
        return np.array([getattr(self, name) for name in KERNEL_ORDER])

    def at_speed(self, velocity_in_m_per_s: float) -> "Collision":
        """Return the same collision at another velocity."""
        return replace(self, velocity_in_m_per_s=velocity_in_m_per_s)

    @property
    def contact_time_estimate_s(self) -> float:
        """Get the half period of block and plate on the plate's spring (on the contact's if the plate is locked)."""
        if math.isinf(self.plate_mass_kg):
            return math.pi * math.sqrt(self.block_mass_kg / self.contact_stiffness_n_per_m)
        series = 1 / (1 / max(self.plate_stiffness_n_per_m, 1e-9) + 1 / self.contact_stiffness_n_per_m)
        return math.pi * math.sqrt((self.block_mass_kg + self.plate_mass_kg) / series)


KERNEL_ORDER = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
    "velocity_in_m_per_s",
    "plate_displacement_m",
    "plate_velocity_m_per_s",
    "block_mass_kg",
)

PAPER = Collision(
    block_mass_kg=17.85e-3,
    velocity_in_m_per_s=-0.265,
    plate_stiffness_n_per_m=221.4,
    plate_mass_kg=1.984e-4,
    contact_stiffness_n_per_m=1e4,
    contact_damping_n_s_per_m=0.4,
)

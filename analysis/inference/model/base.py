"""The base models, the order of their parameters, and start values of a search.

A base model is the paper's two bodies, or one body on a contact spring whose plate does not move.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import numpy as np

from analysis.collision import Collision, Effect, Floats, Infeasible, Variant
from analysis.inference.model.effective_parameters import Point
from analysis.shot import Fit, Motion, plate_count
from levimass import ONE_BODY, PAPER_MODEL

PLATE_NAMES = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
)
BODY_NAMES = PLATE_NAMES[:2]  # parameters that each plate has separately
OWN_NAMES = ("velocity_in_m_per_s", "touch_time_s", "offset_m")
Plates = tuple[tuple[float, float], ...]
# grid of the candidates: plate mass over block mass, contact stiffness over smooth contact's, damping ratio
_MASS_RATIOS = np.geomspace(0.002, 0.1, 7)
_STIFFNESS_RATIOS = np.geomspace(8, 1200, 8)
_DAMPING_RATIOS = (0.04, 0.15, 0.4)
_LOCKED = (0.0, math.inf)  # stiffness and mass of a plate that does not move
PLATES_RELIABLE_CHI2 = 1.5  # chi^2 per sample above which the likeliest plate states absorb missing effects


def named_on_plate(name: str, plate_number: int) -> str:
    """Return a plate parameter's name for a plate: unchanged for the first (0), "plate_2_mass_kg" for the second."""
    return name if plate_number == 0 else name.replace("plate_", f"plate_{plate_number + 1}_", 1)


class Base(ABC):
    """A base model of a collision: the order of its parameters, and the collision that they make.

    Shots on several ``plates`` share the contact.  ``in_kernel`` are the positions of one plate's stiffness and mass
    (two bodies only), then of the contact's parameters, in the order of the kernels.
    """

    __slots__ = ()
    variant: Variant
    plates: int
    in_kernel: ClassVar[tuple[int, ...]]
    plate_moves: ClassVar[bool]

    @property
    def names(self) -> tuple[str, ...]:
        """Get the names of the shared parameters, in the fit's order; those of plates after the first come last."""
        further = (named_on_plate(name, k) for k in range(1, self.plates) for name in BODY_NAMES)
        return (*(PLATE_NAMES[at] for at in self.in_kernel), *further)

    @property
    def further_at(self) -> tuple[int, ...]:
        """Get the indices of the stiffness of each further plate among the shared parameters; its mass follows it."""
        return tuple(range(len(PLATE_NAMES), len(self.names), len(BODY_NAMES)))

    @property
    def contact_at(self) -> slice:
        """Get the indices of contact stiffness and damping among the shared parameters."""
        return slice(2, 4) if self.plate_moves else slice(0, 2)

    @abstractmethod
    def on_plates(self, plates: int) -> "Base":
        """Return the base model for shots on this number of plates."""

    @abstractmethod
    def places(self, plate_number: int) -> tuple[int, ...]:
        """Return the indices of one plate's parameters and the contact's among the shared, in ``in_kernel``'s order."""

    @abstractmethod
    def candidates(self, block_mass_kg: float, smooth_n_per_m: float, velocity_m_per_s: float) -> Iterator[Collision]:
        """Yield a coarse grid of collisions that last as long as one with a spring of stiffness ``smooth_n_per_m``."""

    def allows(self, effect: Effect) -> bool:
        """Return whether an effect can act in addition to this base model."""
        return self.plate_moves or effect.one_body

    def columns(self, plate_number: int) -> dict[str, int]:
        """Return, for a shot on this plate, the position of each base parameter in the order of the kernels."""
        return {self.names[place]: at for place, at in zip(self.places(plate_number), self.in_kernel, strict=True)}

    def collision(
        self,
        shared: Floats,
        velocity_in_m_per_s: float,
        block_mass_kg: float,
        plate: tuple[float, float] = (0.0, 0.0),
        plate_number: int = 0,
    ) -> Collision:
        """Return the collision with these parameters and initial ``plate`` state (m, m/s); Infeasible if invalid."""
        values = [float(shared[place]) for place in self.places(plate_number)]  # all four, or the contact's two
        k_p, m_p, k_n, gamma_n = (*_LOCKED[: self.in_kernel[0]], *values)
        try:
            return Collision(
                block_mass_kg, float(velocity_in_m_per_s), k_p, m_p, k_n, gamma_n, *plate, variant=self.variant
            )
        except ValueError as why:
            raise Infeasible(str(why)) from why

    def shared(self, collision: Collision) -> Floats:
        """Return the shared parameters of a collision on a single plate, in the fit's order."""
        return collision.vector[list(self.in_kernel)]


@dataclass(frozen=True, slots=True)
class TwoBodies(Base):
    """The paper's block and plate, or a variant of their contact.

    Stiffness and mass are per plate: "plate_2_mass_kg" is the second plate's mass.
    """

    variant: Variant
    plates: int = 1
    in_kernel = (0, 1, 2, 3)
    plate_moves = True

    def on_plates(self, plates: int) -> Base:
        return replace(self, plates=plates)

    def places(self, plate_number: int) -> tuple[int, ...]:
        first = (0, *self.further_at)[plate_number]
        return (first, first + 1, 2, 3)

    def candidates(self, block_mass_kg: float, smooth_n_per_m: float, velocity_m_per_s: float) -> Iterator[Collision]:
        mass, v = block_mass_kg, velocity_m_per_s
        for damping, mass_ratio, stiffness_ratio in product(_DAMPING_RATIOS, _MASS_RATIOS, _STIFFNESS_RATIOS):
            plate_mass = mass_ratio * mass
            reduced = mass * plate_mass / (mass + plate_mass)
            contact = stiffness_ratio * smooth_n_per_m
            plate = smooth_n_per_m * (1 + mass_ratio) / max(0.3, 1 - 1 / stiffness_ratio)
            gamma = 2 * damping * np.sqrt(contact * reduced)
            yield Collision(mass, v, plate, plate_mass, contact, gamma, variant=self.variant)


@dataclass(frozen=True, slots=True)
class OneBodyOnContact(Base):
    """One body on a contact's spring and dashpot, whose plate does not move."""

    variant = Variant.PAPER
    plates = 1
    in_kernel = (2, 3)
    plate_moves = False

    def on_plates(self, plates: int) -> Base:
        return self

    def places(self, plate_number: int) -> tuple[int, ...]:
        return (0, 1)

    def candidates(self, block_mass_kg: float, smooth_n_per_m: float, velocity_m_per_s: float) -> Iterator[Collision]:
        for damping in _DAMPING_RATIOS:
            gamma = 2 * damping * np.sqrt(smooth_n_per_m * block_mass_kg)
            yield Collision(block_mass_kg, velocity_m_per_s, *_LOCKED, smooth_n_per_m, gamma)


_BASES: Mapping[str, Base] = {
    PAPER_MODEL: TwoBodies(Variant.PAPER),
    "clamped": TwoBodies(Variant.CLAMPED),
    "no_tension": TwoBodies(Variant.NO_TENSION),
    ONE_BODY: OneBodyOnContact(),
}


def base_named(model: str) -> Base:
    """Return the base model with this name; a ValueError lists the known ones."""
    if model not in _BASES:
        raise ValueError(f"no base model {model!r}; there are {', '.join(_BASES)}")
    return _BASES[model]


@dataclass(frozen=True, slots=True)
class SearchStart:
    """The start of a search: base model, its parameters (b,), and v_i, touch time and offset of each shot (shots, 3).

    ``plates`` are the plates' states at first touch (m, m/s), if known; ``left`` is chi^2 per sample at this point.
    """

    base: Base
    shared: Floats
    own: Floats
    plates: Plates = ()
    left: float = 1.0

    @property
    def point(self) -> Point:
        """Get the parameters as a point without effects."""
        return Point(self.shared, self.own, tuple({} for _ in self.own))


def start_from_fit(fit: Fit, motions: Sequence[Motion]) -> SearchStart:
    """Return the parameters of a fit of ``motions``, without its effects, as the start of a search."""
    base = base_named(fit.model).on_plates(plate_count(motions))
    own = [[s.velocity_in_m_per_s.value, s.touch_time_s.value, s.offset_m.value] for s in fit.shots]
    shared = np.array([fit.parameters[name].value for name in base.names])
    return SearchStart(base, shared, np.array(own), left=fit.reduced_chi2)

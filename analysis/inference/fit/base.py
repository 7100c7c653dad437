"""The base models, the order of their parameters, and start values of a search.

A base model is the paper's two bodies, or one body on a contact spring whose plate does not move.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision import Collision, Floats, Infeasible, Variant
from analysis.inference.fit.effective_parameters import Point
from analysis.shot import Fit, Motion, plate_count
from levimass import BASE_MODELS, DRIVE

_MODELS = {name: model for name, model in BASE_MODELS.items() if name != DRIVE}

PLATE_NAMES = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
)
BODY_NAMES = PLATE_NAMES[:2]  # parameters that each plate has separately
CONTACT_NAMES = PLATE_NAMES[2:]
OWN_NAMES = ("velocity_in_m_per_s", "touch_time_s", "offset_m")
Plates = tuple[tuple[float, float], ...]
PLATES_RELIABLE_CHI2 = 1.5  # chi^2 per sample above which the likeliest plate states absorb missing effects


def named_on_plate(name: str, plate_number: int) -> str:
    """Return a plate parameter's name for a plate: unchanged for the first (0), "plate_2_mass_kg" for the second."""
    return name if plate_number == 0 else name.replace("plate_", f"plate_{plate_number + 1}_", 1)


@dataclass(frozen=True, slots=True)
class Base:
    """A base model: the paper's two bodies, or one body on a contact spring whose plate does not move.

    Shots on several ``plates`` share the contact.  Stiffness and mass are per plate: "plate_2_mass_kg" is the second
    plate's mass.
    """

    variant: Variant
    one_body: bool
    plates: int = 1

    @property
    def names(self) -> tuple[str, ...]:
        """Get the names of the shared parameters, in the fit's order; those of plates after the first come last."""
        if self.one_body:
            return CONTACT_NAMES
        return PLATE_NAMES + tuple(named_on_plate(name, k) for k in range(1, self.plates) for name in BODY_NAMES)

    @property
    def further_at(self) -> tuple[int, ...]:
        """Get the indices of the stiffness of each further plate among the shared parameters; its mass follows it."""
        return tuple(range(len(PLATE_NAMES), len(self.names), len(BODY_NAMES)))

    @property
    def contact_at(self) -> slice:
        """Get the indices of contact stiffness and damping among the shared parameters."""
        first = self.names.index(CONTACT_NAMES[0])
        return slice(first, first + len(CONTACT_NAMES))

    def places(self, plate_number: int) -> tuple[int, ...]:
        """Return the indices of one plate's stiffness and mass (two bodies only), then of the contact's parameters."""
        if self.one_body:
            return (0, 1)
        first = (0, *self.further_at)[plate_number]
        return (first, first + 1, 2, 3)

    def columns(self, plate_number: int) -> dict[str, int]:
        """Return, for a shot on this plate, the position of each base parameter in the order of the kernels."""
        first = 2 if self.one_body else 0
        return {self.names[place]: first + k for k, place in enumerate(self.places(plate_number))}

    def collision(
        self,
        shared: Floats,
        velocity_in_m_per_s: float,
        block_mass_kg: float,
        plate: tuple[float, float] = (0.0, 0.0),
        plate_number: int = 0,
    ) -> Collision:
        """Return the collision with these parameters and initial ``plate`` state (m, m/s); Infeasible if invalid."""
        values = [float(shared[place]) for place in self.places(plate_number)]
        k_p, m_p, k_n, gamma_n = (0.0, math.inf, *values) if self.one_body else values
        try:
            return Collision(
                block_mass_kg, float(velocity_in_m_per_s), k_p, m_p, k_n, gamma_n, *plate, variant=self.variant
            )
        except ValueError as why:
            raise Infeasible(str(why)) from why

    def shared(self, collision: Collision) -> Floats:
        """Return the shared parameters of a collision on a single plate, in the fit's order."""
        return collision.vector[list(self.columns(0).values())]


def base_named(model: str) -> Base:
    """Return the base model with this name; a ValueError lists the known ones."""
    if model not in _MODELS:
        raise ValueError(f"no base model {model!r}; there are {', '.join(_MODELS)}")
    one_body = _MODELS[model].one_body
    return Base(Variant.PAPER if one_body else Variant[model.upper()], one_body)


def base_of(model: str, plates: int) -> Base:
    """Return the base model with this name for a set of shots on this number of plates."""
    base = base_named(model)
    return base if base.one_body else replace(base, plates=plates)


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
    base = base_of(fit.model, plate_count(motions))
    own = [[s.velocity_in_m_per_s.value, s.touch_time_s.value, s.offset_m.value] for s in fit.shots]
    shared = np.array([fit.parameters[name].value for name in base.names])
    return SearchStart(base, shared, np.array(own), left=fit.reduced_chi2)

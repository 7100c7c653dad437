"""The free parameters of an effect: their size, their sign, and where it starts; all from the catalogue."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.model.effects import CATALOGUE
from analysis.model.effects.row import Effect


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """One parameter: search coordinate is value / ``size``, or its logarithm; ``of_shot``: every shot has its own.

    ``low`` and ``high`` keep the value physical.
    """

    name: str
    size: float
    low: float = -np.inf
    high: float = np.inf
    logarithmic: bool = False
    of_shot: bool = False

    def to_search(self, value: float) -> float:
        """Return the search coordinate of a value."""
        return float(np.log(max(value, 1e-300))) if self.logarithmic else value / self.size

    def to_value(self, z: float) -> float:
        """Return the value at a search coordinate."""
        return float(np.exp(min(z, 700.0))) if self.logarithmic else z * self.size

    def slope(self, z: float) -> float:
        """Return d value / d z."""
        return self.to_value(z) if self.logarithmic else self.size

    @property
    def bounds(self) -> tuple[float, float]:
        """Get the bounds in search coordinates."""
        if self.logarithmic:
            return float(np.log(max(self.low, 1e-300))), float(np.log(self.high))
        return self.low / self.size, self.high / self.size


@dataclass(frozen=True, slots=True)
class TrialEffect:
    """An effect as the diagnosis tries it: its free parameters, and the values of them that it may start from.

    ``amplitude`` names those in which the displacement is linear while the effect is small; the others are laid on a
    grid.  ``starts`` are complete sets of values.
    """

    name: str
    free_parameters: tuple[FreeParameter, ...]
    amplitude: tuple[str, ...]
    starts: tuple[Mapping[str, float], ...]
    one_body: bool = True  # has a meaning where the plate does not move
    inverse: bool = False  # is the smaller the larger its first amplitude is

    @property
    def shared(self) -> tuple[FreeParameter, ...]:
        """Get the free parameters that all shots share."""
        return tuple(free for free in self.free_parameters if not free.of_shot)

    @property
    def own(self) -> tuple[FreeParameter, ...]:
        """Get the free parameters that every shot has for itself."""
        return tuple(free for free in self.free_parameters if free.of_shot)


def trial_effect(row: Effect) -> TrialEffect:
    """Return a row of the catalogue as it is searched."""
    free = [parameter for parameter in row.parameters if not parameter.fixed]
    axes = [parameter.tried or parameter.grid or (parameter.scale,) for parameter in row.parameters]
    names = [parameter.name for parameter in row.parameters]
    return TrialEffect(
        name=row.name,
        free_parameters=tuple(
            FreeParameter(p.name, 1.0 if p.logarithmic else p.scale or 1.0, p.lower, p.upper, p.logarithmic, p.own)
            for p in free
        ),
        amplitude=tuple(p.name for p in free) if row.own else (row.amplitude,),
        starts=tuple(dict(zip(names, values, strict=True)) for values in itertools.product(*axes)),
        one_body=row.one_body,
        inverse=row.inverse,
    )


def trial_effects() -> Sequence[TrialEffect]:
    """Return the catalogue (EFFECTS.md section 2) as it is searched."""
    return tuple(trial_effect(row) for row in CATALOGUE.values())

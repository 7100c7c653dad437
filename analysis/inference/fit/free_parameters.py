"""The parameters of an effect that a fit moves: scale, sign and start values, all from the catalogue."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from analysis.collision import CATALOGUE, Effect, Parameter, named


@dataclass(frozen=True, slots=True)
class TrialEffect:
    """An effect as a diagnosis tries it: its free parameters and the values from which they may start.

    ``amplitude`` names parameters in which the displacement is linear while the effect is small; the others are tried
    on a grid.  ``starts`` are complete sets of values.
    """

    name: str
    free_parameters: tuple[Parameter, ...]
    amplitude: tuple[str, ...]
    starts: tuple[Mapping[str, float], ...]
    one_body: bool = True  # has a meaning where the plate does not move
    inverse: bool = False  # the effect is inversely proportional to its first amplitude (a mass)

    @property
    def shared(self) -> tuple[Parameter, ...]:
        """Get the free parameters that all shots share."""
        return tuple(free for free in self.free_parameters if not free.own)

    @property
    def own(self) -> tuple[Parameter, ...]:
        """Get the free parameters that every shot has for itself."""
        return tuple(free for free in self.free_parameters if free.own)


def trial_effect(row: Effect) -> TrialEffect:
    """Return a row of the catalogue in the form in which it is searched."""
    free = [parameter for parameter in row.parameters if not parameter.fixed]
    axes = [parameter.tried or parameter.grid or (parameter.scale,) for parameter in row.parameters]
    names = [parameter.name for parameter in row.parameters]
    return TrialEffect(
        name=row.name,
        free_parameters=tuple(free),
        amplitude=tuple(p.name for p in free) if row.own else (row.amplitude,),
        starts=tuple(dict(zip(names, values, strict=True)) for values in itertools.product(*axes)),
        one_body=row.one_body,
        inverse=row.inverse,
    )


def trials_named(names: Iterable[str]) -> tuple[TrialEffect, ...]:
    """Return effects by name in the form in which they are searched; keys of ``laws.own`` are names, too."""
    return tuple(trial_effect(named(name)) for name in names)


def trial_effects(laws: Iterable[str] = ()) -> Sequence[TrialEffect]:
    """Return all effects of the catalogue, then the ``laws`` of these keys (``laws.own``), as they are searched."""
    rows = (*CATALOGUE.values(), *(named(key) for key in dict.fromkeys(laws)))
    return tuple(trial_effect(row) for row in rows)

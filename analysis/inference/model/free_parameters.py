"""The free parameters of an effect in a fit: scale, sign and start values, all from the catalogue."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from analysis.collision import CATALOGUE, Effect, Parameter


@dataclass(frozen=True, slots=True)
class TrialEffect:
    """An effect in the form in which it is fitted: its free parameters and their start values.

    ``amplitude`` names the parameters in which the displacement of a small effect is linear; the others start on a
    grid.  ``starts`` are complete sets of values.
    """

    effect: Effect
    free_parameters: tuple[Parameter, ...]
    amplitude: tuple[str, ...]
    starts: tuple[Mapping[str, float], ...]
    inverse: bool = False  # the effect is inversely proportional to its first amplitude (a mass)

    @property
    def shared(self) -> tuple[Parameter, ...]:
        """Get the free parameters that all shots share."""
        return tuple(free for free in self.free_parameters if not free.own)

    @property
    def own(self) -> tuple[Parameter, ...]:
        """Get the free parameters that differ per shot."""
        return tuple(free for free in self.free_parameters if free.own)

    def fixed_in(self, start: Mapping[str, float]) -> Mapping[str, float]:
        """Return those values of a start that are not fitted."""
        names = {free.name for free in self.free_parameters}
        return {name: value for name, value in start.items() if name not in names}

    def times(self, values: Mapping[str, float], factor: float) -> Mapping[str, float]:
        """Return the values for ``factor`` times the effect's strength, to first order."""
        factor = 1 / factor if self.inverse else factor
        return {**values, **{name: values[name] * factor for name in self.amplitude}}


def trial_effect(row: Effect) -> TrialEffect:
    """Return the trial effect of a row of the catalogue."""
    free = [parameter for parameter in row.parameters if not parameter.fixed]
    axes = [parameter.tried or parameter.grid or (parameter.scale,) for parameter in row.parameters]
    names = [parameter.name for parameter in row.parameters]
    return TrialEffect(
        effect=row,
        free_parameters=tuple(free),
        amplitude=tuple(p.name for p in free) if row.own else (row.amplitude,),
        starts=tuple(dict(zip(names, values, strict=True)) for values in itertools.product(*axes)),
        inverse=row.inverse,
    )


def trials_of(effects: Iterable[Effect]) -> tuple[TrialEffect, ...]:
    """Return the trial effects of these effects."""
    return tuple(map(trial_effect, effects))


def trial_effects(further: Iterable[Effect] = ()) -> Sequence[TrialEffect]:
    """Return the trial effects of the whole catalogue, then of ``further`` effects, each once."""
    return trials_of(dict.fromkeys((*CATALOGUE.values(), *further)))

"""The effects accepted into the model: those of the collision, and those of a driven slider, which is another rig."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from analysis.collision.laws.own import is_law
from app.words.physics_words import known_effect


@dataclass(frozen=True, slots=True)
class ModelEffects:
    """Names of the catalogue, in the order in which they were accepted."""

    collision: tuple[str, ...] = ()
    drive: tuple[str, ...] = ()
    tried: tuple[str, ...] = ()  # those of both that no diagnosis named

    def of(self, base: str) -> tuple[str, ...]:
        """Return the effects in the model of shots with this base."""
        return self.drive if base == "driven" else self.collision

    def with_effects(self, base: str, effects: tuple[str, ...]) -> "ModelEffects":
        """Return the same with other effects for shots with this base."""
        changed = replace(self, **{"drive" if base == "driven" else "collision": effects})
        there = (*changed.collision, *changed.drive)
        return replace(changed, tried=tuple(name for name in self.tried if name in there))

    def trying(self, names: Iterable[str]) -> "ModelEffects":
        """Return the same with these marked as tried."""
        return replace(self, tried=(*self.tried, *(name for name in names if name not in self.tried)))


def known_effects(names: Iterable[object]) -> tuple[str, ...]:
    """Return those of the names that the catalogue still has, and the laws that can be read from theirs."""
    return tuple(name for name in names if isinstance(name, str) and (known_effect(name) or is_law(name)))

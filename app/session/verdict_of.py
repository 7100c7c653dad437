"""The effects in a session's model, its diagnoses, and what each verdict was passed on."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from analysis.collision.effects import findings
from analysis.collision.laws.own import is_law
from analysis.diagnosis.result import Diagnosis, Verdict
from app.session.event import Diagnosed
from app.words.physics_words import known_effect


@dataclass(frozen=True, slots=True)
class VerdictOf:
    """``effects`` were in the model that was diagnosed, ``found`` are what the diagnosis adds; ``shots`` by number.

    ``conclusion`` is None where an earlier version kept the verdict.
    """

    effects: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    shots: tuple[int, ...] = ()
    conclusion: Verdict | None = None

    def holds(self, effects: Iterable[str], there: Collection[int]) -> bool:
        """Return whether the verdict still holds for a model with these effects and a list with these shots.

        It does too once what was found is in the model: the diagnosis fitted that very model.
        """
        now, before = set(findings(tuple(effects))), set(self.effects)
        return now in (before, before | set(self.found)) and set(self.shots) <= set(there)


def verdict_of(diagnosis: Diagnosis, numbers: Iterable[int]) -> VerdictOf:
    """Return what the verdict of a diagnosis of these shots was passed on."""
    found = tuple(effect.name for effect in diagnosis.findings)
    return VerdictOf(tuple(findings(diagnosis.fit_before.effects)), found, tuple(numbers), diagnosis.verdict)


class Diagnoses(list[Diagnosed]):
    """Finds the one that a selection is about."""

    @property
    def newest(self) -> Diagnosed | None:
        """Get the newest diagnosis."""
        return self[-1] if self else None

    def of(self, numbers: Sequence[int]) -> Diagnosed | None:
        """Return the newest diagnosis of just these entries, else of some with the last of them, or None."""
        newest = self[::-1]
        exact = next((found for found in newest if set(found.numbers) == set(numbers)), None)
        return exact or next((found for found in newest if set(numbers[-1:]) & set(found.numbers)), None)

    def within(self, chosen: set[int]) -> Diagnosed | None:
        """Return the newest diagnosis of which every entry is among these, or None."""
        return next((found for found in self[::-1] if set(found.numbers) <= chosen), None)


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

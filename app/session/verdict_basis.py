"""The effects in a session's model, its diagnoses, and the model and shots to which each verdict refers."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from analysis.collision import Effect, without_nuisances
from analysis.diagnosis import Diagnosis, Verdict, effect_in_file
from analysis.shot import Shot
from app.words import verdict_words
from levimass import base_model


@dataclass(frozen=True, slots=True)
class VerdictBasis:
    """A verdict, and the model and shots to which it refers.

    ``effects`` were in the diagnosed model, ``found`` were added by the diagnosis, ``shots`` are numbers of entries.
    """

    effects: tuple[Effect, ...]
    found: tuple[Effect, ...]
    shots: tuple[int, ...]
    conclusion: Verdict

    @property
    def words(self) -> str:
        return verdict_words(self.conclusion, self.found)

    def is_valid(self, effects: Iterable[Effect], there: Collection[int]) -> bool:
        """Return whether the verdict is valid for a model with these effects and a session with the shots ``there``.

        It remains valid once all effects found are in the model, because the diagnosis fitted that model too.
        """
        now, before = set(without_nuisances(effects)), set(self.effects)
        return now in (before, before | set(self.found)) and set(self.shots) <= set(there)


def verdict_of(diagnosis: Diagnosis, numbers: Iterable[int]) -> VerdictBasis:
    """Return the model and shots to which a diagnosis refers."""
    found = tuple(finding.effect for finding in diagnosis.findings)
    return VerdictBasis(without_nuisances(diagnosis.fit_before.effects), found, tuple(numbers), diagnosis.verdict)


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A diagnosis and the numbers of the diagnosed entries, in the order of its fits."""

    diagnosis: Diagnosis
    numbers: tuple[int, ...]
    version: str = ""  # program version of a cached result, else ""


def diagnose_shots(
    shots: Sequence[Shot],
    accepted: Sequence[Effect],
    laws: Sequence[Effect],
    seconds: float,
    **watched: Any,  # progress and cancelled
) -> Diagnosis:
    """Diagnose these shots jointly; after ``seconds`` the alternative searches are omitted."""
    from analysis.diagnosis import diagnose  # slow to import

    return diagnose(shots, accepted=accepted, laws=laws, seconds=seconds, **watched)


class Diagnoses(list[Diagnosed]):
    """The diagnoses of a session, oldest first."""

    @property
    def newest(self) -> Diagnosed | None:
        return self[-1] if self else None

    def of(self, numbers: Sequence[int]) -> Diagnosed | None:
        """Return the newest diagnosis of exactly these entries, else the newest that includes the last one, or None."""
        newest = self[::-1]
        exact = next((found for found in newest if set(found.numbers) == set(numbers)), None)
        return exact or next((found for found in newest if set(numbers[-1:]) & set(found.numbers)), None)

    def within(self, chosen: set[int]) -> Diagnosed | None:
        """Return the newest diagnosis whose entries are all among these, or None."""
        return next((found for found in self[::-1] if set(found.numbers) <= chosen), None)


@dataclass(frozen=True, slots=True)
class ModelEffects:
    """The effects in the model, in the order in which they were accepted."""

    collision: tuple[Effect, ...] = ()
    drive: tuple[Effect, ...] = ()
    tried: tuple[Effect, ...] = ()  # effects in the model that no diagnosis found

    def of(self, base: str) -> tuple[Effect, ...]:
        """Return the effects in the model of shots with this base model."""
        return self.collision if base_model(base).collides else self.drive

    def with_effects(self, base: str, effects: tuple[Effect, ...], tried: Iterable[Effect] = ()) -> "ModelEffects":
        """Return a copy with other effects for shots with this base model; those ``tried`` are marked."""
        changed = replace(self, **{"collision" if base_model(base).collides else "drive": effects})
        there = (*changed.collision, *changed.drive)
        marked = dict.fromkeys((*self.tried, *tried))
        return replace(changed, tried=tuple(effect for effect in marked if effect in there))


def known_effects(keys: Iterable[str], base: str) -> tuple[Effect, ...]:
    """Return the effects with these keys in a session file, without effects unknown to this version."""
    found = (effect_in_file(key, base) for key in keys)
    return tuple(effect for effect in found if effect is not None)

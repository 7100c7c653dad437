"""Which model and which shots a verdict was passed on: with another model or fewer shots it no longer holds."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from analysis.collision.effects import findings
from analysis.diagnosis.result import Diagnosis, Verdict


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

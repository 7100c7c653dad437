"""What a diagnosis says; the form others read is in docs/formats.md."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Effect, OwnLaw
from analysis.shot import Fit, Quantity, to_json

Floats = NDArray[np.float64]


class Verdict(StrEnum):
    """What a diagnosis may conclude."""

    ADEQUATE = "adequate"  # nothing is missing that this data could show
    EFFECT_FOUND = "effect_found"  # the effects account for the remainder down to the noise
    LAW_LEARNED = "law_learned"  # a law off the catalogue, learned from the shots, does (with the effects beside it)
    PARTLY_EXPLAINED = "partly_explained"  # the effects foretell better, a significant remainder stays and is described
    UNEXPLAINED = "unexplained"  # nothing passed every test or foretells better, a significant remainder stays


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean squares of what a model leaves over, on stated samples at a stated bandwidth."""

    displacement_rms_m: float
    velocity_rms_m_per_s: float
    force_rms_n: float
    reduced_chi2: float


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """An effect that passed every gate, or the class it lies in when another cannot be told from it."""

    effect: Effect
    parameters: Mapping[str, Quantity]
    evidence: Mapping[str, float]
    indistinguishable_from: tuple[Effect, ...] = ()
    sentence: str = ""

    @property
    def name(self) -> str:
        """Get the effect's name."""
        return self.effect.name


@dataclass(frozen=True, slots=True)
class OtherForm:
    """A closed form that the shots cannot exclude; ``delta_bic`` behind the best.

    ``curve_force_n`` is its curve at the law's ``curve_argument``, shape (n,), where it is of the same argument.
    """

    where: str
    argument: str
    form: str
    formula: str
    delta_bic: float
    curve_force_n: Floats | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the form as the result file has it."""
        names = ("where", "argument", "form", "formula", "delta_bic")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, slots=True)
class LearnedLaw:
    """A law off the catalogue as the shots show it (docs/closed-loop.md).

    ``effect`` is what the model holds.  ``form`` and ``formula`` are None where no closed form meets
    the curve; ``nearest_form`` is what the model holds then.  The curve, arrays of shape (n,), is the free one with its
    standard uncertainty, moved onto the form by what the base model holds already; ``parameters`` are (quantity, unit)
    by name.
    """

    effect: OwnLaw
    where: str
    argument: str
    form: str | None
    formula: str | None
    nearest_form: str
    parameters: Mapping[str, tuple[Quantity, str]]
    other_forms: tuple[OtherForm, ...]
    same_by_gauge: tuple[str, ...]
    curve_argument: Floats
    curve_unit: str
    curve_force_n: Floats
    curve_std_n: Floats
    visited: tuple[float, float]
    not_observable: tuple[str, ...]
    evidence: Mapping[str, float]
    form_force_n: Floats  # of ``nearest_form``, as the model holds it

    @property
    def as_effect(self) -> FoundEffect:
        """Get the law as an effect that can join the model."""
        return FoundEffect(self.effect, {name: q for name, (q, _) in self.parameters.items()}, self.evidence)

    def to_json(self) -> dict[str, Any]:
        """Return the law as the result file has it."""
        return {
            "where": self.where,
            "argument": self.argument,
            "form": self.form,
            "formula": self.formula,
            "nearest_form": self.nearest_form,
            "parameters": {
                name: {"value": q.value, "std": q.std, "unit": unit} for name, (q, unit) in self.parameters.items()
            },
            "other_forms": [other.to_json() for other in self.other_forms],
            "same_by_gauge": list(self.same_by_gauge),
            "curve": {
                "argument": self.curve_argument.tolist(),
                "unit": self.curve_unit,
                "force_n": self.curve_force_n.tolist(),
                "std_n": self.curve_std_n.tolist(),
            },
            "visited": list(self.visited),
            "not_observable": list(self.not_observable),
            "evidence": dict(self.evidence),
        }


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that was tried, with what it would have explained and why it was or was not named.

    ``explains_m`` is the displacement by which the model with it would differ, refitted, in m: one array of shape (k,)
    for each of the first shots, means over k equal parts of the record.  It is to first order where the effect was only
    scored (``delta_bic`` None).  None where there is none; the result file does not have it.
    """

    effect: Effect
    score: float
    delta_bic: float | None
    parameters: Mapping[str, Quantity] = field(default_factory=dict)
    remark: str = ""
    explains_m: tuple[Floats, ...] | None = field(default=None, compare=False, repr=False)

    @property
    def name(self) -> str:
        """Get the effect's name."""
        return self.effect.name


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Verdict with its evidence; ``sentence`` is for a person, ``blind_spots`` is what this data could not show.

    ``effects`` and ``laws`` passed every gate for their size; ``imitated_by`` are effects that come near to what
    remains and did not: their numbers are those of a fit, and no measurement.
    """

    verdict: Verdict
    sentence: str
    effects: tuple[FoundEffect, ...]
    candidates: tuple[Candidate, ...]
    error_before: Errors
    error_after: Errors
    error_held_out_before: Errors | None
    error_held_out_after: Errors | None
    fit_before: Fit
    fit_after: Fit
    remainder: str = ""  # what is left, described for a physicist
    blind_spots: tuple[str, ...] = ()
    separating_shot: str = ""
    seconds: float = 0.0
    laws: tuple[LearnedLaw, ...] = ()
    imitated_by: tuple[FoundEffect, ...] = ()
    not_asked: tuple[str, ...] = ()  # what a limit of time left out, in words

    @property
    def findings(self) -> tuple[FoundEffect, ...]:
        """Get what can join the model: the effects, and the laws that have a form."""
        return (*self.effects, *(law.as_effect for law in self.laws if law.form is not None))


def diagnosis_result(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the ``diagnosis`` object of the result file."""

    def errors(value: Errors | None) -> dict[str, float] | None:
        return None if value is None else asdict(value)

    def quantities(parameters: Mapping[str, Quantity]) -> dict[str, Any]:
        return {name: to_json(quantity) for name, quantity in parameters.items()}

    return {
        "verdict": diagnosis.verdict.value,
        "sentence": diagnosis.sentence,
        "effects": [
            {
                "name": effect.name,
                "parameters": quantities(effect.parameters),
                "evidence": dict(effect.evidence),
                "indistinguishable_from": [other.name for other in effect.indistinguishable_from],
                "sentence": effect.sentence,
            }
            for effect in diagnosis.effects
        ],
        "laws": [law.to_json() for law in diagnosis.laws],
        "imitated_by": [
            {
                "name": effect.name,
                "parameters": {name: {"value": quantity.value} for name, quantity in effect.parameters.items()},
            }
            for effect in diagnosis.imitated_by
        ],
        "candidates": [
            {
                "name": candidate.name,
                "score": candidate.score,
                "delta_bic": candidate.delta_bic,
                "parameters": quantities(candidate.parameters),
                "remark": candidate.remark,
            }
            for candidate in diagnosis.candidates
        ],
        "error_before": errors(diagnosis.error_before),
        "error_after": errors(diagnosis.error_after),
        "error_held_out_before": errors(diagnosis.error_held_out_before),
        "error_held_out_after": errors(diagnosis.error_held_out_after),
        "remainder": diagnosis.remainder,
        "blind_spots": list(diagnosis.blind_spots),
        "separating_shot": diagnosis.separating_shot,
        "seconds": diagnosis.seconds,
        "not_asked": list(diagnosis.not_asked),
    }

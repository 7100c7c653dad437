"""What a diagnosis says; the form others read is in docs/formats.md."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from analysis.fit import Fit
from analysis.quantity import Quantity, to_json


class Verdict(StrEnum):
    """What a diagnosis may conclude."""

    ADEQUATE = "adequate"  # nothing is missing that this data could show
    EFFECT_FOUND = "effect_found"  # the effects account for the remainder down to the noise
    PARTLY_EXPLAINED = "partly_explained"  # the effects foretell better, a significant remainder stays and is described
    UNEXPLAINED = "unexplained"  # nothing foretells better, a significant remainder stays


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

    name: str
    parameters: Mapping[str, Quantity]
    evidence: Mapping[str, float]
    indistinguishable_from: tuple[str, ...] = ()
    sentence: str = ""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that was tried, with what it would have explained and why it was or was not named."""

    name: str
    score: float
    delta_bic: float | None
    parameters: Mapping[str, Quantity] = field(default_factory=dict)
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Verdict with its evidence; ``sentence`` is for a person, ``blind_spots`` is what this data could not show."""

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


def to_result(diagnosis: Diagnosis) -> dict[str, Any]:
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
                "indistinguishable_from": list(effect.indistinguishable_from),
                "sentence": effect.sentence,
            }
            for effect in diagnosis.effects
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
    }

"""Convert a diagnosis and the test of a saved model to JSON objects of the result file (docs/formats.md)."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from analysis.diagnosis.findings.result import Diagnosis, Errors, PredictionTest
from analysis.diagnosis.findings.wording import in_words, prediction_words, remark_on
from analysis.shot import Quantity, to_json


def diagnosis_result(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the ``diagnosis`` object of the result file."""

    def errors(value: Errors | None) -> dict[str, float] | None:
        return None if value is None else asdict(value)

    def quantities(parameters: Mapping[str, Quantity]) -> dict[str, Any]:
        return {name: to_json(quantity) for name, quantity in parameters.items()}

    said = in_words(diagnosis)
    return {
        "verdict": diagnosis.verdict.value,
        "sentence": said.sentence,
        "effects": [
            {
                "name": effect.name,
                "parameters": quantities(effect.parameters),
                "evidence": dict(effect.evidence),
                "indistinguishable_from": [other.name for other in effect.indistinguishable_from],
                "sentence": sentence,
            }
            for effect, sentence in zip(diagnosis.effects, said.effects, strict=True)
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
                "remark": remark_on(candidate),
            }
            for candidate in diagnosis.candidates
        ],
        "error_before": errors(diagnosis.error_before),
        "error_after": errors(diagnosis.error_after),
        "error_held_out_before": errors(diagnosis.error_held_out_before),
        "error_held_out_after": errors(diagnosis.error_held_out_after),
        "remainder": said.remainder,
        "blind_spots": list(said.blind_spots),
        "separating_shot": said.separating_shot,
        "seconds": diagnosis.seconds,
        "not_asked": list(diagnosis.not_asked),
    }


def prediction_test_result(foretold: PredictionTest) -> dict[str, Any]:
    """Return the ``foretold`` object of the result file."""
    return {
        "model": foretold.model,
        "effects": [effect.key for effect in foretold.effects],
        "error_base": asdict(foretold.error_base),
        "error_model": asdict(foretold.error_model),
        "sentence": prediction_words(foretold),
        "shots": [asdict(shot) for shot in foretold.shots],
    }

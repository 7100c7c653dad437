"""Describe a diagnosis or the test of a saved model in words, for result file, window, reports and scripts.

No module that decides a verdict imports this one or the sentence modules that it uses.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.diagnosis.findings import driven_words, words
from analysis.diagnosis.findings.result import Candidate, Diagnosis, PredictionTest, Standing


@dataclass(frozen=True, slots=True)
class Wording:
    """A diagnosis in words; ``effects`` has a sentence for each of its effects."""

    sentence: str
    effects: tuple[str, ...]
    remainder: str
    blind_spots: tuple[str, ...]
    separating_shot: str


def in_words(diagnosis: Diagnosis) -> Wording:
    """Put a diagnosis into words."""
    drive = diagnosis.drive
    if drive is None:
        return Wording(
            words.sentence(diagnosis),
            tuple(map(words.found, diagnosis.effects)),
            words.remainder(diagnosis.remainder),
            words.blind_spots(diagnosis),
            words.separating_shot(diagnosis),
        )
    return Wording(
        driven_words.sentence(diagnosis, drive),
        tuple(driven_words.effect(found, diagnosis.fit_after) for found in diagnosis.effects),
        driven_words.remainder(diagnosis.error_after.force_rms_n, drive),
        driven_words.blind_spots(drive),
        driven_words.separating(diagnosis.effects, drive),
    )


_STANDINGS = {
    Standing.IN_MODEL: "among the effects found",
    Standing.SCORED_ONLY: "scored to first order only",
    Standing.DOES_NOT_PAY: "BIC not lowered",
    Standing.BEHIND_ANOTHER: "another candidate fits better",
    Standing.VALIDATED: "force error {number:.3g} N on the validation half",
    Standing.MIXTURE: "not identifiable: in this motion it is a linear combination of effects in the model",
    Standing.RESCALES: "not identifiable: without a stated mass it only rescales mass, drag and friction",
    Standing.MASS_AGREES: "the stated mass agrees",
    Standing.MASS_DIFFERS: "the same as a mass of {number} kg",
}


def remark_on(candidate: Candidate) -> str:
    """Say why a tried effect is or is not in the model."""
    return "" if candidate.standing is None else _STANDINGS[candidate.standing].format(number=candidate.number)


def prediction_words(foretold: PredictionTest) -> str:
    """Say how much better the whole model predicts than its base."""
    base, model = foretold.error_base, foretold.error_model
    count = sum(shot.error_model is not None for shot in foretold.shots)
    driven = not np.isfinite(model.displacement_rms_m)
    before, after = (e.force_rms_n if driven else 1e6 * e.displacement_rms_m for e in (base, model))
    unit = "N" if driven else "µm"
    share = 1.0 - after / before if before > 0.0 else -math.inf
    how = "better" if share > 0.0 else "worse"
    better = f"predicted {how} by {abs(share):.0%}" if math.isfinite(share) else f"predicted {how}"
    shots = f"{count} shot{'' if count == 1 else 's'}"
    return f"{better}: {after:.3g} {unit} rms against {before:.3g} {unit} of the base model, over {shots}"

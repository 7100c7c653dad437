from .diagnosis_of_shots import diagnose
from .evidence.identifiability import separation
from .evidence.prediction_errors import evaluate_predictions
from .findings.criteria import CRITERIA
from .findings.model_file import ModelFileError, SavedModel, drift, effect_in_file, from_text, saved, to_text
from .findings.result import Candidate, Diagnosis, Errors, FoundEffect, LearnedLaw, PredictionTest, Verdict
from .findings.result_file import diagnosis_result, prediction_test_result
from .findings.wording import in_words, prediction_words, remark_on
from .findings.words import EQUIVALENT_EFFECTS
from .search.competing_models import fitted_instead
from .search.forward_selection import Trail, without
from .verdict.indistinguishable import per_shot_cost

__all__ = [
    "CRITERIA",
    "EQUIVALENT_EFFECTS",
    "Candidate",
    "Diagnosis",
    "Errors",
    "FoundEffect",
    "LearnedLaw",
    "ModelFileError",
    "PredictionTest",
    "SavedModel",
    "Trail",
    "Verdict",
    "diagnose",
    "diagnosis_result",
    "drift",
    "effect_in_file",
    "evaluate_predictions",
    "fitted_instead",
    "from_text",
    "in_words",
    "per_shot_cost",
    "prediction_test_result",
    "prediction_words",
    "remark_on",
    "saved",
    "separation",
    "to_text",
    "without",
]

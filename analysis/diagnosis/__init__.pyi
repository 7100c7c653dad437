from .diagnosis_of_shots import diagnose
from .model_file import ModelFileError, SavedModel, drift, effect_in_file, from_text, saved, to_text
from .result import Candidate, Diagnosis, Errors, FoundEffect, LearnedLaw, Verdict
from .result_file import diagnosis_result, prediction_test_result
from .search.competing_models import fitted_instead
from .search.forward_selection import Trail, without
from .verdict.criteria import CRITERIA
from .verdict.identifiability import separation
from .verdict.indistinguishable import per_shot_cost
from .verdict.prediction_errors import PredictionTest, evaluate_predictions
from .wording import in_words, prediction_words, remark_on
from .words import EQUIVALENT_EFFECTS

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

from .diagnosis_of_shots import diagnose
from .model_file import ModelFileError, SavedModel, drift, effect_in_file, from_text, saved, to_text
from .result import Candidate, Diagnosis, Errors, FoundEffect, LearnedLaw, Verdict
from .result_file import diagnosis_result, foretold_result
from .search.competing_models import fitted_instead
from .search.forward_selection import Trail, without
from .verdict.coincidence import unforetold
from .verdict.criteria import CRITERIA
from .verdict.identifiability import separation
from .verdict.prediction_errors import Foretold, foretell
from .wording import in_words, prediction_words, remark_on
from .words import ONE_WITH_TWO_READINGS

__all__ = [
    "CRITERIA",
    "ONE_WITH_TWO_READINGS",
    "Candidate",
    "Diagnosis",
    "Errors",
    "Foretold",
    "FoundEffect",
    "LearnedLaw",
    "ModelFileError",
    "SavedModel",
    "Trail",
    "Verdict",
    "diagnose",
    "diagnosis_result",
    "drift",
    "effect_in_file",
    "fitted_instead",
    "foretell",
    "foretold_result",
    "from_text",
    "in_words",
    "prediction_words",
    "remark_on",
    "saved",
    "separation",
    "to_text",
    "unforetold",
    "without",
]

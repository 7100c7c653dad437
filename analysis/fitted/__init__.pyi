from .fit_time import SECONDS, FitTime, run_in_time
from .fitted_shot import (
    ReadingsModel,
    awaits_fit,
    can_be_fitted,
    fit_again,
    fit_jointly,
    in_words,
    read_together,
    readings_model,
    readings_model_result,
    shaking_of,
    unfitted,
    with_fit_to_follow,
)
from .readings_from_fit import contact_cor, fitted_contact_cor

__all__ = [
    "SECONDS",
    "FitTime",
    "ReadingsModel",
    "awaits_fit",
    "can_be_fitted",
    "contact_cor",
    "fit_again",
    "fit_jointly",
    "fitted_contact_cor",
    "in_words",
    "read_together",
    "readings_model",
    "readings_model_result",
    "run_in_time",
    "shaking_of",
    "unfitted",
    "with_fit_to_follow",
]

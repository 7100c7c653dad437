from .fit_time import FIT_SECONDS, FitTime, run_with_time_limit
from .fitted_shot import (
    ReadingsModel,
    can_be_fitted,
    fit_jointly,
    fit_pending,
    fit_shot,
    read_together,
    readings_model,
    readings_model_result,
    unfitted,
    vibration_of,
    with_fit_pending,
)
from .readings_from_fit import contact_cor, fitted_contact_cor

__all__ = [
    "FIT_SECONDS",
    "FitTime",
    "ReadingsModel",
    "can_be_fitted",
    "contact_cor",
    "fit_jointly",
    "fit_pending",
    "fit_shot",
    "fitted_contact_cor",
    "read_together",
    "readings_model",
    "readings_model_result",
    "run_with_time_limit",
    "unfitted",
    "vibration_of",
    "with_fit_pending",
]

from .bandwidth import force_noise
from .catalogue import GAIN_ERROR, LAWS, laws_named
from .curves import DriveCurves, drive_curves
from .driven_fit import (
    MassCheck,
    as_fit,
    check_mass,
    chi2,
    filtered_noise_n,
    fit_driven,
    prediction_residual_n,
)
from .law_search import LawSearch, Split, Trial, look_alikes, search_laws
from .regression import NonlinearValues, Regression, regress, rms
from .repeatability import Repeatability, repeatability_of
from .stretch import Mask, Table, prepare

__all__ = [
    "GAIN_ERROR",
    "LAWS",
    "DriveCurves",
    "LawSearch",
    "Mask",
    "MassCheck",
    "NonlinearValues",
    "Regression",
    "Repeatability",
    "Split",
    "Table",
    "Trial",
    "as_fit",
    "check_mass",
    "chi2",
    "drive_curves",
    "filtered_noise_n",
    "fit_driven",
    "force_noise",
    "laws_named",
    "look_alikes",
    "prediction_residual_n",
    "prepare",
    "regress",
    "repeatability_of",
    "rms",
    "search_laws",
]

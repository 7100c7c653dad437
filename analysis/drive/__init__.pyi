from .bandwidth import force_noise
from .catalogue import GAIN_ERROR, LAWS, laws_named
from .curves import DriveCurves, drive_curves
from .driven_fit import (
    MassCheck,
    as_fit,
    check_mass,
    filtered_noise_n,
    fit_accepted,
    fit_driven,
    prediction_residual_n,
)
from .law_screening import CandidateLaws, project_out, screen_laws
from .regression import Regression, equations, least_squares, regress, rms
from .repeatability import Repeatability, folds, repeatability_of
from .stretch import Table, prepare

__all__ = [
    "GAIN_ERROR",
    "LAWS",
    "CandidateLaws",
    "DriveCurves",
    "MassCheck",
    "Regression",
    "Repeatability",
    "Table",
    "as_fit",
    "check_mass",
    "drive_curves",
    "equations",
    "filtered_noise_n",
    "fit_accepted",
    "fit_driven",
    "folds",
    "force_noise",
    "laws_named",
    "least_squares",
    "prediction_residual_n",
    "prepare",
    "project_out",
    "regress",
    "repeatability_of",
    "rms",
    "screen_laws",
]

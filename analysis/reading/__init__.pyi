from .pulse import SLOPE_SPAN, SMOOTH_HZ
from .read import NoImpact, read_frame_motion, read_impact
from .record_checks import check_collision, describe_motion, describe_reversal
from .restricted_likelihood import (
    Bands,
    Curvature,
    Likelihood,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
)
from .site import CENTRES_HZ, CRITERIA_M_PER_S, MIN_S, PlannedShot, SiteFloor, read_site

__all__ = [
    "CENTRES_HZ",
    "CRITERIA_M_PER_S",
    "MIN_S",
    "SLOPE_SPAN",
    "SMOOTH_HZ",
    "Bands",
    "Curvature",
    "Likelihood",
    "NoImpact",
    "PlannedShot",
    "RestrictedLikelihood",
    "ShotResidual",
    "SiteFloor",
    "chain_precision",
    "check_collision",
    "describe_motion",
    "describe_reversal",
    "mixture_covariance",
    "points_about",
    "read_frame_motion",
    "read_impact",
    "read_site",
]

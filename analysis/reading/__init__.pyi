from .pulse import SLOPE_SPAN
from .read import NoImpact, read_impact, shaking_in
from .record_checks import check_collision, where_it_went, why_reversed
from .restricted_likelihood import (
    Curvature,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
    root_of,
)
from .site import CENTRES_HZ, CRITERIA_M_PER_S, LEAST_S, PlannedShot, SiteFloor, read_site

__all__ = [
    "CENTRES_HZ",
    "CRITERIA_M_PER_S",
    "LEAST_S",
    "SLOPE_SPAN",
    "Curvature",
    "NoImpact",
    "PlannedShot",
    "RestrictedLikelihood",
    "ShotResidual",
    "SiteFloor",
    "chain_precision",
    "check_collision",
    "mixture_covariance",
    "points_about",
    "read_impact",
    "read_site",
    "root_of",
    "shaking_in",
    "where_it_went",
    "why_reversed",
]

from .pulse import SLOPE_SPAN
from .read import NoImpact, read_impact, shaking_in
from .record_checks import check_collision, where_it_went, why_reversed
from .site import CENTRES_HZ, CRITERIA_M_PER_S, LEAST_S, PlannedShot, SiteFloor, read_site

__all__ = [
    "CENTRES_HZ",
    "CRITERIA_M_PER_S",
    "LEAST_S",
    "SLOPE_SPAN",
    "NoImpact",
    "PlannedShot",
    "SiteFloor",
    "check_collision",
    "read_impact",
    "read_site",
    "shaking_in",
    "where_it_went",
    "why_reversed",
]

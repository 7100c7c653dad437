from .restricted_likelihood import (
    Curvature,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
    root_of,
)

__all__ = [
    "Curvature",
    "RestrictedLikelihood",
    "ShotResidual",
    "chain_precision",
    "mixture_covariance",
    "points_about",
    "root_of",
]

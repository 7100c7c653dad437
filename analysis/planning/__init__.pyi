from .model_comparison import refit_diagnosed
from .next_shot import (
    ADDED_KG,
    MAX_SHOTS,
    SPEEDS_M_PER_S,
    NextShot,
    Reach,
    contact_s,
    first_indistinguishable,
    mass_without_weights_kg,
    shots_in_words,
)
from .precision import plan_precision
from .shot_log import PlannedStep, PlanningState, next_step, plan_next

__all__ = [
    "ADDED_KG",
    "MAX_SHOTS",
    "SPEEDS_M_PER_S",
    "NextShot",
    "PlannedStep",
    "PlanningState",
    "Reach",
    "contact_s",
    "first_indistinguishable",
    "mass_without_weights_kg",
    "next_step",
    "plan_next",
    "plan_precision",
    "refit_diagnosed",
    "shots_in_words",
]

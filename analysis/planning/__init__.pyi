from .model_comparison import refit_diagnosed
from .next_shot import (
    ADDED_KG,
    MOST_SHOTS,
    SPEEDS_M_PER_S,
    NextShot,
    Reach,
    as_found_kg,
    contact_s,
    shots_in_words,
    undecided,
)
from .precision import plan_precision
from .shot_log import PlannedStep, PlanningState, next_step, plan_next

__all__ = [
    "ADDED_KG",
    "MOST_SHOTS",
    "SPEEDS_M_PER_S",
    "NextShot",
    "PlannedStep",
    "PlanningState",
    "Reach",
    "as_found_kg",
    "contact_s",
    "next_step",
    "plan_next",
    "plan_precision",
    "refit_diagnosed",
    "shots_in_words",
    "undecided",
]

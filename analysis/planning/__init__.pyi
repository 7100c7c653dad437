from .model_comparison import refit_diagnosed
from .next_shot import ADDED_KG, MOST_SHOTS, SPEEDS_M_PER_S, NextShot, Reach, as_found_kg, contact_s, undecided
from .plan_words import plan_sentence, shots, with_words
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
    "plan_sentence",
    "refit_diagnosed",
    "shots",
    "undecided",
    "with_words",
]

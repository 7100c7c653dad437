from .fit.added_effect import refit, times, with_both_effects
from .fit.arrow import Arrow, orthonormal
from .fit.as_fit import as_fit, effect_parameters
from .fit.base import OWN_NAMES, PLATE_NAMES, SearchStart, base_named, start_from_fit
from .fit.base_fit import base_fit, nuisances_pay, slow_enough, white_of
from .fit.course import Course
from .fit.derivatives import linearised_shot, solved
from .fit.effective_parameters import Point, to_actual, to_effective
from .fit.first_fit import first_fit
from .fit.first_guesses import first_guesses
from .fit.free_parameters import TrialEffect, trial_effect, trial_effects, trials_of
from .fit.hypothesis import Hypothesis
from .fit.hypothesis_fit import (
    Fitted,
    finish,
    first_floor,
    fit_hypothesis,
    lead_on,
    learn_floor,
    residuals,
    search,
    square_of,
    under_likely_noises,
)
from .fit.least_squares import Square, covariance, damped_step, minimise
from .fit.profile import with_profile_std
from .fit.response import Response
from .fit.samples import FINE_RATE_HZ, RATE_HZ, Samples, averaged_shot, averaged_shots
from .fit.search_vector import JointData
from .fit.shot_fit import fit_shots
from .fit.with_effect import joined
from .noise.floor import Floor, white_floor
from .noise.joint_data import joint_data, shakings_of, site_under, with_plates
from .noise.own_flights import own_flights
from .noise.site import Site, on_site, resembles_frame_motion
from .screen.columns import fixed_of, moved_to, shown_with
from .screen.projector import Projector, projector
from .screen.screening import Score, all_scores, distinct_starts, scores

__all__ = [
    "FINE_RATE_HZ",
    "OWN_NAMES",
    "PLATE_NAMES",
    "RATE_HZ",
    "Arrow",
    "Course",
    "Fitted",
    "Floor",
    "Hypothesis",
    "JointData",
    "Point",
    "Projector",
    "Response",
    "Samples",
    "Score",
    "SearchStart",
    "Site",
    "Square",
    "TrialEffect",
    "all_scores",
    "as_fit",
    "averaged_shot",
    "averaged_shots",
    "base_fit",
    "base_named",
    "covariance",
    "damped_step",
    "distinct_starts",
    "effect_parameters",
    "finish",
    "first_fit",
    "first_floor",
    "first_guesses",
    "fit_hypothesis",
    "fit_shots",
    "fixed_of",
    "joined",
    "joint_data",
    "lead_on",
    "learn_floor",
    "linearised_shot",
    "minimise",
    "moved_to",
    "nuisances_pay",
    "on_site",
    "orthonormal",
    "own_flights",
    "projector",
    "refit",
    "resembles_frame_motion",
    "residuals",
    "scores",
    "search",
    "shakings_of",
    "shown_with",
    "site_under",
    "slow_enough",
    "solved",
    "square_of",
    "start_from_fit",
    "times",
    "to_actual",
    "to_effective",
    "trial_effect",
    "trial_effects",
    "trials_of",
    "under_likely_noises",
    "white_floor",
    "white_of",
    "with_both_effects",
    "with_plates",
    "with_profile_std",
]

from .fit.added_effect import refit, times, united
from .fit.arrow import Arrow, orthonormal
from .fit.as_fit import as_fit, effect_parameters
from .fit.base import OWN_NAMES, PLATE_NAMES, base_named
from .fit.base_fit import base_fit, pays_along, slow_enough, white_of
from .fit.begin import Begin, begin_of
from .fit.derivatives import linearised_shot, solved
from .fit.effective_parameters import Point, to_actual, to_effective
from .fit.first_fit import first_fit
from .fit.first_guesses import first_guesses
from .fit.free_parameters import TrialEffect, trial_effect, trial_effects, trials_named
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
)
from .fit.least_squares import Square, covariance, damped_step, minimise
from .fit.likely_noises import under_likely_noises
from .fit.profile import with_profile_std
from .fit.response import Response
from .fit.samples import FINE_RATE_HZ, RATE_HZ, Samples, take, together
from .fit.search_vector import JointData
from .fit.shot_fit import fit_shots
from .fit.starts import Course
from .fit.with_effect import joined
from .noise.floor import Floor, white_floor
from .noise.joint_data import joint_data, shakings_of, site_under, with_plates
from .noise.own_flights import own_flights
from .noise.site import Site, may_be_of_a_site, on_site
from .screen.columns import fixed_of, moved_to, shown_with
from .screen.projector import Projector, projector
from .screen.screening import Score, all_scores, apart, scores

__all__ = [
    "FINE_RATE_HZ",
    "OWN_NAMES",
    "PLATE_NAMES",
    "RATE_HZ",
    "Arrow",
    "Begin",
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
    "Site",
    "Square",
    "TrialEffect",
    "all_scores",
    "apart",
    "as_fit",
    "base_fit",
    "base_named",
    "begin_of",
    "covariance",
    "damped_step",
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
    "may_be_of_a_site",
    "minimise",
    "moved_to",
    "on_site",
    "orthonormal",
    "own_flights",
    "pays_along",
    "projector",
    "refit",
    "residuals",
    "scores",
    "search",
    "shakings_of",
    "shown_with",
    "site_under",
    "slow_enough",
    "solved",
    "square_of",
    "take",
    "times",
    "to_actual",
    "to_effective",
    "together",
    "trial_effect",
    "trial_effects",
    "trials_named",
    "under_likely_noises",
    "united",
    "white_floor",
    "white_of",
    "with_plates",
    "with_profile_std",
]

from .fit.added_effect import joined, refit, with_both_effects
from .fit.as_fit import as_fit, effect_parameters
from .fit.first_fit import base_fit, first_fit
from .fit.first_guesses import first_guesses
from .fit.least_squares import free_to_move
from .fit.problem import Fitted, Linearised, Problem
from .fit.profile import with_profile_std
from .fit.relinearised_frame import with_frame_relinearised
from .fit.shot_fit import fit_shots
from .joint.joint_data import JointData, frame_motions_of, joint_data, site_under
from .model.arrow import Arrow, orthonormal
from .model.base import OWN_NAMES, PLATE_NAMES, SearchStart, base_named, start_from_fit
from .model.effective_parameters import Point, to_physical
from .model.free_parameters import TrialEffect, trial_effect, trial_effects, trials_of
from .model.normal_matrix import NormalMatrix
from .model.samples import FINE_RATE_HZ, RATE_HZ, Samples, averaged_shots
from .noise.floor import Floor, white_floor
from .noise.per_shot_acceleration import per_shot_nuisances
from .noise.site import STILL_FRAME, Site
from .noise.sway import on_site, with_plates
from .screen.screening import Score, distinct_starts, opposite

__all__ = [
    "FINE_RATE_HZ",
    "OWN_NAMES",
    "PLATE_NAMES",
    "RATE_HZ",
    "STILL_FRAME",
    "Arrow",
    "Fitted",
    "Floor",
    "JointData",
    "Linearised",
    "NormalMatrix",
    "Point",
    "Problem",
    "Samples",
    "Score",
    "SearchStart",
    "Site",
    "TrialEffect",
    "as_fit",
    "averaged_shots",
    "base_fit",
    "base_named",
    "distinct_starts",
    "effect_parameters",
    "first_fit",
    "first_guesses",
    "fit_shots",
    "frame_motions_of",
    "free_to_move",
    "joined",
    "joint_data",
    "on_site",
    "opposite",
    "orthonormal",
    "per_shot_nuisances",
    "refit",
    "site_under",
    "start_from_fit",
    "to_physical",
    "trial_effect",
    "trial_effects",
    "trials_of",
    "white_floor",
    "with_both_effects",
    "with_frame_relinearised",
    "with_plates",
    "with_profile_std",
]

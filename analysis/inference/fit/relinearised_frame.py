"""Refit with the response to frame motion relinearised about the fitted motion.

The earlier response was computed before an effect was added, with base parameters biased by the missing effect.  The
response also depends on effects that act on the motion, and its linear form fails if the plate swings far.
"""

from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible
from analysis.inference.fit.first_fit import likeliest_plates
from analysis.inference.fit.problem import Fitted
from analysis.inference.model.base import Plates
from analysis.inference.noise.sway import on_site
from analysis.shot import Stop

_MATTERS = 0.02  # error of the response, over the white noise, above which the fit is repeated
_FAR = 0.6  # plate stds from the linearisation point, below which the linear response is adequate
_TURNS = 8  # maximum number of iterations of plates and fit; each moves plates by up to about two stds
_NOTHING = 1.0  # change of the criterion below which an iteration is the last
_SURE = 2  # iterations after which each must improve the criterion


def with_frame_relinearised(fitted: Fitted, stop: Stop) -> Fitted:
    """Return the fit, repeated until it agrees with its frame response; three shots: 0.05 s, 0.2 s per repetition."""
    here, site = fitted, fitted.problem.data.site
    if not site.moves:
        return here
    for turn in range(_TURNS):
        data = here.problem.data
        plates, moved = _plates(here)
        before = data.shots
        try:
            shots = on_site(before, site, data.base, here.point, plates if moved >= _FAR else ())
        except Infeasible:
            break
        pairs = zip(before, shots, strict=True)
        off_m = max(old.sway.largest_difference_m(new.sway, here.noise) for old, new in pairs if old.sway and new.sway)
        if moved < _FAR and off_m < _MATTERS * here.noise.white_m:
            break
        there = replace(here.problem, data=replace(data, shots=shots)).fit(here.z, cancelled=stop)
        gained = here.bic - there.bic
        if turn >= _SURE and gained <= 0.0:  # the plates are absorbing an effect that is still missing
            break
        here = there
        if abs(gained) < _NOTHING:
            break
    return here


def _plates(fitted: Fitted) -> tuple[Plates, float]:
    """Return each plate's likeliest state at first touch given the residual, and the largest change in stds."""
    plates = likeliest_plates(fitted.problem, fitted.z)
    pairs = zip(fitted.problem.data.shots, plates, strict=True)
    moves = [np.subtract(plate, shot.plate) / shot.sway.plate_std for shot, plate in pairs if shot.sway]
    return plates, float(np.max(np.abs(moves)))

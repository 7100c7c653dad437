"""A fit with the response to the frame's motion computed anew for the motion that the fit gives.

The response was computed for shots without a missing effect, which had shifted base parameters; it depends on effects
that act on the motion, and is linear in the plate's swing, which a plate that swings far is not.
"""

from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible
from analysis.inference.fit.joint_data import with_plates
from analysis.inference.fit.problem import Fitted
from analysis.inference.noise.sway import on_site
from analysis.shot import Stop

_MATTERS = 0.02  # of the white noise: that the response is wrong by
_FAR = 0.6  # of a plate's std: nearer to where it was taken to be, straight lines will do
_TURNS = 8  # of plates and fit at most: each goes some two stds towards plates that were taken for what was missing
_NOTHING = 1.0  # of the criterion: what a turn may change that is the last
_SURE = 2  # turns, after which each must make the shots likelier


def on_frame_anew(fitted: Fitted, stop: Stop) -> Fitted:
    """Return the fit, itself where the frame's response is right; cost: 0.05 s, 0.2 s more a turn for three shots."""
    here, site = fitted, fitted.problem.data.site
    if site is None:
        return here
    for turn in range(_TURNS):
        data = here.problem.data
        plates, moved = _plates(here)
        before = data.shots
        try:
            shots = on_site(with_plates(before, plates) if moved >= _FAR else before, site, data.base, here.point)
        except Infeasible:
            break
        pairs = zip(before, shots, strict=True)
        off_m = max(old.sway.apart_m(new.sway, here.noise) for old, new in pairs if old.sway and new.sway)
        if moved < _FAR and off_m < _MATTERS * here.noise.white_m:
            break
        there = replace(here.problem, data=replace(data, shots=shots)).fit(here.z, cancelled=stop)
        gained = here.bic - there.bic
        if turn >= _SURE and gained <= 0.0:  # the plates run away with what is still missing
            break
        here = there
        if abs(gained) < _NOTHING:
            break
    return here


def _plates(fitted: Fitted) -> tuple[list[tuple[float, float]], float]:
    """Return each shot's plate at first touch by the fit's residual, and the largest change in standard deviations."""
    plates, moved = [], 0.0
    for shot, left in zip(fitted.problem.data.shots, fitted.residual_m, strict=True):
        assert shot.sway is not None
        plate = shot.sway.likely_plate(left, fitted.noise)
        moved = max(moved, float(np.max(np.abs(np.subtract(plate, shot.plate) / shot.sway.plate_std))))
        plates.append(plate)
    return plates, moved

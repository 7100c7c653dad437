"""Is there a ripple that the averaged samples do not show?

An interferometer's periodic error turns once or twice a fringe, and the block passes a hundred thousand fringes a
second: only near the turn is it slow enough for samples averaged to 20 kS/s.  A weak one is seen at the record's rate
alone, and a strong one is measured twice as well there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision.effects import named
from analysis.diagnosis.search.forward_selection import Trail, polish, prune
from analysis.inference.fit.added_effect import refit
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis import JointData
from analysis.inference.fit.hypothesis_fit import Fitted, fit, learn_floor, residuals
from analysis.inference.fit.samples import FINE_RATE_HZ, together
from analysis.inference.noise.joint_data import with_plates
from analysis.inference.noise.site import on_site
from analysis.inference.screen.projector import projector
from analysis.inference.screen.screening import scores
from analysis.shot.motion import Motion
from analysis.shot.shot import Stop

_MATTERS = 0.02  # of the white noise: that the site's directions are wrong by
_FAR = 0.6  # of a plate's std: nearer to where it was taken to be, straight lines will do
_TURNS = 2  # of plates and fit


def seen_finely(best: Fitted, trail: Trail, motions: Sequence[Motion]) -> tuple[Fitted, Trail] | None:
    """Return the best fit and its trail at the record's rate (100 kS/s at most) if that shows a ripple, else None.

    What else is there was found at the averaged samples' rate.
    """
    ripple = next((kind for kind in trail.catalogue if named(kind.name).ripples), None)
    here = best.hypothesis.data
    if ripple is None or ripple.name in trail.start.names or any(shot.wavelength_m is None for shot in here.shots):
        return None
    shots = together(motions, FINE_RATE_HZ)
    if shots[0].factor == here.shots[0].factor:
        return None
    shots = with_plates(shots, [shot.plate for shot in here.shots])
    data = replace(here, shots=on_site(shots, here.site, here.base, best.point.base, best.point.own))
    if ripple.name in best.names:
        finest: Fitted | None = _at(best, data, trail.stop)
    else:
        finest = _with(ripple, best, data, trail)
    if finest is None:
        return None
    return _anew(finest, trail)


def swayed_from_there(best: Fitted, trail: Trail) -> tuple[Fitted, Trail]:
    """Return the best fit and its trail with the site's directions, and the plates, as they are where the fit ended.

    What an effect does had drawn the base parameters with which the directions were computed, and a plate that swings
    far does not act as far along them as they say.  A frame shakes bodies that are straight lines: those of the fit,
    or those that come nearest to it without the effect (of a plate that stiffens with its deflection), as is likelier.
    """
    for _ in range(_TURNS):
        here, start = best.hypothesis.data, trail.start
        if here.site is None or best is start:
            break
        parameters = float(np.max(np.abs(best.point.base / start.point.base - 1.0)))
        plates, moved = _plates(best)
        apart = parameters * here.site.shaking.rms_m >= _MATTERS * best.floor.white_m
        if not apart and moved < _FAR:
            break
        shots = with_plates(here.shots, plates)
        bodies = (best.point.base, start.point.base) if apart else (best.point.base,)
        swayed = [on_site(shots, here.site, here.base, base, best.point.own) for base in bodies]
        fits = [_at(best, replace(here, shots=each), trail.stop) for each in swayed]
        best, trail = _anew(min(fits, key=lambda fitted: fitted.bic), trail)
    return best, trail


def _plates(fitted: Fitted) -> tuple[list[tuple[float, float]], float]:
    """Return each shot's plate at first touch as the fit leaves it, and the most that moved, over its std."""
    plates, moved, floor = [], 0.0, fitted.floor
    for shot, left in zip(fitted.hypothesis.data.shots, fitted.residual_m, strict=True):
        assert shot.sway is not None
        plate = shot.sway.likely_plate(left, floor)
        moved = max(moved, float(np.max(np.abs(np.subtract(plate, shot.plate) / shot.sway.plate_std))))
        plates.append(plate)
    return plates, moved


def _anew(best: Fitted, trail: Trail) -> tuple[Fitted, Trail]:
    """Return the best fit, which knows other data of the same shots, with a trail of these."""
    anew = Trail(_at(trail.start, best.hypothesis.data, trail.stop), trail.catalogue, trail.stop, trail.scores)
    anew.keep(best)
    return polish(prune(best, anew), anew), anew


def _at(fitted: Fitted, data: JointData, stop: Stop) -> Fitted:
    return fit(replace(fitted.hypothesis, data=data), fitted.z, fitted.floor, cancelled=stop)


def _with(ripple: TrialEffect, best: Fitted, data: JointData, trail: Trail) -> Fitted | None:
    """Return the fit with a ripple, at the rig's rate, where it promises to pay, else None."""
    hypothesis = replace(best.hypothesis, data=data)
    left = residuals(hypothesis, best.z)
    floor, value = learn_floor(data, left, best.floor)
    at = projector(replace(best, hypothesis=hypothesis, residual_m=left, floor=floor, log_likelihood=value))
    listed = scores(at, ripple)
    if not listed or listed[0].worth(at.left.size) < trail.least_fall(floor):
        return None
    return refit(at, ripple, listed[0].start, trail.stop)

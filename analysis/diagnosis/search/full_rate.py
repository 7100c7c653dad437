"""Fits of other data of the same shots: at the record's own rate, and with the response to a site computed anew.

An interferometer's periodic error turns once or twice a fringe, and the block passes a hundred thousand fringes a
second: only near the turn is it slow enough for samples averaged to 20 kS/s.  A weak one is seen at the record's rate
alone, and a strong one is measured twice as well there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible
from analysis.diagnosis.search.forward_selection import Trail, polish, prune, without
from analysis.inference import (
    FINE_RATE_HZ,
    Fitted,
    JointData,
    Linearised,
    Samples,
    TrialEffect,
    averaged_shots,
    on_site,
    refit,
    with_plates,
)
from analysis.shot import Motion, Stop

_MATTERS = 0.02  # of the white noise: that the site's directions are wrong by
_FAR = 0.6  # of a plate's std: nearer to where it was taken to be, straight lines will do
_TURNS = 2  # of plates and fit


def at_full_rate(best: Fitted, trail: Trail, motions: Sequence[Motion]) -> tuple[Fitted, Trail] | None:
    """Return the best fit and its trail at the record's rate (100 kS/s at most) if that shows a ripple, else None.

    All other effects were found at the rate of the averaged samples.
    """
    ripple = next((kind for kind in trail.catalogue if kind.effect.ripples), None)
    here = best.problem.data
    if ripple is None or ripple.effect in trail.start.effects or any(shot.wavelength_m is None for shot in here.shots):
        return None
    shots = averaged_shots(motions, FINE_RATE_HZ)
    if shots[0].factor == here.shots[0].factor:
        return None
    shots = with_plates(shots, [shot.plate for shot in here.shots])
    bare = best if ripple.effect not in best.effects else without(best, ripple.effect, trail)
    if bare is None or not _promises(ripple, bare, shots, trail):
        return None
    data = replace(here, shots=on_site(shots, here.site, here.base, bare.point))
    at = _beside(bare, data)
    listed = at.scores(ripple)
    finest = refit(at, ripple, listed[0].start, trail.stop) if listed else None
    return None if finest is None else _anew(finest, trail)


def with_sway_updated(best: Fitted, trail: Trail) -> tuple[Fitted, Trail]:
    """Return the best fit and its trail with the response to the site's motion computed anew where the fit ended.

    The response was computed for shots without the missing effect, which had shifted base parameters, and is linear in
    the plate's swing, which a plate that swings far is not.
    """
    here, site = best, best.problem.data.site
    if site is None or best is trail.start:
        return best, trail
    for _ in range(_TURNS):
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
        here = _at(here, replace(data, shots=shots), trail.stop)
    return (best, trail) if here is best else _anew(here, trail)


def _plates(fitted: Fitted) -> tuple[list[tuple[float, float]], float]:
    """Return each shot's plate at first touch by the fit's residual, and the largest change in standard deviations."""
    plates, moved, floor = [], 0.0, fitted.noise
    for shot, left in zip(fitted.problem.data.shots, fitted.residual_m, strict=True):
        assert shot.sway is not None
        plate = shot.sway.likely_plate(left, floor)
        moved = max(moved, float(np.max(np.abs(np.subtract(plate, shot.plate) / shot.sway.plate_std))))
        plates.append(plate)
    return plates, moved


def _anew(best: Fitted, trail: Trail) -> tuple[Fitted, Trail]:
    """Return the best fit, which is of other data of the same shots, with a trail of these data."""
    anew = replace(trail, start=_at(trail.start, best.problem.data, trail.stop), fits={}, asked=set())
    anew.keep(best)
    return polish(prune(best, anew), anew), anew


def _at(fitted: Fitted, data: JointData, stop: Stop) -> Fitted:
    return replace(fitted.problem, data=data).fit(fitted.z, cancelled=stop)


def _promises(ripple: TrialEffect, best: Fitted, fine: Sequence[Samples], trail: Trail) -> bool:
    """Return whether a ripple promises to pay at the record's rate.

    A building is slow and a ripple quick: the frame's most likely motion is taken off first.
    """
    here = best.problem.data
    still = []
    for shot, coarse, left_m in zip(fine, here.shots, best.residual_m, strict=True):
        moved_m = left_m - coarse.without_frame_motion(best.noise, left_m)
        if coarse.sway is not None and any(coarse.plate):
            moved_m = moved_m - coarse.sway.of_plate_m(coarse.plate)
        at_valid = np.interp(shot.centre_s, coarse.centre_s[coarse.valid], moved_m[coarse.valid])
        still.append(replace(shot, displacement_m=shot.displacement_m - at_valid))
    at = _beside(best, replace(here, shots=tuple(still), site=None))
    listed = at.scores(ripple)
    return bool(listed) and listed[0].worth(at.left.size) >= trail.least_fall(best.noise)


def _beside(best: Fitted, data: JointData) -> Linearised:
    """Return a fit linearised over other data of the same shots, the noise learnt from its residual there."""
    problem = replace(best.problem, data=data)
    start = best.noise if data.site is not None else best.noise.without_site
    noise, _ = problem.learn_noise(problem.residual_m(best.z), start)
    return problem.with_noise(noise).linearise(best.z)

"""Refit the same shots at the record's own sample rate, or with the response to frame motion recomputed.

An interferometer's periodic error has one or two cycles per fringe, and the block passes a hundred thousand fringes
per second.  Samples averaged to 20 kS/s resolve it only near the turnaround, where the block is slow.  A weak ripple is
visible only at the record's rate, and a strong one is measured twice as well there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.diagnosis.search.forward_selection import Trail, converge, prune, without
from analysis.inference import (
    FINE_RATE_HZ,
    STILL_FRAME,
    Fitted,
    JointData,
    Linearised,
    Samples,
    TrialEffect,
    averaged_shots,
    on_site,
    refit,
    with_frame_relinearised,
    with_plates,
)
from analysis.shot import Motion, Stop


def at_full_rate(best: Fitted, trail: Trail, motions: Sequence[Motion]) -> tuple[Fitted, Trail] | None:
    """Refit at the record's rate (100 kS/s at most) if ripple shows there; return best fit and trail, else None.

    All other effects were found at the rate of the averaged samples.
    """
    ripple = next((kind for kind in trail.catalogue if kind.effect.needs_full_rate), None)
    here = best.problem.data
    if ripple is None or ripple.effect in trail.start.effects or any(shot.wavelength_m is None for shot in here.shots):
        return None
    shots = averaged_shots(motions, FINE_RATE_HZ)
    if shots[0].factor == here.shots[0].factor:
        return None
    shots = with_plates(shots, tuple(shot.plate for shot in here.shots))
    bare = best if ripple.effect not in best.effects else without(best, ripple.effect, trail)
    if bare is None or not _promises(ripple, bare, shots, trail):
        return None
    data = replace(here, shots=on_site(shots, here.site, here.base, bare.point))
    at = _beside(bare, data)
    listed = at.scores(ripple)
    finest = refit(at, ripple, listed[0].start, trail.stop) if listed else None
    return None if finest is None else _anew(finest, trail)


def with_frame_response_updated(best: Fitted, trail: Trail) -> tuple[Fitted, Trail]:
    """Recompute the response to frame motion along the fitted motion; return the best fit and its trail."""
    here = best if best is trail.start else with_frame_relinearised(best, trail.stop)
    return (best, trail) if here is best else _anew(here, trail)


def _anew(best: Fitted, trail: Trail) -> tuple[Fitted, Trail]:
    """Return the best fit, which was made on other data of the same shots, with a new trail on these data."""
    anew = replace(trail, start=_at(trail.start, best.problem.data, trail.stop), fits={}, removed_from_bic={})
    anew.keep(best)
    return converge(prune(best, anew), anew), anew


def _at(fitted: Fitted, data: JointData, stop: Stop) -> Fitted:
    return replace(fitted.problem, data=data).fit(fitted.z, cancelled=stop)


def _promises(ripple: TrialEffect, best: Fitted, fine: Sequence[Samples], trail: Trail) -> bool:
    """Return whether the score of a ripple at the record's rate is high enough to fit it.

    Frame motion is slow and ripple is fast, so the frame's most likely motion is subtracted first.
    """
    here = best.problem.data
    still = []
    for shot, coarse, left_m in zip(fine, here.shots, best.residual_m, strict=True):
        moved_m = left_m - coarse.without_frame_motion(best.noise, left_m)
        if coarse.sway is not None and any(coarse.plate):
            moved_m = moved_m - coarse.sway.plate_displacement_m(coarse.plate)
        at_valid = np.interp(shot.centre_s, coarse.centre_s[coarse.valid], moved_m[coarse.valid])
        still.append(replace(shot, displacement_m=shot.displacement_m - at_valid))
    at = _beside(best, replace(here, shots=tuple(still), site=STILL_FRAME))
    listed = at.scores(ripple)
    return bool(listed) and listed[0].worth(at.left.size) >= trail.least_fall(best.noise)


def _beside(best: Fitted, data: JointData) -> Linearised:
    """Linearise a fit on other data of the same shots, with the noise learned from its residual there."""
    problem = replace(best.problem, data=data)
    noise, _ = problem.learn_noise(problem.residual_m(best.z), best.noise)
    return problem.with_noise(noise).linearise(best.z)

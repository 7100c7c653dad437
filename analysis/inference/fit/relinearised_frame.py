"""Refit with the response to frame motion relinearised about the fitted motion.

The earlier response was computed before an effect was added, with base parameters biased by the missing effect.  The
response also depends on effects that act on the motion, and its linear form fails if the plate swings far.
"""

from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible
from analysis.inference.fit.first_fit import likeliest_plates
from analysis.inference.fit.problem import Fitted, Problem
from analysis.inference.model.base import Plates
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import Samples
from analysis.inference.noise.sway import Sway, on_site
from analysis.shot import Floats, Stop

_MATTERS = 0.02  # error of the response, over the white noise, above which the fit is repeated
MOST_TURNS = 12  # maximum number of iterations of response and fit
_NOTHING = 1.0  # change of the criterion below which an iteration is the last, if the response is nearly right
_CLOSE = 30.0  # error of the response, over the white noise, below which it is nearly right
_SURE = 2  # iterations after which one that goes on in the same direction must not worsen the criterion
_FAR = 100.0  # second order of the response, over the white noise, above which it matters: up to 50 at VC-A
_UNLIKE = 4.0  # ln of the power that a residual asks for over that in the flights: frames up to 3.0, magnets from 5.7


def with_frame_relinearised(fitted: Fitted, stop: Stop) -> Fitted:
    """Return the fit, repeated until it agrees with its frame response; three shots: 0.05 s, 0.1 s per repetition."""
    return _repeated(fitted, stop)[0]


def frame_hides_effects(fitted: Fitted, stop: Stop) -> bool:
    """Return whether the frame moves so far that the fit does not come to agree with its frame response."""
    return frame_moves_far(fitted.problem) and not _repeated(fitted, stop)[1]


def _repeated(fitted: Fitted, stop: Stop) -> tuple[Fitted, bool]:
    """Return the fit, repeated with the response about its motion, and whether the two came to agree.

    They do not if the frame moves too far for a linear response, or if an effect is missing that the plates absorb.
    """
    here, site = fitted, fitted.problem.data.site
    if not site.moves:
        return here, True
    about: tuple[Point, Plates] | None = None  # of the last linearisation
    last = np.zeros(0)
    for turn in range(MOST_TURNS):
        data = here.problem.data
        there = here.point, likeliest_plates(here.problem, here.z)
        step = _moves(here, about, there)
        turned = False
        if about is not None and float(step @ last) < 0.0:  # full steps would go back and forth
            turned, there, step = True, half_way(about, there), 0.5 * step
        try:
            shots = on_site(data.shots, site, data.base, *there)
        except Infeasible:
            return here, False
        pairs = zip(data.shots, shots, strict=True)
        off_m = max(old.sway.largest_difference_m(new.sway, here.noise) for old, new in pairs if old.sway and new.sway)
        if off_m < _MATTERS * here.noise.white_m:
            return here, True
        anew = replace(here.problem, data=replace(data, shots=shots)).fit(here.z, cancelled=stop)
        gained = here.bic - anew.bic
        if turn >= _SURE and gained <= -_NOTHING and not turned:  # plates absorb an effect that is still missing
            return here, False
        if abs(gained) < _NOTHING and off_m < _CLOSE * here.noise.white_m:
            return anew, True
        here, about, last = anew, there, step
    return here, False


def frame_moves_far(problem: Problem) -> bool:
    """Return whether the frame moves so far in contact that its response is not sure to be linear.

    The second order is about the square of that motion over the plate's deflection.  The motion is taken from the
    flights, since an effect that is missing makes the frame seem to move in contact.  A force that bends the flights is
    mistaken for a frame in them; the residual in contact then asks for a far stronger motion, and this is no frame.
    """
    noise = problem.noise
    if max(noise.site, default=0.0) > _UNLIKE:
        return False

    def over_white(shot: Samples, sway: Sway) -> float:
        course, time_s = shot.course, shot.centre_s[shot.valid]
        touching = (time_s > course.touch_time_s) & (time_s < course.release_time_s)
        if not touching.any():  # lost samples
            return 0.0
        deflection_m = float(np.ptp(shot.displacement_m[shot.valid][touching]))
        return float(np.mean(sway.variances_read_m2()[touching])) / (deflection_m * noise.white_m)

    return any(shot.sway is not None and over_white(shot, shot.sway) > _FAR for shot in problem.data.shots)


def _moves(fitted: Fitted, about: tuple[Point, Plates] | None, there: tuple[Point, Plates]) -> Floats:
    """Return how far parameters and plates are from those of the linearisation, in standard deviations.

    ``about`` is None where the parameters of the linearisation are not known.
    """
    problem = fitted.problem
    pairs = zip(problem.data.shots, there[1], strict=True)
    moves = [np.subtract(plate, shot.plate) / shot.sway.plate_std for shot, plate in pairs if shot.sway]
    off = fitted.z - (fitted.z if about is None else problem.pack(about[0]))
    std = np.sqrt(np.diag(fitted.inverse))
    return np.concatenate([np.divide(off, std, out=np.zeros_like(off), where=std > 0.0), *moves])


def half_way(here: tuple[Point, Plates], there: tuple[Point, Plates]) -> tuple[Point, Plates]:
    """Return the mean of the base parameters and plate states of two points, with the effects of the second."""
    (one, before), (other, after) = here, there
    both = zip(before or after, after, strict=True)
    plates = tuple((0.5 * (x + y), 0.5 * (v + w)) for (x, v), (y, w) in both)
    return Point(0.5 * (one.base + other.base), 0.5 * (one.own + other.own), other.values), plates

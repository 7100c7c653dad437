"""Fit a model to one or several shots, weighted by the noise estimated from their flights.

A diagnosis fits its hypotheses in the same way, but estimates the noise from each residual.  Here the noise comes from
the flights alone, so that chi^2 shows whether the model lacks an effect.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision import MAX_EFFECTS, Effect, Infeasible, effect_named, effects_named, without_nuisances
from analysis.inference.fit.added_effect import joined
from analysis.inference.fit.as_fit import as_fit
from analysis.inference.fit.first_fit import BIASED_CHI2, first_fit, likeliest_plates
from analysis.inference.fit.least_squares import Minimum
from analysis.inference.fit.problem import Fitted, Problem
from analysis.inference.fit.relinearised_frame import MOST_TURNS, frame_moves_far, half_way
from analysis.inference.joint.joint_data import frame_motions_of, joint_data
from analysis.inference.model.base import Plates
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.free_parameters import trial_effect, trials_of
from analysis.inference.model.samples import FINE_RATE_HZ, averaged_shots
from analysis.inference.noise.flights import noise_of_flights
from analysis.inference.noise.site import Site, site_under
from analysis.inference.noise.sway import on_site
from analysis.shot import (
    FRAME_MOVES_FAR,
    PLATE_RINGS,
    AnalysisError,
    Cancelled,
    Fit,
    Floats,
    Motion,
    Stop,
    VibrationSpectrum,
)
from levimass import PAPER_MODEL

_PLATE_MOTION = effect_named("plate_motion")
_EVALUATIONS, _TO_CONTINUE = 60, 120  # limits for a search, and for its continuation if it had not converged
_TOLERANCE = 1e-6  # of chi^2: a thousandth of a standard deviation
_POOR_FIT = 1.15  # reduced chi^2 above which frame motion faster than a building's is tried, as after a knock
_TURNS = 4  # maximum iterations of fit and frame response; MOST_TURNS where that response is not sure to be linear
_SMALL_MOVE = 1.0  # standard deviations of a parameter move that needs no relinearisation
_STRENGTH_TURNS = 3  # maximum iterations of fitting and re-estimating the frame's strengths from the residual
_SETTLED = 0.1  # standard deviations of a parameter move after which the strengths are final
_RINGING = 16.0  # BIC gain above which a plate swinging at first touch is flagged
_MIN_SHARE = 0.7  # least share of the excess chi^2: a ringing plate explains 99 %, another effect at most half


def fit_shots(
    motions: Sequence[Motion],
    *,
    model: str = PAPER_MODEL,
    effects: Sequence[Effect | str] = (),
    cancelled: Stop | None = None,
    vibrations: Sequence[VibrationSpectrum | None] = (),
) -> Fit:
    """Fit base ``model`` and ``effects`` (at most three) to the displacement of ``motions``.

    All shots share contact and effects; shots that state the same plate share that plate.  Each shot has its own speed,
    touch time and offset, and its own effect parameters if the catalogue says so.  ``vibrations`` are the frame motions
    of the shots.  If given, the two-body fit includes that motion in flight and in contact, and the plate may swing
    before the touch by as much as the frame can have driven it.  An effect of the catalogue may be given by its name.
    Raises ValueError for unknown names, NoCollision (an AnalysisError) if a motion shows no collision, AnalysisError if
    no trajectory of the model comes near the shots, Cancelled on request.  If the search did not end in a minimum,
    ``converged`` is False and the numbers are not a result.
    """
    began = time.perf_counter()
    if not motions:
        raise ValueError("no shot to fit")
    chosen = effects_named(effects)
    if len(without_nuisances(chosen)) > MAX_EFFECTS or len(set(chosen)) != len(chosen):
        raise ValueError(f"effects must be at most {MAX_EFFECTS} different ones")
    stop = cancelled or (lambda: False)
    shaken = () if _PLATE_MOTION in chosen else frame_motions_of(motions, model, vibrations)
    site = site_under(motions, shaken, 0.0)
    best = _fit_on(site, motions, model, chosen, stop)
    if site.moves and _POOR_FIT < best.reduced_chi2 < BIASED_CHI2:
        whole = _fit_on(site_under(motions, shaken, 0.0, whole=True), motions, model, chosen, stop)
        best = whole if whole.found.converged and whole.reduced_chi2 < best.reduced_chi2 else best
    return best.as_fit(motions, model, began, stop)


@dataclass(frozen=True, slots=True)
class _SearchEnd:
    """The end of a search under the noise of the flights; ``trusted``: they are long enough for a noise estimate.

    ``undecided``, shape (p,), is an extra standard deviation per parameter, non-zero if the iteration over the frame's
    contribution (``_settled``) did not converge.
    """

    problem: Problem
    found: Minimum
    trusted: bool
    undecided: Floats

    @property
    def reduced_chi2(self) -> float:
        """Get chi^2 per degree of freedom."""
        return self.found.square.chi2 / max(1, self.found.square.samples - self.problem.size)

    def as_fit(self, motions: Sequence[Motion], model: str, began: float, stop: Stop) -> Fit:
        """Return the fit; on a moving frame it is weighted by the noise of the whole shots."""
        problem, found = self.problem, self.found
        fitted = _reweighed(problem, found, stop)
        fitted = replace(fitted, inverse=fitted.inverse + np.outer(self.undecided, self.undecided))
        flags = [f"{name}_at_bound" for name, shot in (problem.names[k] for k in found.at_bound) if shot < 0]
        flags += [] if self.trusted else ["noise_not_known"]
        flags += [PLATE_RINGS] if self._plate_rings(fitted) else []
        flags += [FRAME_MOVES_FAR] if self.undecided.any() and frame_moves_far(problem) else []
        seconds, chi2 = time.perf_counter() - began, found.square.chi2
        return as_fit(fitted, motions, model, seconds, how="fit", by=problem.noise, chi2=chi2, flags=flags)

    def _plate_rings(self, fitted: Fitted) -> bool:
        """Return whether shots fitted with the plate at rest are better described by a plate swinging at first touch.

        The gain is computed by a linear step.  If the swing explains only part of the excess chi^2, another effect is
        missing.  Cost: 5 ms per shot.
        """
        problem, square = self.problem, self.found.square
        if problem.data.site.moves or not self.found.converged or _PLATE_MOTION in fitted.effects:
            return False
        free = square.samples - problem.size
        excess = square.chi2 - free - math.sqrt(2.0 * free)  # beyond one standard deviation of chance
        listed = problem.linearise(fitted.z).scores(trial_effect(_PLATE_MOTION))
        return any(score.worth(square.samples) > _RINGING and score.gain > _MIN_SHARE * excess for score in listed)


def _fit_on(site: Site, motions: Sequence[Motion], model: str, effects: Sequence[Effect], stop: Stop) -> _SearchEnd:
    """Return the end of the search with frame motion ``site``.  Raises AnalysisError and Cancelled."""
    shots = averaged_shots(motions)
    noise, trusted = noise_of_flights(shots, site)
    begin = first_fit(shots, model, site, stop, noise=noise)
    finely = any(effect.needs_full_rate for effect in effects)
    data = joint_data(averaged_shots(motions, FINE_RATE_HZ) if finely else shots, begin, site)
    if finely or data.site is not site:
        noise, trusted = noise_of_flights(data.shots, data.site)
    try:
        problem, found, undecided = _settled(Problem(data, (), noise), begin.point, begin.plates, stop)
        if effects:
            problem, found, undecided = _with_effects(problem, found, effects, stop)
    except Infeasible as why:
        raise AnalysisError(f"no motion of the {model} model comes near these shots: {why}") from why
    return _SearchEnd(problem, found, trusted, undecided)


def _settled(problem: Problem, here: Point, plates: Plates, stop: Stop) -> tuple[Problem, Minimum, Floats]:
    """Return the minimum, searched from ``here``, with the frame's contribution linearised about the fitted motion.

    The last value, shape (p,), is an extra standard deviation per parameter.  It is non-zero if a plate swings so far
    that the iteration between motion and contribution does not converge.
    """
    for turn in range(MOST_TURNS if frame_moves_far(problem) else _TURNS):
        if turn:
            problem = _at_motion(problem, here, plates)
        z = problem.pack(problem.with_softened_contact(here))
        found = _minimum_from(problem, z, stop)
        move = found.parameters - z
        if not problem.data.site.moves or float(move @ (found.square.curvature @ move)) < _SMALL_MOVE**2:
            undecided = np.zeros(z.size)
            break
        undecided = move * math.sqrt(0.5)
        there = problem.unpack(found.parameters)
        swung = likeliest_plates(problem, found.parameters)
        # If a plate swings far, its contribution changes so much that full steps would alternate: go half-way.
        here, plates = half_way((here, plates), (there, swung)) if turn else (there, swung)
    return problem, found, undecided


def _at_motion(problem: Problem, point: Point, plates: Plates) -> Problem:
    """Return the problem with the frame's contribution relinearised about the motion at ``point``."""
    data = problem.data
    shots = on_site(data.shots, data.site, data.base, point, plates)
    return replace(problem, data=replace(data, shots=shots))


def _minimum_from(problem: Problem, z: Floats, stop: Stop, evaluations: int = _EVALUATIONS) -> Minimum:
    found = problem.search(z, evaluations=evaluations, tolerance=_TOLERANCE, cancelled=stop)
    if stop():
        raise Cancelled
    return found


def _with_effects(
    problem: Problem, of_base: Minimum, effects: Sequence[Effect], stop: Stop
) -> tuple[Problem, Minimum, Floats]:
    """Return the minimum with the effects, added one after the other, and the extra uncertainty of ``_settled``."""
    here = problem.fit_once(of_base.parameters, evaluations=1, anew=True, cancelled=stop)
    here = joined(here, trials_of(effects), stop)
    problem, undecided = here.problem.with_noise(problem.noise), np.zeros(here.z.size)
    found = _minimum_from(problem, here.z, stop)
    if problem.data.site.moves:  # the missing effects had biased the plates' likeliest states
        point, plates = problem.unpack(found.parameters), likeliest_plates(problem, found.parameters)
        problem, found, undecided = _settled(_at_motion(problem, point, plates), point, plates, stop)
    if not found.converged:
        found = _minimum_from(problem, found.parameters, stop, _TO_CONTINUE)
    return problem, found, undecided


def _reweighed(problem: Problem, found: Minimum, stop: Stop) -> Fitted:
    """Return the fit; on a moving frame, reweighted by frame strengths estimated from the whole shots.

    The flights determine slow frame motion poorly, and contain no information about a knock during the contact.
    """
    free = np.ones(problem.size, dtype=np.bool_)
    free[[*found.at_bound, *problem.unseen]] = False

    def at(end: Minimum, weighed: Problem) -> Fitted:
        left, known = weighed.residual_m(end.parameters), end.square.curvature.inverse(free)
        inverse = np.full((problem.size, problem.size), math.nan) if known is None else known
        return Fitted(weighed, end.parameters, math.nan, left, inverse, end.converged)

    fitted, strengths = at(found, problem), None
    if not found.converged:
        return fitted
    for _ in range(_STRENGTH_TURNS):
        likely = fitted.likely_strengths(free)
        if likely is None:
            break
        strengths, weighed = likely, problem.with_noise(likely.noise)
        ended = _minimum_from(weighed, fitted.z, stop)
        move = ended.parameters - fitted.z
        fitted = at(ended if ended.converged else found, weighed)
        if float(move @ (ended.square.curvature @ move)) < _SETTLED**2:
            break
    return fitted if strengths is None else fitted.averaged_over(strengths, free)

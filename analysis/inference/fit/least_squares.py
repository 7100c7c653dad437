"""Levenberg-Marquardt minimisation of a sum of squares with exact derivatives and bounds on the parameters."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.collision import Floats, Infeasible
from analysis.inference.model.normal_matrix import Square
from analysis.shot import Stop


@dataclass(frozen=True, slots=True)
class Minimum:
    """The end of a search; ``converged``: the next step would move no parameter by 1e-3 standard deviations.

    A search also counts as converged if rounding hides the effect of steps up to 0.1 standard deviations.  On an edge,
    beyond which chi^2 rises for any step length, it has converged if the next step along the edge is shorter than one
    standard deviation.
    """

    parameters: Floats
    square: Square
    converged: bool
    at_bound: tuple[int, ...] = ()


Function = Callable[[Floats], Square]
Residual = Callable[[Floats], Floats]
StopEarly = Callable[[Floats, Square], bool]
_CORRECTIONS = 6  # maximum number of corrections of one step
_NEAR_ENOUGH = 0.3  # fraction of the predicted fall of chi^2 whose absence is tolerated without further correction
_STEEP = 1e-5  # relative damping: directions with less curvature are not corrected
_LITTLE = 15.0  # predicted fall of chi^2 below which ``stop_early`` is called
_ROUNDED = 1e-2  # predicted fall of chi^2 below which failing steps are due to rounding (noise of 1 pm)
_ON_EDGE = 1.0  # predicted fall of chi^2 along an edge, as at the end of a force's range, that counts as converged
_ACROSS = 1e-2  # fraction of the next step that leads across an edge, if there is one
_MAX_DAMPING = 1e12  # relative damping at which steps vanish
_SHORTER = 0.7  # largest ratio of the next step's length to a refused one's: longer would be refused as well
_STRAIGHT = 1.0  # predicted fall of chi^2 below which a step is too short for corrections


def minimise(
    function: Function,
    start: Floats,
    *,
    bounds: tuple[Floats, Floats] | None = None,
    evaluations: int = 60,
    tolerance: float = 1e-6,
    residual: Residual | None = None,
    stop_early: StopEarly | None = None,
    cancelled: Stop | None = None,
) -> Minimum:
    """Minimise from ``start``, shape (p,), until the predicted further fall of chi^2 is below ``tolerance``.

    ``bounds`` are the least and the largest values, shape (p,) each.  A fall of chi^2 by 1e-6 is a move of 1e-3
    standard deviations.  ``residual`` computes whitened residuals cheaply, without derivatives.  If it is given and the
    squares carry their residual, a long step is corrected until the residual nearly equals its linear prediction,
    before derivatives are computed.  Steps in a curved valley may then be longer (a retraction; Absil, Mahony and
    Sepulchre, "Optimization Algorithms on Matrix Manifolds", ch. 4).  ``stop_early`` is called once, when the predicted
    fall is small; the search stops if it returns True.  ``function`` may raise Infeasible except at the start.
    """
    bounds = bounds or (np.full(start.size, -np.inf), np.full(start.size, np.inf))
    here = np.clip(start, *bounds)
    square = function(here)
    damping = _Damping()
    straight = False
    for _ in range(1, evaluations):
        if cancelled is not None and cancelled():
            break
        free = free_to_move(here, square.gradient, *bounds)
        newton = _Newton.at(square, free)
        if newton.ends_search(here, bounds, tolerance):
            return Minimum(here, square, True, tuple(np.flatnonzero(~free).tolist()))
        if stop_early is not None and newton.promises_less_than(_LITTLE):
            if stop_early(here, square):
                break
            stop_early = None
        way = damping.way(square, here, free, bounds)
        if way is None:
            return Minimum(here, square, newton.promises_less_than(_ROUNDED))
        there, expected = way
        corrected = residual if expected > _STRAIGHT or damping.refused else None
        point, trial = _trial(function, corrected, square, here, there, free, bounds, straight)
        fell = square.chi2 - trial.chi2
        straight = point is there and fell > (1 - _NEAR_ENOUGH) * expected
        if fell > 0:
            here, square = point, trial
            damping.ease(fell / expected)
        elif expected < 1e-12 * square.chi2 + tolerance * 1e-2:  # rounding hides falls below 1e-12 of chi^2
            return Minimum(here, square, _ends_where_no_step_falls(function, square, here, newton, free, bounds))
        else:
            damping.refuse(_length(square, there - here))
    return Minimum(here, square, False)


@dataclass(frozen=True, slots=True)
class _Newton:
    """The undamped step of the free parameters, its predicted fall of chi^2, and the variance that counts as one.

    If the matrix is singular, the step is zero and the predicted fall is -1.
    """

    step: Floats
    promised: float
    unit: float

    @classmethod
    def at(cls, square: Square, free: np.ndarray) -> "_Newton":
        """Return the step from the point of ``square``."""
        unit = max(1.0, square.chi2 / square.samples)
        nowhere = np.zeros(free.size)
        step = _step(square, free, 0.0) if free.any() else nowhere
        return cls(nowhere, -1.0, unit) if step is None else cls(step, float(-step @ square.gradient), unit)

    def promises_less_than(self, fall: float) -> bool:
        """Return whether the predicted fall of chi^2, in units of the variance, is below ``fall``; not if singular."""
        return 0 <= self.promised < fall * self.unit

    def ends_search(self, here: Floats, bounds: tuple[Floats, Floats], tolerance: float) -> bool:
        """Return whether the predicted fall of chi^2 is below ``tolerance``, and the step crosses no bound."""
        low, high = bounds
        there = here + self.step
        return self.promises_less_than(tolerance) and bool(np.all((there >= low) & (there <= high)))


class _Damping:
    """The damping of steps, and the number of further steps over which it falls slowly after a refusal."""

    def __init__(self) -> None:
        self.value = 1e-6  # near Gauss-Newton: curvatures of the base model differ by a factor of a million
        self.refused = 0
        self._too_long = np.inf

    def way(
        self, square: Square, here: Floats, free: np.ndarray, bounds: tuple[Floats, Floats]
    ) -> tuple[Floats, float] | None:
        """Return the end of the next step and its predicted fall of chi^2; None if no damping predicts a fall.

        After a refusal damping is raised until the step is clearly shorter, since small damping only shortens the step
        in directions of low curvature.
        """
        while self.value <= _MAX_DAMPING:
            there = _stepped(square, here, free, self.value, bounds)
            if there is not None and _length(square, there - here) <= _SHORTER * self._too_long:
                moved = there - here
                expected = float(-2 * moved @ square.gradient - moved @ (square.curvature @ moved))
                if expected > 0:
                    return there, expected
            self.value = max(10 * self.value, 1e-9)
        return None

    def ease(self, ratio: float) -> None:
        """Adapt damping after a step with ``ratio`` of the predicted fall; reduce it slowly after a refusal."""
        easing = 0.3 if self.refused else 0.01
        self.value *= easing if ratio > 0.7 else (0.5 if ratio > 0.3 else 4.0)
        self.value = max(self.value, 1e-14)
        self.refused = max(0, self.refused - 1)
        self._too_long = np.inf

    def refuse(self, length: float) -> None:
        """Raise damping after a step of this length raised chi^2."""
        self.refused = 3
        self._too_long = length
        self.value = max(10 * self.value, 1e-9)


def free_to_move(here: Floats, gradient: Floats, low: Floats, high: Floats) -> np.ndarray:
    """Return which parameters may move: all but fixed ones and those pressed against a bound by the gradient."""
    held = (low >= high) | ((here <= low) & (gradient > 0)) | ((here >= high) & (gradient < 0))
    return np.asarray(~held)


def _trial(
    function: Function,
    residual: Residual | None,
    square: Square,
    here: Floats,
    there: Floats,
    free: np.ndarray,
    bounds: tuple[Floats, Floats],
    straight: bool,
) -> tuple[Floats, Square]:
    """Return the point ``there``, corrected if ``residual`` is given, and the square at it; ``here`` if infeasible.

    Also ``here`` if chi^2 has not fallen after the corrections: the step will be refused, and its derivatives are not
    needed.  If the valley seems ``straight`` derivatives are computed first, since a correction is unlikely.
    """
    try:
        ahead = function(there) if straight or residual is None else None
        known = None if ahead is None else ahead.residual
        back = None if residual is None else _corrected(residual, square, here, there, free, bounds, known)
        if back is not None and back[1] >= square.chi2:
            return here, square
        point = there if back is None else back[0]
        return point, function(point) if ahead is None or point is not there else ahead
    except Infeasible:
        return here, square


def _ends_where_no_step_falls(
    function: Function, square: Square, here: Floats, newton: _Newton, free: np.ndarray, bounds: tuple[Floats, Floats]
) -> bool:
    """Return whether a search has converged where chi^2 falls along no step: to rounding, or on an edge."""
    if newton.promised >= _ROUNDED * newton.unit:
        across = np.clip(here + _ACROSS * newton.step, *bounds)
        return _fall_along_edge(function, square, across, newton.step, free) < _ON_EDGE * newton.unit
    return newton.promises_less_than(_ROUNDED)


def _fall_along_edge(function: Function, square: Square, across: Floats, newton: Floats, free: np.ndarray) -> float:
    """Return the predicted fall of chi^2 along an edge, if one lies between this point and ``across``; else infinity.

    A force's range may equal the gap at which the block turns.  If it is slightly larger, the block never leaves it,
    and chi^2 rises although its gradient g promises a fall.  At the edge g changes by a multiple of the edge's normal
    n.  A Newton step lowers chi^2 by g C g, with C the covariance; along the edge by (g C n)^2 / (n C n) less.
    """
    try:
        beyond = function(across)
    except Infeasible:
        return math.inf
    normal = beyond.gradient - square.gradient
    away = _step(square, free, 0.0, normal)  # - C n
    if beyond.chi2 <= square.chi2 or away is None or not away.any():
        return math.inf
    return float(-newton @ square.gradient + (away @ square.gradient) ** 2 / (away @ normal))


def _corrected(
    residual: Residual,
    square: Square,
    here: Floats,
    there: Floats,
    free: np.ndarray,
    bounds: tuple[Floats, Floats],
    known: Floats | None = None,
) -> tuple[Floats, float] | None:
    """Return ``there``, corrected until its residual is the linear prediction from ``here``, and chi^2 at it.

    The corrections use the derivatives at ``here``, which remain valid in steep directions.  Flat directions, in which
    the step is long, are not corrected.  ``known`` is the residual at ``there``, if known.  None if ``square`` has no
    residual or that at ``there`` is infeasible.
    """
    if square.residual is None or square.along is None or square.pull is None:
        return None
    wanted = square.residual + square.along(there - here)
    least = float(wanted @ wanted)
    best, chi2 = None, np.inf
    for _ in range(_CORRECTIONS):
        try:
            now = residual(there) if known is None else known
        except Infeasible:
            break
        known, value = None, float(now @ now)
        if value > 0.9 * chi2 and value > square.chi2:
            break
        if value < chi2:
            best, chi2 = there, value
        if chi2 - least < _NEAR_ENOUGH * max(square.chi2 - least, 0.0) or value > chi2:
            break
        correction = _step(square, free, _STEEP, square.pull(now - wanted))
        if correction is None:
            break
        there = np.clip(there + correction, *bounds)
    return None if best is None else (best, chi2)


def _stepped(
    square: Square, here: Floats, free: np.ndarray, damping: float, bounds: tuple[Floats, Floats]
) -> Floats | None:
    """Return the end of the damped step within ``bounds``; None if the matrix is singular.

    Parameters that would cross a bound stop on it, and the others take the best step given that.
    """
    there, free = here.copy(), free.copy()
    while True:
        step = _step(square, free, damping, square.gradient + square.curvature @ (there - here))
        if step is None:
            return None
        wanted = there + step
        inside = np.clip(wanted, *bounds)
        beyond = inside != wanted
        if not beyond.any():
            return wanted
        there[beyond] = inside[beyond]
        free &= ~beyond


def _length(square: Square, step: Floats) -> float:
    """Return the length of a step, with each parameter in units of its conditional standard deviation."""
    return float(np.sqrt(square.curvature.diagonal @ step**2))


def _step(square: Square, free: np.ndarray, damping: float, gradient: Floats | None = None) -> Floats | None:
    """Return the damped Gauss-Newton step, zero where not ``free``; None if the matrix is singular."""
    return square.curvature.solve(-(square.gradient if gradient is None else gradient), free, damping)

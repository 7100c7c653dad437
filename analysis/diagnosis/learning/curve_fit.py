"""Fit a law of unknown form: a free curve of an argument, fitted to the shots jointly with the base model.

A curve of B-splines is fitted jointly with base and starts on the exact solver, by Gauss-Newton steps whose smoothing
is re-estimated at every step (``penalised_step``).  A law changes the trajectories little, so derivatives serve for
several steps.  They are recomputed where a step gains less than they predicted.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from analysis.collision import Argument, Infeasible, graded_basis
from analysis.compiled import side_by_side
from analysis.diagnosis.learning.curve_equations import CurveEquations, penalised_step, whitened_residual
from analysis.diagnosis.learning.curve_motion import FitWithMotions, Motions, Term, displacements, motions, places_of
from analysis.inference import Fitted, Floor, NormalMatrix, Problem, free_to_move, white_floor
from analysis.shot import Cancelled, Floats, Stop

_DAMPINGS = (0.0, 1e-8, 1e-6, 1e-4, 1e-2, 0.3)  # of a step, tried one after another until chi^2 falls
_EASING = 1e-2  # factor on the damping from step to step
_SETTLED = 0.5  # of chi^2: a step that gains less is the last
_FAITHFUL = 0.8  # share of the predicted fall of chi^2; below it, derivatives are recomputed


@dataclass(frozen=True)
class Learned:
    """A fit of base, starts and one or two curves.

    ``z`` is the search vector of base and starts; ``residual_m`` is averaged, per shot; ``curvature`` is that of all
    parameters (z, then coefficients) in units of the noise without smoothing; ``penalty`` is the smoothing added;
    ``freedom`` is the effective number of coefficients; ``log_likelihood`` is that under the noise learned.
    """

    problem: Problem
    terms: tuple[Term, ...]
    z: Floats
    residual_m: tuple[Floats, ...]
    log_likelihood: float
    curvature: NormalMatrix
    penalty: Floats
    freedom: float

    @property
    def samples(self) -> int:
        """Get the number of valid averaged samples."""
        return sum(int(shot.valid.sum()) for shot in self.problem.data.shots)

    def with_last(self, which: int) -> "Learned":
        """Return the same fit with one of its curves moved to the end."""
        order = [*(k for k in range(len(self.terms)) if k != which), which]
        places = places_of(self.terms)
        at = np.r_[tuple(places[k] for k in order)]
        whole = np.concatenate([np.arange(self.z.size), self.z.size + at])
        return replace(
            self,
            terms=tuple(self.terms[k] for k in order),
            curvature=self.curvature.renumbered(whole),
            penalty=self.penalty[np.ix_(at, at)],
        )

    @property
    def bic(self) -> float:
        """Get the Bayesian information criterion; the curves count as their effective number of coefficients."""
        return (self.z.size + self.freedom) * math.log(self.samples) - 2 * self.log_likelihood

    @property
    def least_form_bic(self) -> float:
        """Get the BIC of closed forms that equal the curves with a single parameter each."""
        return self.bic - (self.freedom - len(self.terms)) * math.log(self.samples)


def screen(before_law: FitWithMotions, argument: Argument, pieces: int, stop: Stop, *, steps: int = 7) -> Learned:
    """Fit a curve of ``argument`` in about ``pieces`` pieces to a fit's residual.  Raises Infeasible, Cancelled.

    The curvature returned may be that of a point a few steps back.
    """
    start = before_law.fitted
    low, high = before_law.visited(argument)
    basis = graded_basis(low, high, pieces)
    term = Term(argument, basis, np.zeros(basis.count))
    problem = start.problem.with_noise(_rough_noise(start))
    return _fitted(problem, start.z, (term,), stop, steps, before_law.beside(term), to_the_end=False)


def likeliest_pairs(
    before_law: FitWithMotions, arguments: Sequence[Argument], pieces: int, stop: Stop
) -> list[tuple[Term, Term]]:
    """Return pairs of zero curves, ranked by the residual that they explain to first order.  Raises Cancelled.

    One QR decomposition of the derivatives of all curves reduces the rows to the number of shared parameters and keeps
    every sum of squares.  The 55 pairs of eleven arguments then take some seconds.
    """
    start = before_law.fitted
    rough = start.problem.with_noise(_rough_noise(start))

    def columns(argument: Argument) -> tuple[Term, list[Floats]] | None:
        try:
            basis = graded_basis(*before_law.visited(argument), pieces)
            term = Term(argument, basis, np.zeros(basis.count))
            by_shot = before_law.columns(term)
        except (Infeasible, ValueError):
            return None
        return (term, by_shot) if all(np.all(np.isfinite(one)) for one in by_shot) else None

    known = [one for one in side_by_side(columns, arguments) if one is not None]
    if len(known) < 2:
        return []
    every = [np.hstack(of_shot) for of_shot in zip(*(by_shot for _, by_shot in known), strict=True)]
    equations = CurveEquations.of(rough, start.residual_m, before_law.motions.derivatives.with_shared(every))
    count, size = equations.left.size, equations.shared_base
    turned: Floats = np.asarray(np.linalg.qr(equations.reduced(), mode="r"), dtype=np.float64)
    places = places_of([term for term, _ in known], 1 + size)

    def judged(pair: tuple[int, int]) -> tuple[float, tuple[Term, Term]]:
        if stop():
            raise Cancelled
        both = (known[pair[0]][0], known[pair[1]][0])
        rows = np.hstack([turned[:, : 1 + size], *(turned[:, places[k]] for k in pair)])
        by, _, freedom = penalised_step(rows, size, both, samples=equations.samples)
        rest = rows[:, 0] - rows[:, 1:] @ by
        return count * math.log(float(rest @ rest)) + freedom * math.log(count), both

    pairs = side_by_side(judged, itertools.combinations(range(len(known)), 2))
    return [both for _, both in sorted(pairs, key=lambda one: one[0])]


def _rough_noise(start: Fitted) -> Floor:
    """Return the noise under which curves are first fitted to a residual.

    It is white noise as strong as the residual; on a moving frame, whose motion exceeds that, the flights' noise.
    """
    if start.problem.data.site.moves:
        return start.unlearned_noise
    left = np.concatenate([r[s.valid] for r, s in zip(start.residual_m, start.problem.data.shots, strict=True)])
    return white_floor(float(np.sqrt(np.mean(left**2))), start.noise.spacing_s)


def refine(learned: Learned, pieces: int, stop: Stop, *, steps: int) -> Learned:
    """Continue a fit with the last curve split into about ``pieces`` pieces.  Raises Infeasible, Cancelled."""
    *others, term = learned.terms
    knots = np.array(term.basis.knots)
    basis = graded_basis(float(knots[0]), float(knots[-1]), pieces)
    fine = np.unique(np.concatenate([knots, np.linspace(knots[0], knots[-1], 8 * basis.count), basis.knots]))
    coefficients = np.linalg.lstsq(basis.design(fine), term.curve(fine), rcond=None)[0]
    finer = (*others, Term(term.argument, basis, np.asarray(coefficients, dtype=np.float64)))
    return fit_terms(learned.problem, learned.z, finer, stop, steps=steps)


def fit_terms(
    problem: Problem, z: Floats, terms: tuple[Term, ...], stop: Stop, *, steps: int, to_the_end: bool = True
) -> Learned:
    """Fit base, starts and curves by penalised Gauss-Newton steps.

    The noise starts as the problem's and is re-estimated at every step.  On a moving frame it is that of the flights
    until the end, since strengths learned on the way would absorb what the curves do not explain yet.  Unless
    ``to_the_end``, derivatives are not recomputed at the final point: the curvature may be that of a few steps before.
    """
    if problem.data.site.moves:
        problem = problem.with_noise(problem.data.noise_of_flights)
    return _fitted(problem, z, terms, stop, steps, motions(problem, z, terms), to_the_end=to_the_end)


@dataclass(frozen=True)
class _SearchPoint:
    """A point of the search; ``fresh``: its derivatives were computed at this point."""

    z: Floats
    terms: tuple[Term, ...]
    motions: Motions
    fresh: bool

    def left_m(self, problem: Problem) -> tuple[Floats, ...]:
        """Return measured minus model, averaged, per shot."""
        return problem.data.left_m(self.motions.displacement_m)

    def equations(self, problem: Problem) -> CurveEquations:
        """Return the equations of measured minus model, linearised at the derivatives' point."""
        return CurveEquations.of(problem, self.left_m(problem), self.motions.derivatives)

    def with_derivatives(self, problem: Problem) -> "_SearchPoint":
        """Return this point with derivatives computed at it."""
        return (
            self if self.fresh else _SearchPoint(self.z, self.terms, motions(problem, self.z, self.terms), fresh=True)
        )


def _fitted(
    problem: Problem,
    z: Floats,
    terms: tuple[Term, ...],
    stop: Stop,
    steps: int,
    begin: Motions,
    *,
    to_the_end: bool,
) -> Learned:
    """Return the fit of ``fit_terms``, started at ``z`` and ``terms``, whose motions are ``begin``."""
    here, damping = _SearchPoint(z, terms, begin, fresh=True), 0.0
    for step in range(steps):
        if stop():
            raise Cancelled
        went = _downhill(problem, here, damping)
        if went.there is None and not here.fresh and went.predicted_fall > _SETTLED:  # as outdated derivatives promise
            here = here.with_derivatives(problem)
            went = _downhill(problem, here, damping)
        if went.there is None:
            break
        here, damping = went.there, went.damping
        if step >= 1 and not problem.data.site.moves:
            problem = problem.with_noise(problem.learn_noise(here.left_m(problem), problem.noise)[0])
        if step >= 2 and went.actual_fall < _SETTLED and damping <= _DAMPINGS[1]:
            break
        if went.actual_fall < _FAITHFUL * went.predicted_fall and went.predicted_fall > _SETTLED and step < steps - 1:
            here = here.with_derivatives(problem)
        damping *= _EASING if damping > _DAMPINGS[1] else 0.0
    if to_the_end:
        here = here.with_derivatives(problem)
    left = here.left_m(problem)
    noise, value = problem.learn_noise(left, problem.noise)
    problem = problem.with_noise(noise)
    equations = here.equations(problem)
    _, penalty, freedom = equations.step(here.terms)
    return Learned(problem, here.terms, here.z, left, value, equations.curvature, penalty, freedom)


class _StepResult(NamedTuple):
    """The point a step reached, if any; its damping; the fall of penalised chi^2, actual and predicted."""

    there: _SearchPoint | None
    damping: float
    actual_fall: float
    predicted_fall: float


def _downhill(problem: Problem, here: _SearchPoint, damping: float) -> _StepResult:
    whole, size, (low, high) = here.equations(problem), here.z.size, problem.bounds
    free = np.ones(whole.columns.size, np.bool_)
    free[:size] = free_to_move(here.z, -whole.columns.pull(whole.left)[:size], low, high)
    equations = whole.without(np.flatnonzero(~free))  # what descent pushes against its bound stays there
    moves, penalty, _ = equations.step(here.terms)
    chi2 = _penalised(equations.left, here.terms, penalty)

    def predicted_fall(by: Floats) -> float:
        rest = equations.left - equations.columns.along(by)
        return chi2 - _penalised(rest, _moved(here.terms, by[size:]), penalty)

    for trial in (d for d in _DAMPINGS if d >= damping):
        by = moves if trial == 0.0 else whole.damped_step(here.terms, penalty, trial, free)
        if by is None:
            continue
        z, terms = np.clip(here.z + by[:size], low, high), _moved(here.terms, by[size:])
        by = np.concatenate([z - here.z, by[size:]])
        try:
            shown = displacements(problem, z, terms)
            there = _SearchPoint(z, terms, Motions(shown, here.motions.derivatives), fresh=False)
            left = whitened_residual(problem, there.left_m(problem))
        except Infeasible:
            continue
        actual_fall = chi2 - _penalised(left, terms, penalty)
        if actual_fall > 0.0:
            return _StepResult(there, trial, actual_fall, predicted_fall(by))
    return _StepResult(None, damping, 0.0, predicted_fall(moves))


def _moved(terms: tuple[Term, ...], by: Floats) -> tuple[Term, ...]:
    each = zip(terms, places_of(terms), strict=True)
    return tuple(replace(term, coefficients=term.coefficients + by[part]) for term, part in each)


def _penalised(left: Floats, terms: Sequence[Term], penalty: Floats) -> float:
    c = np.concatenate([term.coefficients for term in terms])
    return float(left @ left + c @ penalty @ c)

"""The linearised equations of base, starts and curves over all shots, and their penalised Gauss-Newton step.

Each shot's own parameters are eliminated within the shot, so time and memory grow with the number of shots, not with
its square.  The smoothing of the curves is set by restricted maximum likelihood (Patterson and Thompson, Biometrika 58
(1971) 545; Wood, J. R. Stat. Soc. B 73 (2011) 3).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Infeasible
from analysis.diagnosis.learning.curve_motion import Term, places_of
from analysis.inference import Arrow, NormalMatrix, Problem
from analysis.shot import Floats

_BEYOND = 1e100  # noise norms: larger than any motion of the rig
_GRID = np.arange(-34.0, 14.0, 1.5)  # ln of a smoothing in units of the curve's own curvature
_NEIGHBOURS = 16  # points of the grid per diagonalisation
_RIDGE = 1e-9  # of each coefficient's own curvature: keeps coefficients that no shot constrains near zero


@dataclass(frozen=True)
class CurveEquations:
    """Whitened equations: ``columns`` times a step shall equal ``left``, the residual, shape (rows,).

    A step holds the ``base`` parameters of base and starts, then the coefficients of the curves.
    """

    left: Floats
    columns: Arrow
    base: int

    @classmethod
    def of(cls, problem: Problem, left_m: Iterable[Floats], columns: Arrow) -> "CurveEquations":
        """Return the equations of a residual, shape (n,) per shot.  Raises Infeasible where a motion is not finite."""
        left, whitened = problem.whitened_equations(left_m, columns)
        _check(left, *whitened.blocks)
        return cls(left, whitened, problem.size)

    def without(self, numbers: Iterable[int]) -> "CurveEquations":
        """Return the equations with these parameters fixed."""
        return replace(self, columns=self.columns.without(numbers))

    @property
    def shared_base(self) -> int:
        """Get the number of columns of the base model that all shots share."""
        return int((self.columns.places[0][: self.columns.shared] < self.base).sum())

    @cached_property
    def curvature(self) -> NormalMatrix:
        """Get the matrix of the normal equations, without smoothing."""
        return self.columns.normal_matrix()

    @property
    def samples(self) -> int:
        """Get the number of samples that ``reduced`` represents: those of all shots less the eliminated parameters."""
        return self.left.size - self.base + self.shared_base

    def reduced(self) -> Floats:
        """Return (left, shared columns) with each shot's own columns projected off, reduced to a triangle per shot.

        Shape (m, 1 + s); scalar products of columns are kept.  Cost: 2 n (1 + s)^2 multiply-adds per shot.
        """
        by_shot = self.columns.off_own(self.left)
        return np.concatenate([np.linalg.qr(np.roll(rows, 1, axis=1), mode="r") for rows in by_shot])

    def step(self, terms: Sequence[Term]) -> tuple[Floats, Floats, float]:
        """Return the penalised step of all parameters, the penalty and the effective number of coefficients."""
        shared, penalty, freedom = penalised_step(self.reduced(), self.shared_base, terms, samples=self.samples)
        return self.columns.with_own(shared, self.left), penalty, freedom

    def damped_step(
        self, terms: Sequence[Term], penalty: Floats, damping: float, free: NDArray[np.bool_]
    ) -> Floats | None:
        """Return the step of all ``free`` parameters, damped in directions that the shots hardly constrain; or None."""
        coefficients = np.concatenate([term.coefficients for term in terms])
        shared, pull = self.curvature.shared.copy(), self.columns.pull(self.left)
        shared[self.shared_base :, self.shared_base :] += penalty
        pull[self.base :] -= penalty @ coefficients
        return replace(self.curvature, shared=shared).solve(pull, free, damping)


def whitened_residual(problem: Problem, left_m: Iterable[Floats]) -> Floats:
    """Return a residual, shape (n,) per shot, whitened, all shots concatenated.  Raises Infeasible as the equations."""
    left = problem.whitened(one[:, None] for one in left_m)[:, 0]
    _check(left)
    return left


def _check(*whitened: Floats) -> None:
    if not all(np.all(np.abs(one) < _BEYOND) for one in whitened):
        raise Infeasible("the trajectory leads nowhere")


def penalised_step(
    rows: Floats, base: int, terms: Sequence[Term], *, samples: int | None = None
) -> tuple[Floats, Floats, float]:
    """Return the step of all parameters, the smoothing penalty of the coefficients, and their effective number.

    ``rows`` hold the residual, ``base`` columns of the base model, and the curves' columns.  The smoothing is one
    number per curve, from restricted maximum likelihood of the linearised problem.  ``samples`` is the number of
    samples that ``rows`` represent, if they were reduced to fewer rows.
    """
    left, fixed, free = rows[:, 0], rows[:, 1 : 1 + base], rows[:, 1 + base :]
    now = np.concatenate([term.coefficients for term in terms])
    target = left + free @ now
    scale = np.linalg.norm(fixed, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    basis, _ = np.linalg.qr(fixed / scale)
    target_in = target - basis @ (basis.T @ target)
    free_in = free - basis @ (basis.T @ free)
    a, b, s = free_in.T @ free_in, free_in.T @ target_in, float(target_in @ target_in)
    penalty, solution = _smoothing(a, b, s, (samples or rows.shape[0]) - base, terms)
    total = a + penalty
    freedom = float(np.trace(np.linalg.solve(total, a)))
    rest = left - free @ (solution - now)
    own = np.linalg.lstsq(fixed / scale, rest, rcond=1e-12)[0] / scale
    return np.concatenate([own, solution - now]), penalty, freedom


def _smoothing(a: Floats, b: Floats, s: float, free_samples: int, terms: Sequence[Term]) -> tuple[Floats, Floats]:
    shapes = []  # of each curve's smoothing, in the place of its coefficients
    for term, part in zip(terms, places_of(terms), strict=True):
        rough = term.basis.roughness
        shape = np.zeros_like(a)
        shape[part, part] = rough * (np.trace(a[part, part]) / max(np.trace(rough), 1e-300))
        shapes.append(shape)
    logs = [0.0] * len(terms)

    def smoothing_of(curves: Iterable[int]) -> Floats:
        return sum((math.exp(logs[k]) * shapes[k] for k in curves), np.zeros_like(a))

    every = range(len(terms))
    ridge = _RIDGE * np.diag(np.diag(a)) + 1e-300 * np.eye(a.shape[0])
    for _ in range(1 if len(terms) == 1 else 3):
        for k, term in enumerate(terms):
            others = a + ridge + smoothing_of(other for other in every if other != k)
            value = (term.basis.count - 2) * _GRID / 2 + _likelihoods(others, shapes[k], b, s, free_samples)
            logs[k] = float(_GRID[int(np.argmax(value))])
    penalty = smoothing_of(every) + ridge
    return penalty, np.asarray(np.linalg.solve(a + penalty, b), dtype=np.float64)


def _likelihoods(a: Floats, shape: Floats, b: Floats, s: float, free_samples: int) -> Floats:
    """Return ln L of the smoothings exp(_GRID) of one curve; -inf where the matrix is not positive definite.

    The matrix and its smoothing are diagonalised jointly, for a few neighbouring grid points at once: further away,
    rounding would hide a small smoothing.
    """
    out, first = np.full(_GRID.size, -math.inf), 0
    while first < _GRID.size:
        some = slice(first, first + _NEIGHBOURS)
        least = math.exp(_GRID[first])
        try:
            factor = np.linalg.cholesky(a + least * shape)
        except np.linalg.LinAlgError:
            first += 1
            continue
        turned = np.linalg.solve(factor, np.linalg.solve(factor, shape).T)
        values, vectors = np.linalg.eigh(turned)
        half = (vectors.T @ np.linalg.solve(factor, b)) ** 2
        grown = 1.0 + np.outer(np.exp(_GRID[some]) - least, np.maximum(values, 0.0))
        rss = np.maximum(s - (half / grown).sum(axis=1), 1e-300)
        determinant = np.log(np.diag(factor)).sum() + 0.5 * np.log(grown).sum(axis=1)
        out[some] = -0.5 * free_samples * np.log(rss) - determinant
        first += _NEIGHBOURS
    return out

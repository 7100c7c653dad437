"""The linearised equations of base, starts and curves over all shots.

Each shot's own parameters are eliminated within the shot, so time and memory grow with the number of shots, not with
its square.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Infeasible
from analysis.diagnosis.learning.curve_motion import Term
from analysis.diagnosis.learning.penalised_step import penalised_step
from analysis.inference import Arrow, Problem
from analysis.shot import Floats

_BEYOND = 1e100  # noise norms: larger than any motion of the rig


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
        curvature, pull = self.columns.normal_matrix(), self.columns.pull(self.left)
        curvature.shared[self.shared_base :, self.shared_base :] += penalty
        pull[self.base :] -= penalty @ coefficients
        return curvature.solve(pull, free, damping)


def whitened_residual(problem: Problem, left_m: Iterable[Floats]) -> Floats:
    """Return a residual, shape (n,) per shot, whitened, all shots concatenated.  Raises Infeasible as the equations."""
    left = problem.whitened(one[:, None] for one in left_m)[:, 0]
    _check(left)
    return left


def _check(*whitened: Floats) -> None:
    if not all(np.all(np.abs(one) < _BEYOND) for one in whitened):
        raise Infeasible("the trajectory leads nowhere")

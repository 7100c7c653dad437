"""Equations whose shots' own parameters are eliminated lead to the step of the whole matrix."""

from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.diagnosis.learning.curve_equations import CurveEquations, penalised_step, whitened_residual
from analysis.diagnosis.learning.curve_motion import Term
from analysis.inference.model.arrow import Arrow

PLACE = next(one for one in ARGUMENTS if (one.where, one.name) == ("block", "place"))
BASIS = Basis(tuple(np.linspace(0.0, 1.0, 7)))
SHARED, OWN, ROWS = 2, 3, 60


def drawn(shots: int, seed: int = 1) -> tuple[CurveEquations, Term, np.ndarray]:
    """Return equations of some shots with a curve, and their whole matrix (left, base and starts, coefficients)."""
    random = np.random.default_rng(seed)
    base = Arrow.of([random.standard_normal((ROWS + k, SHARED + OWN)) for k in range(shots)], SHARED)
    at = [random.uniform(0.0, 1.0, len(block)) for block in base.blocks]
    columns = base.with_shared([BASIS.design(one) for one in at])
    now = random.standard_normal(BASIS.count)
    true = random.standard_normal(base.size)
    left = base.along(true) + np.sin(6.0 * np.concatenate(at)) + 0.3 * random.standard_normal(sum(map(len, at)))
    left -= np.concatenate([BASIS.design(one) @ now for one in at])
    return CurveEquations(left, columns, base.size), Term(PLACE, BASIS, now), np.column_stack([left, dense(columns)])


def dense(arrow: Arrow) -> np.ndarray:
    out = np.zeros((sum(map(len, arrow.blocks)), arrow.size))
    for block, place, part in zip(arrow.blocks, arrow.places, arrow.parts(out), strict=True):
        part[:, place] = block
    return out


@pytest.mark.parametrize("shots", [1, 4])
def test_a_step_is_that_of_the_whole_matrix(shots: int) -> None:
    equations, term, rows = drawn(shots)
    expected = penalised_step(rows, equations.base, (term,))
    found = equations.step((term,))
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-7)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-6, atol=1e-7)
    assert found[2] == pytest.approx(expected[2])
    assert equations.shared_base == SHARED and equations.samples == len(rows) - shots * OWN


def test_the_rows_that_couple_the_shots_grow_with_their_number_alone() -> None:
    for shots in (2, 20):
        reduced = drawn(shots)[0].reduced()
        width = 1 + SHARED + BASIS.count
        assert reduced.shape == (shots * width, width)


def test_fixed_parameters_take_no_step() -> None:
    equations, term, rows = drawn(3)
    fixed = [1, SHARED + 1]  # one that all shots share, one of the first shot
    found, _, _ = equations.without(fixed).step((term,))
    left = np.delete(rows, [1 + number for number in fixed], axis=1)
    expected, _, _ = penalised_step(left, equations.base - 2, (term,))
    assert not found[fixed].any()
    np.testing.assert_allclose(np.delete(found, fixed), expected, rtol=1e-4, atol=1e-5)


def test_damping_shortens_a_step() -> None:
    equations, term, rows = drawn(3)
    by, penalty, _ = equations.step((term,))
    free = np.ones(equations.columns.size, np.bool_)
    little, much = (equations.damped_step((term,), penalty, damping, free) for damping in (1e-12, 10.0))
    assert little is not None and much is not None
    jacobian = rows[:, 1:]
    np.testing.assert_allclose(jacobian @ little, jacobian @ by, atol=1e-3)
    whole = np.pad(penalty, (equations.base, 0))
    curvature = jacobian.T @ jacobian + whole
    pull = jacobian.T @ rows[:, 0] - whole[:, equations.base :] @ term.coefficients
    damped = curvature + 10.0 * np.diag(np.diag(curvature))
    np.testing.assert_allclose(damped @ much, pull, rtol=1e-6, atol=1e-6)
    free[[1, SHARED + 1]] = False  # one that all shots share, one of the first shot
    fewer = equations.damped_step((term,), penalty, 10.0, free)
    assert fewer is not None and not fewer[~free].any()
    np.testing.assert_allclose(damped[np.ix_(free, free)] @ fewer[free], pull[free], rtol=1e-6, atol=1e-6)


def test_a_motion_that_is_not_finite_has_no_equations() -> None:
    class Endless:
        size = SHARED

        def whitened(self, columns: Any) -> np.ndarray:
            return np.vstack(list(columns))

        def whitened_equations(self, left: Any, columns: Arrow) -> tuple[np.ndarray, Arrow]:
            return np.concatenate(list(left)), columns

    problem: Any = Endless()
    columns = Arrow.of([np.ones((4, SHARED))], SHARED)
    assert CurveEquations.of(problem, [np.ones(4)], columns).left.tolist() == [1.0] * 4
    for bad in (np.inf, np.nan, 1e101):
        left = np.array([1.0, bad, 1.0, 1.0])
        with pytest.raises(Infeasible, match="nowhere"):
            CurveEquations.of(problem, [left], columns)
        with pytest.raises(Infeasible, match="nowhere"):
            whitened_residual(problem, [left])
        with pytest.raises(Infeasible, match="nowhere"):
            CurveEquations.of(problem, [np.ones(4)], columns.mapped(lambda _, block, bad=bad: bad * block))

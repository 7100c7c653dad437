"""The normal equations of shots that share some parameters, against the whole matrix."""

import numpy as np
import pytest

from analysis.inference.model.arrow import Arrow
from analysis.inference.model.normal_matrix import NormalMatrix

SHARED, OWN, SHOTS, ROWS = 4, 3, 5, 30
SIZE = SHARED + SHOTS * OWN


def equations(seed: int, shots: int = SHOTS) -> tuple[NormalMatrix, np.ndarray]:
    """Return normal equations in a shuffled order of parameters of very different units, and the same as a matrix."""
    rng = np.random.default_rng(seed)
    size = SHARED + shots * OWN
    units, order = 10.0 ** rng.uniform(-6.0, 6.0, size), rng.permutation(size)
    of_shot = [np.concatenate([order[:SHARED], order[SHARED + OWN * k :][:OWN]]) for k in range(shots)]
    blocks = tuple(rng.standard_normal((ROWS, SHARED + OWN)) * units[at] for at in of_shot)
    arrow = Arrow(blocks, SHARED, tuple(of_shot), size)
    whole = np.zeros((shots * ROWS, size))
    for k, (block, at) in enumerate(zip(blocks, of_shot, strict=True)):
        whole[k * ROWS : (k + 1) * ROWS, at] = block
    return arrow.normal_matrix(), whole.T @ whole


@pytest.mark.parametrize("shots", [1, SHOTS])
def test_products_and_diagonal_are_those_of_the_whole_matrix(shots: int) -> None:
    matrix, whole = equations(1, shots)
    vector = np.random.default_rng(2).standard_normal(len(whole)) / np.sqrt(np.diag(whole))
    assert matrix.size == len(whole)
    np.testing.assert_allclose(matrix.dense(), whole, rtol=1e-12)
    np.testing.assert_allclose(matrix.diagonal, np.diag(whole), rtol=1e-12)
    unit = np.sqrt(np.diag(whole))
    np.testing.assert_allclose((matrix @ vector) / unit, whole @ vector / unit, atol=1e-12)
    alone = NormalMatrix.of(whole)
    np.testing.assert_array_equal(alone.dense(), whole)
    np.testing.assert_allclose((alone @ vector) / unit, whole @ vector / unit, atol=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("shots", [1, SHOTS])
def test_a_solution_solves_the_damped_equations_of_the_free_parameters(shots: int, damping: float) -> None:
    matrix, whole = equations(3, shots)
    unit = np.sqrt(np.diag(whole))
    right = np.random.default_rng(4).standard_normal(len(whole)) * unit
    damped = whole + damping * np.diag(np.diag(whole))
    for fixed in ([], [matrix.shared_at[1]], [matrix.own_at[-1, 0], matrix.shared_at[0], *matrix.own_at[0]]):
        free = np.ones(len(whole), np.bool_)
        free[fixed] = False
        at = np.flatnonzero(free)
        expected = np.zeros(len(whole))
        scaled = damped[np.ix_(at, at)] / np.outer(unit[at], unit[at])
        expected[at] = np.linalg.solve(scaled, right[at] / unit[at]) / unit[at]
        for each in (matrix, NormalMatrix.of(whole)):
            found = each.solve(right, free, damping)
            assert found is not None
            np.testing.assert_allclose(found * unit, expected * unit, rtol=1e-9, atol=1e-12)
    assert np.array_equal(matrix.solve(right, np.zeros(len(whole), np.bool_)), np.zeros(len(whole)))


def test_singular_equations_have_no_solution() -> None:
    twice = NormalMatrix.of(np.array([[1.0, 2.0], [2.0, 1.0]]))
    assert twice.solve(np.ones(2)) is None and twice.solve(np.ones(2), damping=1.5) is not None
    assert NormalMatrix.of(np.eye(2)).solve(np.array([np.inf, 0.0])) is None
    matrix, _ = equations(5)
    matrix.own[2, :, 0] = matrix.own[2, 0, :] = matrix.cross[2, 0] = 0.0  # a parameter that moves nothing
    right = matrix @ np.ones(SIZE)
    held = np.ones(SIZE, np.bool_)
    held[matrix.own_at[2, 0]] = False
    assert matrix.solve(right) is None and matrix.solve(right, held) is not None
    damped = matrix.solve(right, damping=1e-6)
    assert damped is not None and damped[matrix.own_at[2, 0]] == 0.0
    matrix.own[2] = np.ones((OWN, OWN))
    assert matrix.solve(np.ones(SIZE)) is None and matrix.inverse() is None


@pytest.mark.parametrize("shots", [1, SHOTS])
def test_the_inverse_is_that_of_the_free_parameters(shots: int) -> None:
    matrix, whole = equations(6, shots)
    unit = np.sqrt(np.diag(whole))
    for fixed in ([], [matrix.shared_at[2], matrix.own_at[-1, 1]], [*matrix.own_at[0]]):
        free = np.ones(len(whole), np.bool_)
        free[fixed] = False
        at = np.flatnonzero(free)
        expected = np.zeros(whole.shape)
        expected[np.ix_(at, at)] = np.linalg.inv(whole[np.ix_(at, at)] / np.outer(unit[at], unit[at]))
        for each in (matrix, NormalMatrix.of(whole)):
            found = each.inverse(free)
            assert found is not None
            np.testing.assert_allclose(found * np.outer(unit, unit), expected, rtol=1e-9, atol=1e-10)


def test_there_is_no_inverse_where_rounding_hides_a_direction() -> None:
    # of two unit columns with the cosine 1 - e the eigenvalues are e and 2 - e
    for share, seen in ((1.1, True), (0.9, False)):
        cosine = 1.0 - 2e-13 * share
        assert (NormalMatrix.of(np.array([[1.0, cosine], [cosine, 1.0]])).inverse() is not None) is seen
    assert NormalMatrix.of(np.diag([1.0, 0.0])).inverse() is None
    assert NormalMatrix.of(np.diag([1.0, 0.0])).inverse(np.array([True, False])) is not None


def test_the_parameters_of_each_shot_give_way_to_the_shared_ones() -> None:
    matrix, whole = equations(7)
    unit = np.sqrt(np.diag(whole))
    gradient = np.random.default_rng(8).standard_normal(SIZE) * unit
    own, shared = matrix.own_at.ravel(), matrix.shared_at
    reduced, pull, fall = matrix.without_own(gradient)
    into = np.linalg.solve(whole[np.ix_(own, own)], whole[np.ix_(own, shared)]).T
    scale = unit[shared]
    expected = whole[np.ix_(shared, shared)] - into @ whole[np.ix_(own, shared)]
    np.testing.assert_allclose(reduced / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=1e-8)
    np.testing.assert_allclose(pull / scale, (gradient[shared] - into @ gradient[own]) / scale, rtol=1e-8)
    assert fall == pytest.approx(gradient[own] @ np.linalg.solve(whole[np.ix_(own, own)], gradient[own]), rel=1e-8)


def test_free_parameters_follow_the_others_to_the_least_chi2_in_any_order() -> None:
    matrix, whole = equations(6)
    unit = np.sqrt(np.diag(whole))
    scaled = whole / np.outer(unit, unit)
    places = np.array([matrix.shared_at[0], matrix.own_at[2, 1]])
    free = ~np.isin(np.arange(SIZE), [*places, matrix.own_at[0, 0]])
    expected = np.zeros((SIZE, 2))
    expected[places, [0, 1]] = 1.0
    followed = np.linalg.solve(scaled[np.ix_(free, free)], -scaled[np.ix_(free, places)])
    expected[free] = followed / unit[free][:, None] * unit[places]
    np.testing.assert_allclose(matrix.followed(places, free) * unit[:, None], expected * unit[:, None], rtol=1e-8)
    order = np.random.default_rng(7).permutation(SIZE)
    np.testing.assert_array_equal(matrix.renumbered(order).dense(), matrix.dense()[np.ix_(order, order)])


def test_a_parameter_that_moves_nothing_stays_and_what_is_not_finite_has_no_solution() -> None:
    matrix, right = NormalMatrix.of(np.diag([2.0, 0.0])), np.array([1.0, 0.0])
    free = np.ones(2, np.bool_)
    np.testing.assert_allclose(matrix.least(right, free), [0.5, 0.0], rtol=1e-12)
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        NormalMatrix.of(np.full((2, 2), np.nan)).least(right, free)

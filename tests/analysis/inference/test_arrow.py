"""Columns kept shot by shot do what the whole matrix with its zeros does."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.inference.model.arrow import Arrow, orthonormal

Floats = NDArray[np.float64]


def drawn(seed: int, shared: int = 4, own: tuple[int, ...] = (3, 3, 5), rows: int = 40) -> Arrow:
    random = np.random.default_rng(seed)
    return Arrow.of([random.standard_normal((rows + k, shared + count)) for k, count in enumerate(own)], shared)


def mixed(arrow: Arrow, seed: int) -> Arrow:
    """Return the same columns, the numbers that they belong to in another order."""
    order = np.random.default_rng(seed).permutation(arrow.size).astype(np.intp)
    return Arrow(arrow.blocks, arrow.shared, tuple(order[place] for place in arrow.places), arrow.size)


def dense(arrow: Arrow) -> Floats:
    out = np.zeros((sum(len(block) for block in arrow.blocks), arrow.size))
    for block, place, part in zip(arrow.blocks, arrow.places, arrow.parts(out), strict=True):
        part[:, place] = block
    return out


def beside(whole: Floats, rows: Floats) -> Floats:
    basis, size, _ = np.linalg.svd(whole, full_matrices=False)
    basis = basis[:, size > 1e-9]
    return np.asarray(rows - basis @ (basis.T @ rows))


@pytest.mark.parametrize("seed", range(5))
def test_products_are_those_of_the_whole_matrix(seed: int) -> None:
    arrow = mixed(drawn(seed), seed)
    whole, random = dense(arrow), np.random.default_rng(seed)
    numbers, rows = random.standard_normal(arrow.size), random.standard_normal(len(whole))
    assert np.allclose(arrow.along(numbers), whole @ numbers)
    assert np.allclose(arrow.pull(rows), whole.T @ rows)


@pytest.mark.parametrize("own", [(3, 3, 5), (0, 0, 0), (2, 0, 1)])
@pytest.mark.parametrize("shared", [0, 4])
def test_what_is_spanned_is_taken_out_and_solved_for(shared: int, own: tuple[int, ...]) -> None:
    arrow = drawn(7, shared, own)
    whole = dense(arrow)
    rows = np.random.default_rng(3).standard_normal((len(whole), 2))
    assert np.allclose(arrow.span().projected(rows), beside(whole, rows))
    solved = arrow.solve(rows[:, 0])
    assert np.allclose(solved, np.linalg.lstsq(whole, rows[:, 0], rcond=None)[0])


def test_a_column_that_others_do_as_well_counts_once() -> None:
    arrow = drawn(5)
    twice = Arrow.of([np.column_stack([block, block[:, 0]]) for block in arrow.blocks], 4)  # a shared one as each own
    rows = np.random.default_rng(4).standard_normal(len(dense(arrow)))
    assert np.allclose(twice.span().projected(rows), beside(dense(twice), rows), atol=1e-8)
    assert sum(len(basis.T) for basis in twice.span().own) + len(twice.span().shared[0].T) == twice.size - 1


@pytest.mark.parametrize("seed", range(3))
def test_columns_beside_what_is_spanned(seed: int) -> None:
    arrow, more = drawn(seed), drawn(seed + 50, 2, (2, 2, 2))
    left = arrow.span().projected(np.random.default_rng(seed).standard_normal(len(dense(arrow))))
    found = arrow.span().projected_columns(more)
    new = beside(dense(arrow), dense(more))
    assert np.allclose(found.power, np.sum(new**2, axis=0))
    assert np.allclose(found.solve(left), np.linalg.lstsq(new, left, rcond=None)[0])
    assert found.new.all()
    # of one shot alone, whatever the units, and beside a column of nothing
    one, rows = arrow.blocks[0], len(arrow.blocks[0])
    basis = Arrow.of([one], 0).span()
    some = np.random.default_rng(seed).standard_normal((rows, 2))
    few = basis.projected_columns(Arrow.of([np.column_stack([some * [1e-7, 1e5], np.zeros(rows)])], 0))
    mine = basis.projected(left[:rows])
    solved = np.linalg.lstsq(beside(one, some), mine, rcond=None)[0]
    assert np.allclose(few.solve(mine) * [1e-7, 1e5, 1.0], [*solved, 0.0]) and few.new.tolist() == [True, True, False]


def test_columns_that_are_spanned_already_are_not_new_and_get_nothing() -> None:
    arrow = drawn(2)
    old = Arrow.of([block[:, 4:].sum(axis=1, keepdims=True) for block in arrow.blocks], 0)
    random = np.random.default_rng(1)
    fresh = Arrow.of([np.column_stack([b, random.standard_normal(len(b))]) for b in old.blocks], 0)
    found = arrow.span().projected_columns(fresh)
    assert found.new.tolist() == [False, True] * 3
    numbers = found.solve(arrow.span().projected(random.standard_normal(len(dense(arrow)))))
    assert np.all(numbers[::2] == 0.0) and np.all(numbers[1::2] != 0.0)


def test_new_columns_that_depend_on_each_other_share_what_they_explain() -> None:
    """As the forces of two laws that are one on what was visited: any large difference of both would do as well."""
    arrow, random = drawn(3), np.random.default_rng(6)
    same = Arrow.of([np.outer(random.standard_normal(len(block)), [1.0, 1.0, 2.0]) for block in arrow.blocks], 0)
    left = arrow.span().projected(random.standard_normal(len(dense(arrow))))
    numbers = arrow.span().projected_columns(same).solve(left)
    new = beside(dense(arrow), dense(same))
    assert np.allclose(new @ numbers, new @ np.linalg.lstsq(new, left, rcond=1e-9)[0])
    assert np.allclose(numbers[::3], numbers[1::3], rtol=1e-2) and np.abs(numbers).max() < 1.0


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_a_basis_does_not_depend_on_the_units_of_its_columns(unit: float) -> None:
    random = np.random.default_rng(9)
    columns = random.standard_normal((30, 5))
    columns[:, 4] = columns[:, 0] - columns[:, 2]  # dependent
    basis = orthonormal(columns * np.array([1.0, unit, 1.0 / unit, 1.0, 1.0]))
    assert basis.shape == (30, 4) and np.allclose(basis.T @ basis, np.eye(4))
    assert np.allclose(beside(columns, basis), 0.0, atol=1e-8)
    assert orthonormal(np.zeros((30, 2))).shape == (30, 0)


def test_columns_left_out_leave_the_others_where_they_were() -> None:
    arrow = mixed(drawn(8), 8)
    gone = [int(arrow.places[0][1]), int(arrow.places[2][5])]  # a shared one and one of the last shot's own
    fewer = arrow.without(gone)
    whole = dense(arrow)
    whole[:, gone] = 0.0
    assert fewer.shared == 3 and np.allclose(dense(fewer), whole)


@pytest.mark.parametrize("seed", range(3))
def test_further_columns_that_all_shots_share_stand_before_their_own(seed: int) -> None:
    arrow = mixed(drawn(seed), seed)
    added = [np.random.default_rng(k).standard_normal((len(block), 2)) for k, block in enumerate(arrow.blocks)]
    wider = arrow.with_shared(added)
    assert (wider.shared, wider.size) == (arrow.shared + 2, arrow.size + 2)
    assert np.array_equal(dense(wider), np.hstack([dense(arrow), np.concatenate(added)]))
    rows = np.random.default_rng(seed).standard_normal(len(dense(wider)))
    assert np.allclose(wider.solve(rows), np.linalg.lstsq(dense(wider), rows, rcond=None)[0])

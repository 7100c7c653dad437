"""Sums of four numbers side by side: the same, to the bit, as four sums of single numbers."""

import numpy as np
import pytest

from analysis.compiled import add_product, add_products, four_of, four_zeros, kernel, put_four


@kernel
def _at_once(weights, rows, also, others, out):  # type: ignore[no-untyped-def]
    for k in range(0, out.size, 4):
        total = four_zeros()
        for j in range(weights.size):
            total = add_products(total, weights[j], four_of(rows[j], k), also[j], four_of(others[j], k))
        for j in range(weights.size):
            total = add_product(total, also[j], four_of(rows[j], k))
        put_four(total, out, k)


@pytest.mark.parametrize("width", [4, 12])
def test_four_sums_are_those_of_single_numbers(width: int) -> None:
    random = np.random.default_rng(3)
    weights, also = random.standard_normal((2, 7)) * 10.0 ** random.integers(-9, 9, (2, 7))
    rows, others = random.standard_normal((2, 7, 1 + width))  # one number on: rows begin anywhere
    out = np.full(2 + width, np.nan)
    _at_once(weights, rows[:, 1:].copy(), also, others[:, 1:].copy(), out[1:-1])
    expected = np.zeros(width)
    for j in range(7):
        expected += weights[j] * rows[j, 1:] + also[j] * others[j, 1:]
    for j in range(7):
        expected += also[j] * rows[j, 1:]
    assert np.array_equal(out[1:-1], expected) and np.isnan(out[[0, -1]]).all()


def test_a_number_that_is_not_finite_stays_in_its_place() -> None:
    rows = np.ones((1, 4))
    rows[0, 2] = np.inf
    out = np.empty(4)
    _at_once(np.ones(1), rows, np.zeros(1), np.ones((1, 4)), out)
    assert np.isnan(out[2]) and out[[0, 1, 3]].tolist() == [1.0, 1.0, 1.0]

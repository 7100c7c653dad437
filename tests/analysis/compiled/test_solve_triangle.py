"""Triangular systems: the solution is scipy's, and other threads go on meanwhile."""

import itertools
import threading
import time

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from analysis.compiled import solve_triangle

SEED = 12


@pytest.mark.parametrize("lower", [True, False])
@pytest.mark.parametrize("transposed", [True, False])
def test_a_triangle_is_solved_as_scipy_does(lower: bool, transposed: bool) -> None:
    random = np.random.default_rng(SEED)
    for size, columns, by_rows in itertools.product((1, 3, 40), ((), (1,), (7,)), (True, False)):
        # the other half is filled too, as it is not to be read
        triangle = np.array(random.standard_normal((size, size)) + 5 * np.eye(size), order="C" if by_rows else "F")
        rows = random.standard_normal((size, *columns))
        before = rows.copy()
        expected = solve_triangular(triangle, rows, lower=lower, trans="T" if transposed else "N")
        found = solve_triangle(triangle, rows, lower=lower, transposed=transposed)
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-12)
        assert np.array_equal(rows, before)


def test_nothing_to_solve_is_no_error() -> None:
    assert solve_triangle(np.eye(3), np.zeros((3, 0)), lower=True).shape == (3, 0)
    assert solve_triangle(np.zeros((0, 0)), np.zeros((0, 4)), lower=True).shape == (0, 4)


def test_rows_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="is not solved with rows"):
        solve_triangle(np.eye(3), np.zeros(4), lower=True)


def test_another_thread_goes_on_meanwhile() -> None:
    triangle, rows = np.tri(1500) + 1500 * np.eye(1500), np.ones((1500, 2400), order="F")
    done = threading.Event()
    took_s = 0.0

    def solve() -> None:
        nonlocal took_s
        began = time.perf_counter()
        solve_triangle(triangle, rows, lower=True)
        took_s = time.perf_counter() - began
        done.set()

    thread = threading.Thread(target=solve)
    thread.start()
    longest_s, last = 0.0, time.perf_counter()
    while not done.is_set():
        now = time.perf_counter()
        longest_s, last = max(longest_s, now - last), now
    thread.join()
    assert longest_s < 0.5 * took_s

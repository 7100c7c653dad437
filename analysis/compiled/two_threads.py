"""Run work in two threads: independent items in parallel, and triangular systems by BLAS.

Kernels release Python's interpreter lock; scipy's own wrappers of BLAS hold it.
"""

import ctypes
import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numba.extending import get_cython_function_address
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Item = TypeVar("Item")
Result = TypeVar("Result")
_POOL = ThreadPoolExecutor(16)  # more threads than cores, because some wait for work that they have started


class _Idle:
    """The number of idle cores; negative if several callers work at once."""

    def __init__(self, count: int) -> None:
        self._count, self._lock = count, threading.Lock()

    def take(self) -> bool:
        """Reserve a core if one is idle, and return whether one was."""
        with self._lock:
            if self._count <= 0:
                return False
            self._count -= 1
            return True

    def change(self, by: int) -> None:
        """Count a core as idle (+1) or as busy (-1); never waits."""
        with self._lock:
            self._count += by


_idle = _Idle(1)  # in addition to the caller's core


def side_by_side(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return ``function`` of every item, in order, computed on this core and on a second core if one is idle.

    Calls may be nested.  After an error no further item starts; of several errors, that of the first item is raised.
    """
    waiting = deque(enumerate(items))
    done: dict[int, Result] = {}
    errors: dict[int, BaseException] = {}

    def compute_next() -> None:
        try:
            place, item = waiting.popleft()
        except IndexError:  # the other thread has taken the last one
            return
        try:
            done[place] = function(item)
        except BaseException as error:  # raised in the calling thread
            errors[place] = error

    def help_out() -> None:
        try:
            while waiting and not errors:
                compute_next()
        finally:
            _idle.change(+1)

    helper: Future[None] | None = None
    while waiting and not errors:
        if helper is None and len(waiting) > 1 and _idle.take():
            helper = _POOL.submit(help_out)
        compute_next()
    if helper is not None:
        _idle.change(+1)  # this core, for nested work of the helper; or the core of a helper that has not started
        if not helper.cancel():  # the helper has started, as in nearly all cases
            helper.result()
            _idle.change(-1)
    if errors:
        raise errors[min(errors)]
    return [done[place] for place in range(len(done))]


_ONE = ctypes.byref(ctypes.c_double(1.0))
_ARGUMENTS = 11  # number of dtrsm's arguments: side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb


def _solver() -> Callable[..., None]:
    """Return the BLAS function dtrsm, as scipy exports it to compiled code."""
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * _ARGUMENTS)
    return kind(get_cython_function_address("scipy.linalg.cython_blas", "dtrsm"))


_dtrsm = _solver()


def solve_triangle(triangle: Floats, rows: Floats, *, lower: bool, transposed: bool = False) -> Floats:
    """Return the inverse of a triangular matrix, shape (r, r), times ``rows``, shape (r,) or (r, k).

    ``transposed``: the inverse of its transpose.  The other half of the matrix is not read, and values are not checked:
    a zero on the diagonal gives infinities.  Cost: r^2 k / 2 multiply-adds.  Raises ValueError if the shapes do not
    match.
    """
    size = triangle.shape[0]
    if triangle.shape != (size, size) or rows.shape[:1] != (size,):
        raise ValueError(f"a matrix of shape {triangle.shape} is not solved with rows of shape {rows.shape}")
    by_rows = triangle.flags.c_contiguous  # BLAS reads this order as the transpose
    matrix = triangle if by_rows else np.asfortranarray(triangle, dtype=np.float64)
    out = np.array(rows, dtype=np.float64, order="F")
    if not out.size:
        return out
    _dtrsm(
        b"L",
        b"L" if lower != by_rows else b"U",
        b"T" if transposed != by_rows else b"N",
        b"N",
        ctypes.byref(ctypes.c_int(size)),
        ctypes.byref(ctypes.c_int(out.size // size)),
        _ONE,
        matrix.ctypes.data,
        ctypes.byref(ctypes.c_int(size)),
        out.ctypes.data,
        ctypes.byref(ctypes.c_int(size)),
    )
    return out

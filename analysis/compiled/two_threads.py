"""Work in two threads, as kernels release the interpreter: independent items side by side, triangular systems by BLAS.

scipy's own wrappers of BLAS hold the interpreter meanwhile.
"""

import ctypes
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

import numpy as np
from numba.extending import get_cython_function_address
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Item = TypeVar("Item")
Result = TypeVar("Result")
_POOL = ThreadPoolExecutor(16)  # more threads than cores, as some wait for work that they have started


class _Idle:
    """The number of idle cores; below zero if several callers work at once."""

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
        """Count a core as idle (+1) or as working (-1); never waits."""
        with self._lock:
            self._count += by


_idle = _Idle(1)  # besides the caller's own


def side_by_side(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return ``function`` of every item, in order, computed on this core and on another one if it is idle.

    Calls may be nested.  After an error no further item is begun; of several errors that of the first item is raised.
    """
    shared = _Shared(function, list(items))
    helper: Future[None] | None = None
    while (place := shared.next_place()) is not None:
        if helper is None and shared.waiting and _idle.take():
            helper = _POOL.submit(shared.help_out)
        shared.do(place)
    if helper is not None:
        _idle.change(+1)  # this core, for nested work of the helper; or the helper's core if it has not begun
        if not helper.cancel():  # it has begun, as nearly always
            helper.result()
            _idle.change(-1)
    return shared.results()


class _Shared(Generic[Item, Result]):
    """Items that the caller and its helper work through."""

    def __init__(self, function: Callable[[Item], Result], items: Sequence[Item]) -> None:
        self._function, self._items = function, items
        self._done: dict[int, Result] = {}
        self._errors: dict[int, BaseException] = {}
        self._next, self._lock = 0, threading.Lock()

    @property
    def waiting(self) -> bool:
        """Get whether an item is left to begin."""
        return self._next < len(self._items) and not self._errors

    def next_place(self) -> int | None:
        """Return the place of the next item, None if none is left."""
        with self._lock:
            if not self.waiting:
                return None
            self._next += 1
            return self._next - 1

    def do(self, place: int) -> None:
        """Compute one item and keep its result or error."""
        try:
            self._done[place] = self._function(self._items[place])
        except BaseException as error:  # raised in the calling thread
            self._errors[place] = error

    def help_out(self) -> None:
        """Compute the remaining items, on a core that was idle."""
        try:
            while (place := self.next_place()) is not None:
                self.do(place)
        finally:
            _idle.change(+1)

    def results(self) -> list[Result]:
        """Return the results in order, or raise the first error."""
        if self._errors:
            raise self._errors[min(self._errors)]
        return [self._done[place] for place in range(len(self._items))]


_ONE = ctypes.byref(ctypes.c_double(1.0))
_ARGUMENTS = 11  # of dtrsm: side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb


def _solver() -> Callable[..., None]:
    """Return BLAS' dtrsm, as scipy offers it to compiled code."""
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * _ARGUMENTS)
    return kind(get_cython_function_address("scipy.linalg.cython_blas", "dtrsm"))


_dtrsm = _solver()


def solve_triangle(
    triangle: Floats, rows: Floats, *, lower: bool, transposed: bool = False, in_place: bool = False
) -> Floats:
    """Return the inverse of a triangular matrix, shape (r, r), times ``rows``, shape (r,) or (r, k).

    ``transposed``: the inverse of its transpose; ``in_place``: rows in the order of Fortran are overwritten.  The other
    half of the matrix is not read, and nothing is checked: a zero on the diagonal gives infinities.  Cost: r^2 k / 2
    multiply-adds.  Raises ValueError where shapes do not fit.
    """
    size = triangle.shape[0]
    if triangle.shape != (size, size) or rows.shape[:1] != (size,):
        raise ValueError(f"a matrix of shape {triangle.shape} is not solved with rows of shape {rows.shape}")
    by_rows = triangle.flags.c_contiguous  # which BLAS takes for the transpose
    matrix = triangle if by_rows else np.asfortranarray(triangle, dtype=np.float64)
    out = np.array(rows, dtype=np.float64, order="F", copy=not in_place or None)
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

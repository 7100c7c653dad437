"""Run work in two threads: independent items in parallel, and triangular systems by BLAS.

Kernels release Python's interpreter lock; scipy's own wrappers of BLAS hold it.
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
    shared = _Shared(function, list(items))
    helper: Future[None] | None = None
    while (place := shared.next_place()) is not None:
        if helper is None and shared.waiting and _idle.take():
            helper = _POOL.submit(shared.help_out)
        shared.do(place)
    if helper is not None:
        _idle.change(+1)  # this core, for nested work of the helper; or the core of a helper that has not started
        if not helper.cancel():  # the helper has started, as in nearly all cases
            helper.result()
            _idle.change(-1)
    return shared.results()


class _Shared(Generic[Item, Result]):
    """The items that the caller and its helper process."""

    def __init__(self, function: Callable[[Item], Result], items: Sequence[Item]) -> None:
        self._function, self._items = function, items
        self._done: dict[int, Result] = {}
        self._errors: dict[int, BaseException] = {}
        self._next, self._lock = 0, threading.Lock()

    @property
    def waiting(self) -> bool:
        """Get whether an item remains to be started."""
        return self._next < len(self._items) and not self._errors

    def next_place(self) -> int | None:
        """Return the index of the next item, or None if none remains."""
        with self._lock:
            if not self.waiting:
                return None
            self._next += 1
            return self._next - 1

    def do(self, place: int) -> None:
        """Compute one item and store its result or error."""
        try:
            self._done[place] = self._function(self._items[place])
        except BaseException as error:  # raised in the calling thread
            self._errors[place] = error

    def help_out(self) -> None:
        """Compute the remaining items on a core that was idle."""
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

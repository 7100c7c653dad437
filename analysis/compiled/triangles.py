"""Triangular systems solved by BLAS while other threads go on; scipy's own wrappers hold the interpreter meanwhile."""

import ctypes
from collections.abc import Callable

import numpy as np
from numba.extending import get_cython_function_address
from numpy.typing import NDArray

Floats = NDArray[np.float64]
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

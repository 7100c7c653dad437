"""The matrix of the normal equations, J^T J, of shots that only shared parameters couple.

Each shot's own parameters are eliminated within the shot (the Schur complement), so the time of a solution grows with
the number of shots and not with its cube (Golub and Van Loan, "Matrix Computations", section 3.2).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.shot import Floats

Places = NDArray[np.intp]
_SINGULAR = 1e-13  # least over largest eigenvalue, of parameters in units of their conditional standard deviations


@njit(cache=True, nogil=True, error_model="numpy")
def _factor(matrix):  # type: ignore[no-untyped-def]
    """Write the lower Cholesky factor of a matrix, shape (n, n), in its place; False if it is not positive definite."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= matrix[i, k] * matrix[j, k]
            if i != j:
                matrix[i, j] = left / matrix[j, j]
            elif left > 0.0:
                matrix[i, i] = math.sqrt(left)
            else:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _lower(factor, columns):  # type: ignore[no-untyped-def]
    """Solve factor x = columns, shape (n, k), in place, for a lower triangle."""
    for i in range(factor.shape[0]):
        for c in range(columns.shape[1]):
            left = columns[i, c]
            for k in range(i):
                left -= factor[i, k] * columns[k, c]
            columns[i, c] = left / factor[i, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _upper(factor, column):  # type: ignore[no-untyped-def]
    """Solve factor^T x = column, shape (n,), in place, for a lower triangle."""
    for i in range(factor.shape[0] - 1, -1, -1):
        left = column[i]
        for k in range(i + 1, factor.shape[0]):
            left -= factor[k, i] * column[k]
        column[i] = left / factor[i, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _times(shared, cross, own, shared_at, own_at, vector):  # type: ignore[no-untyped-def]
    """Return the matrix times a vector, shape (p,); cost: (q + s)^2 multiply-adds per shot."""
    shots, q, s = cross.shape
    out = np.zeros(vector.size)
    for i in range(s):
        for j in range(s):
            out[shared_at[i]] += shared[i, j] * vector[shared_at[j]]
    for k in range(shots):
        for i in range(q):
            at = own_at[k, i]
            for j in range(s):
                out[at] += cross[k, i, j] * vector[shared_at[j]]
                out[shared_at[j]] += cross[k, i, j] * vector[at]
            for j in range(q):
                out[at] += own[k, i, j] * vector[own_at[k, j]]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(shared, cross, own, shared_at, own_at, unit, free, damping, out):  # type: ignore  # noqa: C901, PLR0913
    """Write the solution, zero where not ``free``, in place of the right-hand side ``out``, shape (p,).

    The matrix is scaled by ``unit``, shape (p,), to unit diagonal, or zero for a parameter that moves nothing.  Returns
    False if it is singular.  Cost: q (q^2 / 3 + q s + s^2) multiply-adds per shot and s^3 / 3.
    """
    shots, q, s = cross.shape
    out *= unit
    factors, beside = np.zeros((shots, q, q)), np.zeros((shots, q, s + 1))
    top, rest = np.zeros((s, s)), np.zeros((s, 1))
    for i in range(s):
        at = shared_at[i]
        if free[at]:
            rest[i, 0] = out[at]
            for j in range(s):
                if free[shared_at[j]]:
                    top[i, j] = shared[i, j] * (unit[at] * unit[shared_at[j]])
            top[i, i] += damping
        else:
            top[i, i] = 1.0
    for k in range(shots):
        factor, sides = factors[k], beside[k]
        for i in range(q):
            at = own_at[k, i]
            if free[at]:
                sides[i, s] = out[at]
                for j in range(q):
                    if free[own_at[k, j]]:
                        factor[i, j] = own[k, i, j] * (unit[at] * unit[own_at[k, j]])
                for j in range(s):
                    if free[shared_at[j]]:
                        sides[i, j] = cross[k, i, j] * (unit[at] * unit[shared_at[j]])
                factor[i, i] += damping
            else:
                factor[i, i] = 1.0
        if not _factor(factor):
            return False
        _lower(factor, sides)
        for i in range(s):
            for c in range(q):
                rest[i, 0] -= sides[c, i] * sides[c, s]
                for j in range(i + 1):
                    top[i, j] -= sides[c, i] * sides[c, j]
    if not _factor(top):
        return False
    _lower(top, rest)
    right = rest[:, 0].copy()
    _upper(top, right)
    for i in range(s):
        out[shared_at[i]] = right[i] * unit[shared_at[i]]
    for k in range(shots):
        column = beside[k, :, s].copy()
        for i in range(q):
            for j in range(s):
                column[i] -= beside[k, i, j] * right[j]
        _upper(factors[k], column)
        for i in range(q):
            out[own_at[k, i]] = column[i] * unit[own_at[k, i]]
    return True


@dataclass(frozen=True, slots=True)
class NormalMatrix:
    """J^T J of p parameters: s shared ones, and q of each shot.

    ``shared``, shape (s, s), ``own``, shape (shots, q, q), and ``cross``, shape (shots, q, s), are its blocks;
    ``shared_at``, shape (s,), and ``own_at``, shape (shots, q), are the indices of their parameters.
    """

    shared: Floats
    cross: Floats
    own: Floats
    shared_at: Places
    own_at: Places

    @classmethod
    def of(cls, matrix: Floats) -> "NormalMatrix":
        """Return a matrix, shape (p, p), all of whose parameters are shared."""
        p = len(matrix)
        return cls(matrix, np.zeros((0, 0, p)), np.zeros((0, 0, 0)), np.arange(p), np.zeros((0, 0), np.intp))

    @property
    def size(self) -> int:
        """Get the number of parameters p."""
        return int(self.shared_at.size + self.own_at.size)

    @property
    def diagonal(self) -> Floats:
        """Get the diagonal, shape (p,)."""
        out = np.empty(self.size)
        out[self.shared_at], out[self.own_at] = np.diag(self.shared), np.einsum("kii->ki", self.own)
        return out

    def __matmul__(self, vector: Floats) -> Floats:
        """Return the matrix times a vector, shape (p,)."""
        out: Floats = _times(self.shared, self.cross, self.own, self.shared_at, self.own_at, vector)
        return out

    def dense(self) -> Floats:
        """Return the whole matrix, shape (p, p)."""
        out = np.zeros((self.size, self.size))
        out[np.ix_(self.shared_at, self.shared_at)] = self.shared
        out[self.own_at[:, :, None], self.shared_at] = self.cross
        out[self.shared_at[:, None], self.own_at[:, None, :]] = self.cross.transpose(0, 2, 1)
        out[self.own_at[:, :, None], self.own_at[:, None, :]] = self.own
        return out

    def solve(self, right: Floats, free: NDArray[np.bool_] | None = None, damping: float = 0.0) -> Floats | None:
        """Return x with (A + damping diag A) x = ``right``, zero where not ``free``; None if that is singular.

        Both have shape (p,).  Damping shortens a step most in poorly determined directions, along which valleys curve
        (Marquardt).
        """
        free = np.ones(self.size, np.bool_) if free is None else free
        unit = 1.0 / np.sqrt(np.maximum(self.diagonal, 1e-300))
        out = right.copy()
        blocks = self.shared, self.cross, self.own, self.shared_at, self.own_at
        solved = _solve(*blocks, unit, free, damping, out)
        return out if solved and np.all(np.isfinite(out)) else None

    def inverse(self, free: NDArray[np.bool_] | None = None) -> Floats | None:
        """Return the inverse, shape (p, p), over the ``free`` parameters, else zero; None if singular to rounding."""
        free = np.ones(self.size, np.bool_) if free is None else free
        diagonal = np.where(free, self.diagonal, 1.0)
        if not np.all(diagonal > 0):
            return None
        unit = np.where(free, 1.0 / np.sqrt(diagonal), 0.0)
        of_shared, of_own = unit[self.shared_at], unit[self.own_at]
        # scaled to unit diagonal; zero beside the diagonal where not free
        shared = self.shared * np.outer(of_shared, of_shared)
        cross = self.cross * of_own[:, :, None] * of_shared
        own = self.own * of_own[:, :, None] * of_own[:, None, :]
        np.fill_diagonal(shared, 1.0)
        np.einsum("kii->ki", own)[:] = 1.0
        level, turn = np.linalg.eigh(own)
        if level.min(initial=1.0) < _SINGULAR:
            return None
        own = (turn / level[:, None, :]) @ turn.transpose(0, 2, 1)
        give = own @ cross
        level, turn = np.linalg.eigh(shared - np.tensordot(cross, give, ((0, 1), (0, 1))))
        if level[0] < _SINGULAR * max(1.0, level[-1]):
            return None
        shared = (turn / level) @ turn.T
        across = -give @ shared
        out = replace(self, shared=shared, cross=across, own=own).dense()
        every = self.own_at.ravel()
        out[np.ix_(every, every)] -= across.reshape(every.size, len(level)) @ give.reshape(every.size, len(level)).T
        out *= unit
        out *= unit[:, None]
        return out

    def least(self, right: Floats, free: NDArray[np.bool_]) -> Floats:
        """Return the solution of ``solve``, about zero in directions singular to rounding.  Raises LinAlgError."""
        solution = self.solve(right, free, _SINGULAR)
        if solution is None:
            raise np.linalg.LinAlgError("the derivatives are not finite")
        return solution

    def followed(self, places: Places, free: NDArray[np.bool_]) -> Floats:
        """Return the motion of all parameters per motion of each of ``places``, shape (p, len(places)).

        Those ``free`` follow to the least chi^2, the others stay.  Raises LinAlgError.
        """
        out = np.zeros((self.size, len(places)))
        out[places, range(len(places))] = 1.0
        for column in out.T:
            column += self.least(-(self @ column), free)
        return out

    def renumbered(self, order: Places) -> "NormalMatrix":
        """Return the matrix of the parameters in another ``order``, shape (p,), of their present indices."""
        now = np.argsort(order)
        return replace(self, shared_at=now[self.shared_at], own_at=now[self.own_at])

    def without_own(self, gradient: Floats) -> tuple[Floats, Floats, float]:
        """Return matrix and gradient of the shared parameters with the others re-optimised, and the fall of chi^2."""
        of_own = np.linalg.pinv(self.own, hermitian=True)
        pull = gradient[self.own_at]
        into = self.cross.transpose(0, 2, 1) @ of_own
        rest = gradient[self.shared_at] - np.einsum("ksq,kq->s", into, pull)
        return (
            self.shared - np.tensordot(into, self.cross, ((0, 2), (0, 1))),
            rest,
            float(np.einsum("kq,kqr,kr->", pull, of_own, pull)),
        )


@dataclass(frozen=True, slots=True)
class Square:
    """A whitened sum of squares at one point: chi^2, J^T J, J^T r, shape (p,), and number of samples.

    ``residual`` r, shape (n,), ``along(step)`` = J step and ``pull(vector)`` = J^T vector are used to correct steps in
    curved valleys; None for a search without corrections.
    """

    chi2: float
    curvature: NormalMatrix
    gradient: Floats
    samples: int
    residual: Floats | None = None
    along: Callable[[Floats], Floats] | None = None
    pull: Callable[[Floats], Floats] | None = None

    def followed(self, moved: Floats, own: Sequence[int]) -> Floats:
        """Return the first-order step that re-optimises the parameters at ``own`` after the others have ``moved``."""
        free = np.isin(np.arange(moved.size), own)
        return self.curvature.least(-(self.gradient + self.curvature @ moved), free)[own]

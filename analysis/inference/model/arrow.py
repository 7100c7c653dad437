"""Block-arrow matrices: columns of parameters shared by all shots, and columns of each shot's own parameters.

Only the shared parameters couple shots.  The matrices are stored and solved shot by shot, so time and memory grow with
the number of shots, not with its square.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.inference.model.normal_matrix import NormalMatrix, Places
from analysis.shot import Floats

if TYPE_CHECKING:
    from analysis.inference.model.samples import Samples
    from analysis.inference.noise.floor import Floor

_DEPENDENT = 1e-9  # relative length after projection below which a column depends linearly on the others
_SPANNED = 1e-6  # the same after projection off all fitted parameters
_ROUNDING = 1e-12  # fraction of the largest singular value treated as zero


@dataclass(frozen=True, slots=True)
class Arrow:
    """A block-arrow matrix: ``blocks``, shape (n, s + q) per shot, hold the s ``shared`` columns, then its own q.

    ``places``, shape (s + q,) per shot, are the indices of these columns in a vector of ``size`` parameters.
    """

    blocks: tuple[Floats, ...]
    shared: int
    places: tuple[Places, ...]
    size: int

    @classmethod
    def of(cls, blocks: Sequence[Floats], shared: int) -> "Arrow":
        """Return the matrix for a vector of the shared parameters, followed by each shot's own, shot by shot."""
        ends = np.cumsum([shared, *(block.shape[1] - shared for block in blocks)])
        places = [np.concatenate([np.arange(shared), np.arange(*ends[k : k + 2])]) for k in range(len(blocks))]
        return cls(tuple(blocks), shared, tuple(place.astype(np.intp) for place in places), int(ends[-1]))

    def mapped(self, turn: Callable[[int, Floats], Floats]) -> "Arrow":
        """Return the matrix with each block replaced by ``turn(shot, block)``, which has the same columns."""
        return replace(self, blocks=tuple(turn(k, block) for k, block in enumerate(self.blocks)))

    def whitened(self, shots: Sequence["Samples"], noise: "Floor") -> "Arrow":
        """Return the matrix whitened by a noise; its rows are then the valid averaged samples only."""
        return self.mapped(lambda k, block: shots[k].whitened(noise, block))

    def without(self, numbers: Iterable[int]) -> "Arrow":
        """Return the matrix without the columns of these parameters; the others keep their indices."""
        gone = np.fromiter(numbers, np.intp)
        kept = [~np.isin(place, gone) for place in self.places]
        blocks = tuple(block[:, keep] for block, keep in zip(self.blocks, kept, strict=True))
        places = tuple(place[keep] for place, keep in zip(self.places, kept, strict=True))
        shared = int(kept[0][: self.shared].sum())
        return Arrow(blocks, shared, places, self.size)

    def with_shared(self, columns: Sequence[Floats]) -> "Arrow":
        """Return the matrix with further shared columns, shape (n, k) per shot; their parameters follow the others."""
        s, added = self.shared, np.arange(self.size, self.size + columns[0].shape[1])
        both = zip(self.blocks, columns, strict=True)
        blocks = tuple(np.hstack([block[:, :s], more, block[:, s:]]) for block, more in both)
        places = tuple(np.concatenate([at[:s], added, at[s:]]) for at in self.places)
        return Arrow(blocks, s + added.size, places, self.size + added.size)

    def parts(self, rows: Floats) -> list[Floats]:
        """Return ``rows`` of all shots, one after another, as a list by shot."""
        return _split(rows, self.blocks)

    def along(self, numbers: Floats) -> Floats:
        """Return the matrix times ``numbers``, shape (size,): shape (rows,)."""
        return np.concatenate([block @ numbers[at] for block, at in zip(self.blocks, self.places, strict=True)])

    def pull(self, rows: Floats) -> Floats:
        """Return the transposed matrix times ``rows``: shape (size,)."""
        out = np.zeros(self.size)
        for block, at, part in zip(self.blocks, self.places, self.parts(rows), strict=True):
            out[at] += block.T @ part
        return out

    def normal_matrix(self) -> NormalMatrix:
        """Return the transposed matrix times itself, shot by shot; every shot must have as many columns."""
        s = self.shared
        squares = np.stack([block.T @ block for block in self.blocks])
        places = np.stack(self.places)
        return NormalMatrix(
            squares[:, :s, :s].sum(axis=0), squares[:, s:, :s], squares[:, s:, s:], places[0, :s], places[:, s:]
        )

    def span(self) -> "OrthonormalBasis":
        """Return an orthonormal basis of the columns; cost: 4 n (s + q)^2 multiply-adds per shot."""
        norm = np.sqrt(sum((np.sum(block[:, : self.shared] ** 2, axis=0) for block in self.blocks), np.zeros(1)))
        norm = np.where(norm > 0, norm, 1.0)
        own = tuple(orthonormal(block[:, self.shared :]) for block in self.blocks)
        beside = [
            _projected_off(basis, block[:, : self.shared] / norm) for basis, block in zip(own, self.blocks, strict=True)
        ]
        return OrthonormalBasis(own, tuple(self.parts(_independent(np.concatenate(beside)))))

    def solve(self, rows: Floats) -> Floats:
        """Return the least-squares solution for ``rows``, shape (size,); the shortest if it is not unique."""
        shared = np.zeros(0)
        if self.shared:
            triangle: Floats = np.asarray(np.linalg.qr(np.concatenate(self.off_own(rows)), mode="r"))
            shared = _least_squares(triangle[:, :-1], triangle[:, -1])
        return self.with_own(shared, rows)

    def off_own(self, rows: Floats) -> list[Floats]:
        """Return (shared columns, ``rows``), shape (n, s + 1) per shot, with the shot's own columns projected off."""
        return [
            _projected_off(orthonormal(block[:, self.shared :]), np.column_stack([block[:, : self.shared], part]))
            for block, part in zip(self.blocks, self.parts(rows), strict=True)
        ]

    def with_own(self, shared: Floats, rows: Floats) -> Floats:
        """Return the least-squares solution for ``rows``, shape (size,), with ``shared`` parameters, shape (s,)."""
        out = np.zeros(self.size)
        for block, at, part in zip(self.blocks, self.places, self.parts(rows), strict=True):
            out[at[: self.shared]] = shared
            out[at[self.shared :]] = _least_squares(block[:, self.shared :], part - block[:, : self.shared] @ shared)
        return out


@dataclass(frozen=True, slots=True)
class OrthonormalBasis:
    """An orthonormal basis: per shot the ``own`` vectors, shape (n, k), and its rows of the ``shared`` ones, (n, s)."""

    own: tuple[Floats, ...]
    shared: tuple[Floats, ...]

    def projected(self, rows: Floats) -> Floats:
        """Return ``rows`` of all shots, shape (rows,) or (rows, k), with their projection on the basis subtracted."""
        parts = [_projected_off(basis, part) for basis, part in zip(self.own, _split(rows, self.own), strict=True)]
        along = sum(basis.T @ part for basis, part in zip(self.shared, parts, strict=True))
        return np.concatenate([part - basis @ along for basis, part in zip(self.shared, parts, strict=True)])

    def projected_columns(self, columns: Arrow) -> "ProjectedColumns":
        """Return ``columns`` projected off the basis; cost: 2 n (k + s) multiply-adds per column and shot."""
        norm, s = np.zeros(columns.size), self.shared[0].shape[1]
        for block, at in zip(columns.blocks, columns.places, strict=True):
            norm[at] += np.einsum("ij,ij->j", block, block)
        left = columns.mapped(lambda k, block: _projected_off(self.own[k], block))
        normal = left.with_shared(self.shared).normal_matrix()
        basis, shared = slice(columns.shared, columns.shared + s), slice(columns.shared)
        power = normal.diagonal[: columns.size]
        power[normal.shared_at[shared]] -= np.sum(normal.shared[shared, basis] ** 2, axis=1)
        power[normal.own_at] -= np.sum(normal.cross[:, :, basis] ** 2, axis=2)
        return ProjectedColumns(columns, power, power > _SPANNED**2 * np.where(norm > 0.0, norm, 1.0), normal)


@dataclass(frozen=True, slots=True)
class ProjectedColumns:
    """Columns projected off a basis: their squared norm ``power`` after, and which are linearly independent of it.

    ``normal`` is the matrix of the normal equations of the columns, followed by the basis vectors that shots share.
    """

    columns: Arrow
    power: Floats
    new: NDArray[np.bool_]
    normal: NormalMatrix

    def solve(self, left: Floats) -> Floats:
        """Return the least-squares solution, shape (size,), for a residual ``left`` also projected off the basis."""
        of_basis = np.zeros(self.normal.size - self.columns.size)  # ``left`` has no part along it
        right = np.concatenate([self.columns.pull(left), of_basis])
        free = np.concatenate([self.new, of_basis == 0.0])
        return self.normal.least(right, free)[: self.columns.size]


def _split(rows: Floats, like: Sequence[Floats]) -> list[Floats]:
    """Split ``rows`` of all shots into a list by shot, with the row counts of the matrices in ``like``."""
    edges = np.cumsum([0, *(len(block) for block in like)])
    return [rows[begin:end] for begin, end in pairwise(edges)]


def orthonormal(columns: Floats) -> Floats:
    """Return an orthonormal basis of ``columns``, shape (rows, k), with at most k columns."""
    scale = np.linalg.norm(columns, axis=0)
    return _independent(columns / np.where(scale > 0, scale, 1.0))


def _independent(columns: Floats) -> Floats:
    """Return an orthonormal basis of columns of length about one, without linearly dependent ones."""
    while True:
        basis, triangle = np.linalg.qr(columns)
        mixture = np.abs(np.diag(triangle)) <= _DEPENDENT
        if not mixture.any():
            return np.asarray(basis)
        # The rounding residual of a dependent column has a random direction: do not project later columns off it.
        columns = np.delete(columns, int(mixture.argmax()), axis=1)


def _projected_off(basis: Floats, rows: Floats) -> Floats:
    return np.asarray(rows - basis @ (basis.T @ rows))


def _least_squares(columns: Floats, rows: Floats) -> Floats:
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0] = 1.0
    solution, *_ = np.linalg.lstsq(columns / scale, rows, rcond=_ROUNDING)
    return np.asarray(solution / scale)

"""Compute products of one shot's whitened columns without whitening each column for frame motion.

Whitening frame motion changes every column only along a few directions, so projections on these suffice for products.
"""

from dataclasses import dataclass

import numpy as np

from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.shot import Floats


@dataclass(frozen=True, slots=True)
class WhitenedColumns:
    """Columns w, shape (n, k), whitened except for frame motion; fully whitened they are w + C ``moved``.

    C, shape (n, r), are the shot's whitened ``directions``.  ``moved`` and ``half`` have shape (r, k); ``half`` is
    C^T w + C^T C ``moved`` / 2.
    """

    columns: Floats
    directions: Floats
    moved: Floats
    half: Floats

    @classmethod
    def of(cls, shot: Samples, floor: Floor, columns: Floats) -> "WhitenedColumns":
        """Return ``columns``, shape (samples, k) in m, whitened by a noise; cost: n r multiply-adds per column."""
        white = floor.whiten(columns, shot.valid, shot.weight)
        if shot.sway is None or not floor.site:
            nothing = np.zeros((0, white.shape[1]))
            return cls(white, np.zeros((white.shape[0], 0)), nothing, nothing)
        directions = shot.sway.whitened_directions(floor)
        along = directions.columns.T @ white
        moved = shot.sway.whitening_matrix(floor) @ along
        return cls(white, directions.columns, moved, along + 0.5 * (directions.root.T @ (directions.root @ moved)))

    def products_with(self, rows: Floats) -> Floats:
        """Return the products of whitened ``rows``, shape (n, p), with every column, shape (p, k)."""
        return np.asarray(rows.T @ self.columns + (rows.T @ self.directions) @ self.moved)

    def products(self, some: slice = slice(None), others: slice = slice(None)) -> Floats:
        """Return the products of corresponding columns in two slices of equal length."""
        out = column_by_column(self.columns[:, some], self.columns[:, others])
        out += column_by_column(self.half[:, some], self.moved[:, others])
        return np.asarray(out + column_by_column(self.moved[:, some], self.half[:, others]))


def column_by_column(one: Floats, other: Floats) -> Floats:
    """Return the products of corresponding columns of two matrices, shape (n, k) each: shape (k,)."""
    return np.asarray(np.einsum("ij,ij->j", one, other))

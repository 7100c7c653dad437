"""Products of one shot's whitened columns, where whitening the frame's motion is not done column by column.

That whitening adds to every column only along few directions, so products need no more than the projections on these.
"""

from dataclasses import dataclass

import numpy as np

from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.shot import Floats


@dataclass(frozen=True, slots=True)
class WhitenedColumns:
    """Columns w, shape (n, k), whitened except for the frame's motion, whose whitening adds C ``moved``.

    C, shape (n, r), are the shot's whitened ``directions``.  ``half``, like ``moved`` of shape (r, k), is
    C^T w + C^T C ``moved`` / 2.
    """

    columns: Floats
    directions: Floats
    moved: Floats
    half: Floats

    @classmethod
    def of(cls, shot: Samples, floor: Floor, columns: Floats) -> "WhitenedColumns":
        """Return ``columns``, shape (samples, k) in m, whitened by a noise; cost: n r multiply-adds per column."""
        return cls.whitened(shot, floor, floor.whiten(columns, shot.valid, shot.weight))

    @classmethod
    def whitened(cls, shot: Samples, floor: Floor, white: Floats) -> "WhitenedColumns":
        """Return columns, shape (n, k), that are already whitened except for the frame's motion."""
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
        """Return the products of some columns with as many others, each with the one at its place."""
        out = column_by_column(self.columns[:, some], self.columns[:, others])
        out += column_by_column(self.half[:, some], self.moved[:, others])
        return np.asarray(out + column_by_column(self.moved[:, some], self.half[:, others]))


def column_by_column(one: Floats, other: Floats) -> Floats:
    """Return the products of columns, shape (n, k), each with the one at its place in the other."""
    return np.asarray(np.einsum("ij,ij->j", one, other))

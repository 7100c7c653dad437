"""A fit made linear about its best point, and what its own parameters could do taken out of anything else."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.floor import Floor
from analysis.diagnosis.hypothesis_fit import Fitted

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Projector:
    """Takes out what the fitted parameters could do themselves; whitened rows of all shots, one after another."""

    fitted: Fitted
    floor: Floor
    basis: Floats  # orthonormal columns, shape (rows, p)
    left: Floats  # the whitened remainder, projected
    tangents: Floats  # the whitened derivatives by the fitted parameters, shape (rows, p)
    whole: Floats  # the whitened remainder, as it is
    lines: tuple[tuple[Floats, Floats], ...]  # averaged displacement and derivatives, shot by shot
    done: dict[str, Any] = field(default_factory=dict)  # whitened columns of effects already computed here
    bare: dict[str, Any] = field(default_factory=dict)  # and what holds under any floor: paths, columns not whitened
    _doing: dict[str, Lock] = field(default_factory=dict)

    def whitened(self, columns: Sequence[Floats]) -> Floats:
        """Return the whitened rows of columns given shot by shot, each of shape (n, k)."""
        shots = self.fitted.hypothesis.data.shots
        return np.concatenate([s.whitened(self.floor, c) for c, s in zip(columns, shots, strict=True)])

    def once(self, key: str, make: Callable[[], Any], *, under_any_floor: bool = False) -> Any:
        """Return what is known under ``key``, made by the first who asks; others wait for it."""
        known = self.bare if under_any_floor else self.done
        with self._doing.setdefault(f"{key} bare" if under_any_floor else key, Lock()):
            if key not in known:
                known[key] = make()
        return known[key]

    def under(self, floor: Floor) -> "Projector":
        """Return the projector of the same fit beside another floor, which shares what does not depend on it."""
        return projector(self.fitted, floor, self.lines, self.bare)

    def projected(self, rows: Floats) -> Floats:
        """Return ``rows``, shape (rows, k), without what the fitted parameters span."""
        return np.asarray(rows - self.basis @ (self.basis.T @ rows))


def projector(
    fitted: Fitted,
    floor: Floor | None = None,
    lines: Sequence[tuple[Floats, Floats]] | None = None,
    bare: dict[str, Any] | None = None,
) -> Projector:
    """Linearise a fit about its best point.

    ``lines`` are its displacement and derivatives, ``bare`` what else is known of it, where they are.
    """
    floor = floor or fitted.floor
    shots = fitted.hypothesis.data.shots
    lines = lines or fitted.hypothesis.linearised(fitted.z)
    rows = np.concatenate(
        [s.whitened(floor, np.column_stack([s.displacement_m - x, j])) for s, (x, j) in zip(shots, lines, strict=True)]
    )
    basis = orthonormal(rows[:, 1:])
    left = rows[:, 0] - basis @ (basis.T @ rows[:, 0])
    return Projector(
        fitted, floor, basis, left, rows[:, 1:], rows[:, 0], tuple(lines), bare={} if bare is None else bare
    )


def orthonormal(columns: Floats) -> Floats:
    """Return orthonormal columns that span what ``columns``, shape (rows, k), do; at most k."""
    scale = np.linalg.norm(columns, axis=0)
    basis, triangle = np.linalg.qr(columns / np.where(scale > 0, scale, 1.0))
    return np.asarray(basis[:, np.abs(np.diag(triangle)) > 1e-9])

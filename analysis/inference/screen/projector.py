"""A fit linearised at its best point, and projection onto what its own parameters cannot do."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.collision import fastest_rates
from analysis.inference.fit.arrow import Arrow, Span
from analysis.inference.fit.hypothesis_fit import Fitted, whitened_tangents
from analysis.inference.fit.situation import situation
from analysis.inference.noise.floor import Floor

Floats = NDArray[np.float64]
FEW_SHOTS = 8  # up to which columns of effects are kept, some 15 MB per shot
_NEARBY = 0.01  # relative: of a radian of the contact's oscillation, and of a base parameter


@dataclass(frozen=True, slots=True)
class Trajectories:
    """Columns of small effects along the trajectories of a fit, valid for any fit with nearly the same trajectories."""

    fitted: Fitted
    known: dict[str, Any] = field(default_factory=dict)

    def serve(self, other: Fitted) -> bool:
        """Return whether another fit of the same shots has nearly the same trajectories and base parameters."""
        mine, point = self.fitted, self.fitted.point
        if mine is other:
            return True
        if mine.hypothesis.data is not other.hypothesis.data:
            return False
        if not np.allclose(point.base, other.point.base, rtol=_NEARBY, atol=0.0):
            return False
        for index, shot in enumerate(mine.hypothesis.data.shots):
            at = mine.hypothesis.shot_at(index, point)
            collision, _ = situation(at.base, at.own, {}, at.mass_kg)
            swing_m = abs(shot.course.velocity_in_m_per_s) / fastest_rates(collision, []).contact
            moved_m = np.abs(mine.residual_m[index] - other.residual_m[index])[shot.valid]
            if not float(moved_m.max(initial=0.0)) < _NEARBY * swing_m:
                return False
        return True


@dataclass(frozen=True, slots=True)
class Projector:
    """Projects whitened rows of all shots, one after another, off the tangents of the fitted parameters."""

    fitted: Fitted
    floor: Floor
    basis: Span  # of the tangents
    left: Floats  # the whitened residual, projected
    tangents: Arrow  # the whitened derivatives by the fitted parameters
    whole: Floats  # the whitened residual, not projected
    lines: tuple[tuple[Floats, Floats], ...]  # averaged displacement and derivatives, shot by shot
    trajectories: Trajectories  # with unwhitened columns of effects, which other projectors share
    done: dict[str, Any] = field(default_factory=dict)  # whitened columns of effects already computed here
    _doing: dict[str, Lock] = field(default_factory=dict)  # held while a value is computed

    def whitened(self, columns: Sequence[Floats]) -> Floats:
        """Return the whitened rows of columns given shot by shot, each of shape (n, k)."""
        return self.fitted.hypothesis.data.whitened(self.floor, columns)

    def once(self, key: str, make: Callable[[], Any], *, nearby: bool = False) -> Any:
        """Return the cached value of ``key``, computed by the first thread that needs it; others wait.

        ``nearby``: the value depends on the trajectories alone, not on the noise.
        """
        known = self.trajectories.known if nearby else self.done
        with self._doing.setdefault(f"{key} nearby" if nearby else key, Lock()):
            if key not in known:
                known[key] = make()
        return known[key]

    def under(self, floor: Floor) -> "Projector":
        """Return the projector of the same fit under another noise; what does not depend on noise is shared."""
        return projector(self.fitted, floor, near=self)


def projector(fitted: Fitted, floor: Floor | None = None, *, near: Projector | None = None) -> Projector:
    """Linearise a fit at its best point; results of a projector ``near`` it are used as far as they are valid."""
    floor = floor or fitted.floor
    lines = near.lines if near and near.fitted is fitted else tuple(fitted.hypothesis.linearised(fitted.z))
    whole, tangents = whitened_tangents(fitted.hypothesis, floor, lines)
    basis = tangents.span()
    trajectories = near.trajectories if near and near.trajectories.serve(fitted) else Trajectories(fitted)
    return Projector(fitted, floor, basis, basis.projected(whole), tangents, whole, lines, trajectories)

"""Linearise a weighted model at a vector, and project rows off the directions of its own parameters."""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Self

import numpy as np

from analysis.inference.joint.weighted_model import Lines, ModelAtVector, WeightedModel
from analysis.inference.model.arrow import Arrow, OrthonormalBasis
from analysis.inference.noise.floor import Floor
from analysis.shot import Floats

FEW_SHOTS = 8  # maximum number of shots for which columns of effects are cached, about 15 MB per shot
_NEARBY = 0.01  # tolerance for shared trajectories, in radians of the contact's phase and relative in base parameters


@dataclass(frozen=True, slots=True)
class CachedColumns:
    """Cached columns of small effects along the trajectories of a model at ``z``; valid for nearly equal trajectories.

    ``lines`` are the displacement and derivatives at ``z``.
    """

    problem: WeightedModel
    z: Floats
    lines: Lines
    known: dict[str, Any] = field(default_factory=dict)

    def serve(self, problem: WeightedModel, z: Floats, lines: Lines) -> bool:
        """Return whether a model of the same samples has nearly the same trajectories and base parameters at ``z``."""
        mine, others = self.problem.data.shots, problem.data.shots
        if [id(shot.displacement_m) for shot in mine] != [id(shot.displacement_m) for shot in others]:
            return False
        point = self.problem.unpack(self.z)
        if not np.allclose(point.base, problem.unpack(z).base, rtol=_NEARBY, atol=0.0):
            return False
        for index, shot in enumerate(others):
            swing_m = abs(shot.course.velocity_in_m_per_s) / self.problem.shot_at(index, point).rates.bodies
            moved_m = np.abs(self.lines[index][0] - lines[index][0])[shot.valid]
            if not float(moved_m.max(initial=0.0)) < _NEARBY * swing_m:
                return False
        return True


@dataclass(frozen=True)
class Projector(ModelAtVector):
    """Projects whitened rows of all shots, concatenated, off the tangents of the parameters at ``z``."""

    basis: OrthonormalBasis  # of the tangents
    left: Floats  # the whitened residual, projected
    tangents: Arrow  # the whitened derivatives by the parameters
    whole: Floats  # the whitened residual, not projected
    lines: Lines
    trajectories: CachedColumns  # with unwhitened columns of effects, shared with other projectors
    done: dict[str, Any] = field(default_factory=dict)  # cached whitened columns of effects
    _doing: dict[str, Lock] = field(default_factory=dict)  # held while a value is computed

    @classmethod
    def of(cls, problem: WeightedModel, z: Floats, near: "Projector | None" = None) -> Self:
        """Linearise ``problem`` at ``z``; results of a projector ``near`` it are reused as far as they are valid."""
        lines = problem.derivatives(z)
        serves = near is not None and near.trajectories.serve(problem, z, lines)
        return cls._with(problem, z, lines, near.trajectories if near and serves else CachedColumns(problem, z, lines))

    @classmethod
    def _with(cls, problem: WeightedModel, z: Floats, lines: Lines, trajectories: CachedColumns) -> Self:
        whole, tangents = problem.whitened_lines(lines)
        basis = tangents.span()
        return cls(problem, z, basis, basis.projected(whole), tangents, whole, lines, trajectories)

    def under(self, noise: Floor) -> Self:
        """Return the projector under another noise; results that do not depend on noise are shared."""
        return self._with(self.problem.with_noise(noise), self.z, self.lines, self.trajectories)

    def once(self, key: str, make: Callable[[], Any], *, nearby: bool = False) -> Any:
        """Return the cached value of ``key``, computed by the first thread that needs it while others wait.

        ``nearby``: the value depends on the trajectories alone, not on the noise.
        """
        known = self.trajectories.known if nearby else self.done
        with self._doing.setdefault(f"{key} nearby" if nearby else key, Lock()):
            if key not in known:
                known[key] = make()
        return known[key]

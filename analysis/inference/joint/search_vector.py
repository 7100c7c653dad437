"""The parameter vector of a search: order, names, bounds, and conversion to physical parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from analysis.collision import Effect, Parameter
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.arrow import Arrow
from analysis.inference.model.base import OWN_NAMES
from analysis.inference.model.coordinates import Coordinates
from analysis.inference.model.effective_parameters import Point, Values, physical_derivatives, to_effective, to_physical
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.model.normal_matrix import Places
from analysis.inference.model.response import STRIDE, ShotModel
from analysis.shot import Floats

_BELOW = 0.8  # lower bound of a line's frequency, as a fraction of the lowest frequency that is searched


@dataclass(frozen=True)
class SearchVector:
    """The parameters of base model and ``effects`` (in that order), laid out as one vector over all shots.

    It holds the base and per-shot parameters in ``Coordinates``, then each effect's shared free parameters, then every
    effect's per-shot ones; all are effective parameters (``to_effective``).  ``fixed`` holds values that are not fitted
    (the order of a cyclic error).
    """

    data: JointData
    effects: tuple[TrialEffect, ...]
    fixed: Values = field(default_factory=dict, kw_only=True)
    stride: float = field(default=STRIDE, kw_only=True)  # of ``general.solve``, for the displacement

    @cached_property
    def free_parameters(self) -> list[tuple[Effect, Parameter, int]]:
        """Get (effect, parameter, shot or -1 if shared) of each fitted effect parameter, in order."""
        out = [(kind.effect, free, -1) for kind in self.effects for free in kind.shared]
        for shot in range(len(self.data.shots)):
            out += [(kind.effect, free, shot) for kind in self.effects for free in kind.own]
        return out

    @property
    def offset(self) -> int:
        """Get the index at which the effects' parameters begin."""
        return self.data.count + 3 * len(self.data.shots)

    @cached_property
    def names(self) -> tuple[tuple[str, int], ...]:
        """Get (name as in a ``Fit``, shot or -1 if shared) of each entry."""
        shared = [(name, -1) for name in self.data.base.names]
        own = [(name, shot) for shot in range(len(self.data.shots)) for name in OWN_NAMES]
        return (*shared, *own, *((f"{effect.key}.{free.name}", shot) for effect, free, shot in self.free_parameters))

    @cached_property
    def shared(self) -> list[int]:
        """Get the indices of parameters that all shots share."""
        return [place for place, (_, shot) in enumerate(self.names) if shot < 0]

    @cached_property
    def places(self) -> Places:
        """Get the indices of the parameters that each shot depends on: shared ones, then its own; shape (shots, q)."""
        own: list[list[int]] = [[] for _ in self.data.shots]
        for place, (_, shot) in enumerate(self.names):
            if shot >= 0:
                own[shot].append(place)
        return np.array([[*self.shared, *mine] for mine in own], dtype=np.intp)

    def arrow(self, blocks: Sequence[Floats]) -> Arrow:
        """Return a block-arrow matrix from each shot's columns, shape (n, q), ordered as the shot's ``places``."""
        return Arrow(tuple(blocks), len(self.shared), tuple(self.places), self.size)

    @cached_property
    def unseen(self) -> list[int]:
        """Get the indices of parameters of plates that none of these shots uses."""
        base = self.data.base
        seen = {place for shot in self.data.shots for place in base.places(shot.plate_number)}
        return [place for place in range(self.data.count) if place not in seen]

    def flat(self, point: Point) -> Floats:
        """Return the physical parameters of a point in the vector's order, shape (size,)."""
        free = [point.values[max(shot, 0)][effect][free.name] for effect, free, shot in self.free_parameters]
        return np.concatenate([point.base, point.own.ravel(), free])

    @property
    def size(self) -> int:
        """Get the length of the vector."""
        return self.offset + len(self.free_parameters)

    @cached_property
    def coordinates(self) -> Coordinates:
        """Get the map of base and per-shot parameters to search coordinates."""
        shots = self.data.shots
        return Coordinates(
            block_mass_kg=self.data.reference_mass_kg or shots[0].moving_mass_kg,
            plate=self.data.base.plate_moves,
            reference_s=np.array([shot.course.touch_time_s for shot in shots]),
            further_at=self.data.base.further_at,
        )

    def pack(self, point: Point) -> Floats:
        """Return the search vector of a point."""
        return self.pack_effective(to_effective(point))

    def pack_effective(self, effective: Point) -> Floats:
        """Return the search vector of a point that is given in effective parameters."""
        values = effective.values
        free = [one.to_search(values[max(shot, 0)][effect][one.name]) for effect, one, shot in self.free_parameters]
        base, own = self.coordinates.base_to_search(effective.base), self.coordinates.own_to_search(effective.own)
        return np.concatenate([base, own.ravel(), free])

    def unpack(self, z: Floats) -> Point:
        """Return the physical parameters of a search vector; Infeasible if it is out of range."""
        return to_physical(self._effective(z))

    def slopes(self, z: Floats) -> Floats:
        """Return the derivatives of each shot's physical parameters by the vector's entries, shape (shots, q, q).

        Both are in the order of the shot's ``places``; other entries do not change them.
        """
        base, of_base = self.coordinates.base_parameters(z[: self.data.count])
        _, of_own = self.coordinates.own_parameters(z[self.data.count : self.offset].reshape(-1, 3))
        shared, count = len(self.shared), self.places.shape[1]
        of_each = np.ones(self.size)
        of_each[self.offset :] = [
            free.slope(float(z[k])) for k, (_, free, _) in enumerate(self.free_parameters, self.offset)
        ]
        out = np.zeros((len(self.places), count, count))
        out[:, np.arange(count), np.arange(count)] = of_each[self.places]
        out[:, : base.size, : base.size] = of_base
        own = slice(shared, shared + len(OWN_NAMES))
        out[:, own, own] = of_own
        of_all = [(effect, free.name) for effect, free, shot in self.free_parameters if shot < 0]
        at = {parameter: base.size + k for k, parameter in enumerate(of_all)}
        return physical_derivatives(self._effective(z), out, at, shared + OWN_NAMES.index("touch_time_s"))

    def _effective(self, z: Floats) -> Point:
        """Return a vector's effective parameters."""
        base, _ = self.coordinates.base_parameters(z[: self.data.count])
        own, _ = self.coordinates.own_parameters(z[self.data.count : self.offset].reshape(-1, 3))
        values: list[dict[Effect, dict[str, float]]] = []
        for _ in self.data.shots:
            values.append({kind.effect: dict(self.fixed.get(kind.effect, {})) for kind in self.effects})
        for k, (effect, free, shot) in enumerate(self.free_parameters):
            value = free.to_value(float(z[self.offset + k]))
            for index in range(len(values)) if shot < 0 else (shot,):
                values[index][effect][free.name] = value
        return Point(base, own, tuple(values))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Get lower and upper bounds of the vector."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        low[self.data.base.contact_at.stop - 1] = 0.0  # a dashpot only dissipates
        for k, (_, free, _) in enumerate(self.free_parameters):
            low[self.offset + k], high[self.offset + k] = free.bounds
            if free.name == "frequency_hz":
                slowest, fastest = self.data.band_hz
                low[self.offset + k], high[self.offset + k] = np.log(_BELOW * slowest), np.log(fastest)
        return low, high

    def shot_at(self, index: int, point: Point) -> ShotModel:
        """Return the model of one shot with the parameters of a point."""
        values = {kind.effect: point.values[index][kind.effect] for kind in self.effects}
        return ShotModel(self.data.shots[index], self.data.base, point.base, point.own[index], values)

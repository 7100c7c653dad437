"""One hypothesis: the base model with some effects, its parameters laid out for a search over all shots at once."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.derivatives import has_tangents, linearised_shot, solved
from analysis.diagnosis.first_order import Shot
from analysis.diagnosis.knobs import Kind, Knob
from analysis.diagnosis.quick_shot import COARSE, FINE, Optics, Run, Values, respond
from analysis.diagnosis.samples import Samples
from analysis.diagnosis.seen import Point, as_is, as_seen, slope
from analysis.model.coordinates import Coordinates
from analysis.model.effects import named
from analysis.model.response import Base
from analysis.side_by_side import side_by_side

Floats = NDArray[np.float64]
_REMEMBERED = 3


@dataclass(frozen=True, slots=True)
class Rig:
    """The shots that are judged together, the base model, and how many wandering parts their floor may have."""

    shots: tuple[Samples, ...]
    base: Base
    parts: int = 2

    @property
    def band_hz(self) -> tuple[float, float]:
        """Get the frequencies between which a line can be told from a drift and from an alias."""
        return 2.5 / max(shot.length_s for shot in self.shots), 0.45 / self.shots[0].spacing_s

    @property
    def count(self) -> int:
        """Get the number of shared base parameters."""
        return len(self.base.names)


@dataclass(frozen=True)
class Hypothesis:
    """Base and ``effects`` (in that order): the map between a search vector and parameters, and what they give.

    The vector holds the base and own parameters in ``Coordinates``, then each effect's shared knobs, then each shot's
    own knobs of every effect: all of them as they are seen (``as_seen``).  ``fixed`` holds what is not searched (a
    cyclic error's order).
    """

    rig: Rig
    effects: tuple[Kind, ...]
    fixed: Values = field(default_factory=dict)
    _lately: dict[bytes, list[tuple[Floats, Floats]]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @cached_property
    def knobs(self) -> list[tuple[str, Knob, int]]:
        """Get (effect, knob, shot or -1) of every searched effect parameter, in order."""
        out = [(kind.name, knob, -1) for kind in self.effects for knob in kind.shared]
        for shot in range(len(self.rig.shots)):
            out += [(kind.name, knob, shot) for kind in self.effects for knob in kind.own]
        return out

    @property
    def offset(self) -> int:
        """Get where the effects' knobs begin in the vector."""
        return self.rig.count + 3 * len(self.rig.shots)

    @property
    def size(self) -> int:
        """Get the length of the vector."""
        return self.offset + len(self.knobs)

    @cached_property
    def coordinates(self) -> Coordinates:
        """Get the map of base and own parameters."""
        shots = self.rig.shots
        return Coordinates(
            block_mass_kg=shots[0].moving_mass_kg,
            plate=not self.rig.base.one_body,
            own_at=tuple(self.rig.count + 3 * i for i in range(len(shots))),
            reference_s=tuple(shot.course.touch_time_s for shot in shots),
        )

    def pack(self, point: Point) -> Floats:
        """Return the search vector of a point."""
        return self.pack_seen(as_seen(point))

    def pack_seen(self, seen: Point) -> Floats:
        """Return the search vector of a point as it is seen."""
        z = np.empty(self.size)
        z[: self.offset] = self.coordinates.to_search(np.concatenate([seen.base, seen.own.ravel()]))
        for k, (name, knob, shot) in enumerate(self.knobs):
            z[self.offset + k] = knob.to_search(seen.values[max(shot, 0)][name][knob.name])
        return z

    def unpack(self, z: Floats) -> Point:
        """Return the point of a search vector; Infeasible off the map."""
        return as_is(self._seen(z)[0])

    def slope(self, z: Floats) -> Floats:
        """Return the derivatives of the parameters, in the vector's order, by the vector, shape (size, size)."""
        seen, of_base = self._seen(z)
        out = np.diag(
            [1.0] * self.offset + [knob.slope(float(z[self.offset + k])) for k, (_, knob, _) in enumerate(self.knobs)]
        )
        out[: self.offset, : self.offset] = of_base
        shared = {(name, knob.name): self.offset + k for k, (name, knob, shot) in enumerate(self.knobs) if shot < 0}
        touches = [self.rig.count + 3 * i + 1 for i in range(len(self.rig.shots))]
        return np.asarray(slope(seen, self.size, shared, touches) @ out)

    def _seen(self, z: Floats) -> tuple[Point, Floats]:
        """Return the point of a vector as it is seen, and the derivatives of base and own parameters."""
        parameters, of_base = self.coordinates.to_parameters(z[: self.offset])
        values: list[dict[str, dict[str, float]]] = []
        for _ in self.rig.shots:
            values.append({kind.name: dict(self.fixed.get(kind.name, {})) for kind in self.effects})
        for k, (name, knob, shot) in enumerate(self.knobs):
            value = knob.to_value(float(z[self.offset + k]))
            for index in range(len(values)) if shot < 0 else (shot,):
                values[index][name][knob.name] = value
        own = parameters[self.rig.count :].reshape(-1, 3)
        return Point(parameters[: self.rig.count], own, tuple(values)), of_base

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Get lower and upper bounds of the vector."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        low[self.rig.count - 1] = 0.0  # a dashpot never drives
        for k, (_, knob, _) in enumerate(self.knobs):
            low[self.offset + k], high[self.offset + k] = knob.bounds
            if knob.name == "frequency_hz":
                slowest, fastest = self.rig.band_hz
                low[self.offset + k], high[self.offset + k] = np.log(slowest), np.log(fastest)
        return low, high

    def full(self, point: Point) -> list[Floats]:
        """Return every shot's displacement on the motion's grid."""
        return [self.fine(i, point) for i in range(len(self.rig.shots))]

    def fine(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement on the motion's grid: what is compared with data."""
        if has_tangents(self):
            return solved(self, index, point, averaged=False)[1].displacement_m
        return self.run(index, point).displacement_m

    def averaged(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement on the motion's grid, averaged like the data."""
        if has_tangents(self):
            return solved(self, index, point)[1].displacement_m
        return self.rig.shots[index].averaged(self.run(index, point).displacement_m)

    def coarse(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement at the averaged samples' centres, quickly: right to parts in a thousand.

        Differences of such displacements make the derivatives of a search; what is compared with data is ``full``.
        """
        return self.run(index, point, coarse=True).displacement_m

    def run(self, index: int, point: Point, coarse: bool = False) -> Run:
        """Return one shot's motion on the motion's grid (``coarse``: at the averaged samples' centres)."""
        shot = self.seen_at(index, point)
        time_s = shot.time_s if coarse else self.rig.shots[index].time_s
        step = COARSE if coarse else FINE
        return respond(time_s, shot.base, shot.own, shot.values, shot.mass_kg, shot.optics, step)

    def seen_at(self, index: int, point: Point) -> Shot:
        """Return one shot's parameters, with the averaged samples' centres for its times."""
        shot = self.rig.shots[index]
        base = point.base if not self.rig.base.one_body else np.array([0.0, np.inf, *point.base])
        optics = Optics(shot.wavelength_m, shot.factor / shot.spacing_s)
        return Shot(shot.centre_s, base, point.own[index], point.values[index], shot.moving_mass_kg, optics)

    def displacement(self, z: Floats) -> list[Floats]:
        """Return every shot's averaged displacement at a vector; one of the last few is remembered, not solved anew."""
        known = self._lately.get(z.tobytes())
        if known is not None:
            return [x for x, _ in known]
        point = self.unpack(z)
        return side_by_side(lambda i: self.averaged(i, point), range(len(self.rig.shots)))

    def linearised(self, z: Floats) -> list[tuple[Floats, Floats]]:
        """Return every shot's averaged displacement, shape (n,), and its derivatives by ``z``, shape (n, size).

        By the model's own tangents; where it has none, by forward differences of quick trajectories: right to parts
        in a hundred.  One of the last few is remembered: a search goes on where another ended, under another floor.
        """
        known = self._lately.get(z.tobytes())
        if known is not None:
            return known
        tangents = has_tangents(self)
        out = side_by_side(
            lambda i: linearised_shot(self, i, z) if tangents else self._differenced_shot(i, z),
            range(len(self.rig.shots)),
        )
        while len(self._lately) >= _REMEMBERED:
            del self._lately[next(iter(self._lately))]
        self._lately[z.tobytes()] = out
        return out

    def touches(self, column: int, shot: int) -> bool:
        """Return whether a vector entry has a bearing on a shot."""
        if column < self.rig.count:
            return True
        if column < self.offset:
            return (column - self.rig.count) // 3 == shot
        of = self.knobs[column - self.offset][2]
        return of in (-1, shot)

    def _differenced_shot(self, index: int, z: Floats) -> tuple[Floats, Floats]:
        shot = self.rig.shots[index]
        point = self.unpack(z)
        here = self.averaged(index, point)
        run = self.run(index, point, coarse=True)
        rough = run.displacement_m
        columns = np.zeros((rough.size, self.size))
        own = self.rig.count + 3 * index
        # A later touch is the same motion later, unless the optics have a clock of their own.
        later = all(named(kind.name).sensor is None for kind in self.effects)
        high = self.bounds[1]
        for column in range(self.size):
            if not self.touches(column, index) or column == own + 2:
                continue
            if column == own + 1 and later:
                columns[:, column] = z[own] - run.velocity_m_per_s
                continue
            step = 1e-4 if column < self.rig.count else 1e-3
            if column == own:
                step = 1e-4 * abs(z[own])
            elif column == own + 1:
                step = 1e-7
            elif column >= self.offset and self.knobs[column - self.offset][1].name == "frequency_hz":
                step = 0.02 / (2 * np.pi * math.exp(z[column]) * shot.length_s)  # radians at the record's end
            moved = z.copy()
            moved[column] += step
            if moved[column] > high[column]:
                step = -step
                moved[column] = z[column] + step
            columns[:, column] = (self.coarse(index, self.unpack(moved)) - rough) / step
        columns[:, own + 2] = 1.0
        return here, columns

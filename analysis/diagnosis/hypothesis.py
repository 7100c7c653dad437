"""One hypothesis: the base model with some effects, and what it gives at a search vector, derivatives included."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.derivatives import has_tangents, linearised_shot, solved
from analysis.diagnosis.effective_parameters import Point
from analysis.diagnosis.quick_shot import COARSE, FINE, Run, respond
from analysis.diagnosis.search_vector import JointData, SearchVector
from analysis.model.effects import named
from analysis.side_by_side import side_by_side

Floats = NDArray[np.float64]
_REMEMBERED = 3


@dataclass(frozen=True)
class Hypothesis(SearchVector):
    """Base and effects as a search tries them: what every shot would show at a vector of their parameters."""

    _lately: dict[bytes, list[tuple[Floats, Floats]]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def full(self, point: Point) -> list[Floats]:
        """Return every shot's displacement on the motion's grid."""
        return [self.fine(i, point) for i in range(len(self.data.shots))]

    def fine(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement on the motion's grid: what is compared with data."""
        if has_tangents(self):
            return solved(self, index, point, averaged=False)[1].displacement_m
        return self.run(index, point).displacement_m

    def averaged(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement on the motion's grid, averaged like the data."""
        if has_tangents(self):
            return solved(self, index, point)[1].displacement_m
        return self.data.shots[index].averaged(self.run(index, point).displacement_m)

    def coarse(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement at the averaged samples' centres, quickly: right to parts in a thousand.

        Differences of such displacements make the derivatives of a search; what is compared with data is ``full``.
        """
        return self.run(index, point, coarse=True).displacement_m

    def run(self, index: int, point: Point, coarse: bool = False) -> Run:
        """Return one shot's motion on the motion's grid (``coarse``: at the averaged samples' centres)."""
        shot = self.shot_at(index, point)
        time_s = shot.time_s if coarse else self.data.shots[index].time_s
        step = COARSE if coarse else FINE
        return respond(time_s, shot.base, shot.own, shot.values, shot.mass_kg, shot.optics, step)

    def displacement(self, z: Floats) -> list[Floats]:
        """Return every shot's averaged displacement at a vector; one of the last few is remembered, not solved anew."""
        known = self._lately.get(z.tobytes())
        if known is not None:
            return [x for x, _ in known]
        point = self.unpack(z)
        return side_by_side(lambda i: self.averaged(i, point), range(len(self.data.shots)))

    def linearised(self, z: Floats) -> list[tuple[Floats, Floats]]:
        """Return every shot's averaged displacement, shape (n,), and its derivatives by ``z``, shape (n, size).

        By the model's own tangents; where it has none, by forward differences of quick trajectories: right to parts
        in a hundred.  One of the last few is remembered: a search goes on where another ended, under another floor.
        """
        known = self._lately.get(z.tobytes())
        if known is not None:
            return known
        out = side_by_side(lambda i: self.of_shot(i, z), range(len(self.data.shots)))
        while len(self._lately) >= _REMEMBERED:
            del self._lately[next(iter(self._lately))]
        self._lately[z.tobytes()] = out
        return out

    def of_shot(self, index: int, z: Floats) -> tuple[Floats, Floats]:
        """Return one shot's averaged displacement, shape (n,), and its derivatives by ``z``, shape (n, size)."""
        return linearised_shot(self, index, z) if has_tangents(self) else self._differenced_shot(index, z)

    def _differenced_shot(self, index: int, z: Floats) -> tuple[Floats, Floats]:
        shot = self.data.shots[index]
        point = self.unpack(z)
        here = self.averaged(index, point)
        run = self.run(index, point, coarse=True)
        rough = run.displacement_m
        columns = np.zeros((rough.size, self.size))
        own = self.data.count + 3 * index
        # A later touch is the same motion later, unless the optics have a clock of their own.
        later = all(named(kind.name).sensor is None for kind in self.effects)
        high = self.bounds[1]
        for column in range(self.size):
            if not self.touches(column, index) or column == own + 2:
                continue
            if column == own + 1 and later:
                columns[:, column] = z[own] - run.velocity_m_per_s
                continue
            step = 1e-4 if column < self.data.count else 1e-3
            if column == own:
                step = 1e-4 * abs(z[own])
            elif column == own + 1:
                step = 1e-7
            elif column >= self.offset and self.free_parameters[column - self.offset][1].name == "frequency_hz":
                step = 0.02 / (2 * np.pi * math.exp(z[column]) * shot.length_s)  # radians at the record's end
            moved = z.copy()
            moved[column] += step
            if moved[column] > high[column]:
                step = -step
                moved[column] = z[column] + step
            columns[:, column] = (self.coarse(index, self.unpack(moved)) - rough) / step
        columns[:, own + 2] = 1.0
        return here, columns


__all__ = ["Hypothesis", "JointData"]

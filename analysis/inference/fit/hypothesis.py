"""One hypothesis: the base model with some effects, the displacement it gives at a search vector, and derivatives."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import side_by_side
from analysis.inference.fit.derivatives import linearised_shot, solved
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.response import Response
from analysis.inference.fit.search_vector import JointData, SearchVector

Floats = NDArray[np.float64]
_REMEMBERED = 3  # vectors whose displacement and derivatives are kept


@dataclass(frozen=True)
class Hypothesis(SearchVector):
    """A base model with effects, evaluated for every shot at a vector of their parameters."""

    _lately: dict[bytes, list[tuple[Floats, Floats]]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def full(self, point: Point) -> list[Floats]:
        """Return every shot's displacement on the motion's grid."""
        return [self.fine(i, point) for i in range(len(self.data.shots))]

    def fine(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement on the motion's grid."""
        return solved(self, index, point, averaged=False)[1].displacement_m

    def averaged(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement, averaged like the data, shape (number of averaged samples,)."""
        return solved(self, index, point)[1].displacement_m

    def coarse(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement at the centres of the averaged samples, not averaged: enough for a score."""
        return self.run(index, point, coarse=True).displacement_m

    def run(self, index: int, point: Point, coarse: bool = False) -> Response:
        """Return one shot's motion on the motion's grid (``coarse``: at the averaged samples' centres)."""
        return solved(self, index, point, averaged=False, centres=coarse)[1]

    def displacement(self, z: Floats) -> list[Floats]:
        """Return every shot's averaged displacement at a vector; the last few results are kept."""
        known = self._lately.get(z.tobytes())
        if known is not None:
            return [x for x, _ in known]
        point = self.unpack(z)
        return side_by_side(lambda i: self.averaged(i, point), range(len(self.data.shots)))

    def linearised(self, z: Floats) -> list[tuple[Floats, Floats]]:
        """Return every shot's averaged displacement, shape (n,), and its derivatives by the shot's ``places``, (n, q).

        The last few results are kept: a search often begins where another ended.
        """
        known = self._lately.get(z.tobytes())
        if known is not None:
            return known
        point, slope = self.unpack(z), self.slope(z)
        lines = side_by_side(lambda i: linearised_shot(self, i, point, slope), range(len(self.data.shots)))
        self.remember(z, lines)
        return lines

    def remember(self, z: Floats, lines: list[tuple[Floats, Floats]]) -> None:
        """Keep ``lines`` as the result of ``linearised`` at ``z``."""
        while len(self._lately) >= _REMEMBERED:
            self._lately.pop(tuple(self._lately)[0], None)  # noqa: RUF015 (a copy: other threads may add to it)
        self._lately[z.tobytes()] = lines

    def of_shot(self, index: int, z: Floats) -> tuple[Floats, Floats]:
        """Return one shot's averaged displacement, shape (n,), and its derivatives by its ``places``, (n, q)."""
        return linearised_shot(self, index, self.unpack(z), self.slope(z))


__all__ = ["Hypothesis", "JointData"]

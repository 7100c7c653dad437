"""A base model with effects over some shots, weighted by a noise: displacement, derivatives and chi^2 at a vector."""

import math
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.compiled import side_by_side
from analysis.inference.joint.search_vector import SearchVector
from analysis.inference.model.arrow import Arrow
from analysis.inference.model.effective_parameters import Point, Values, to_effective
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.model.normal_matrix import Square
from analysis.inference.model.response import STRIDE, Response, ShotModel, respond
from analysis.inference.noise.floor import Floor
from analysis.shot import Floats

# per shot the averaged displacement, shape (n,), and its derivatives by the shot's ``places``, (n, q)
Lines = Sequence[tuple[Floats, Floats]]
_REMEMBERED = 3  # vectors whose displacement and derivatives are cached
_SOFTER = 8  # maximum number of tenfold softenings of a contact too stiff for the samples


@dataclass(frozen=True)
class WeightedModel(SearchVector):
    """A base model with effects, evaluated for every shot at a vector of their parameters; ``noise`` weights residuals.

    ``Problem`` extends this class by fits; scores of further effects need this part only.
    """

    noise: Floor
    _lately: dict[bytes, Lines] = field(default_factory=dict, init=False, repr=False, compare=False)

    def with_noise(self, noise: Floor) -> Self:
        """Return the model weighted by another noise; results that do not depend on the noise are shared."""
        other = copy(self)
        object.__setattr__(other, "noise", noise)
        return other

    def with_effects(self, effects: Iterable[TrialEffect], fixed: Values) -> Self:
        """Return the base model with other effects over the same shots; ``fixed`` holds values not fitted."""
        return type(self)(self.data, tuple(effects), self.noise, fixed=fixed, stride=self.stride)

    def with_effect(self, kind: TrialEffect, start: Mapping[str, float]) -> Self:
        """Return the model with one more effect; values that are not fitted are taken from ``start``."""
        return self.with_effects((*self.effects, kind), {**self.fixed, kind.effect: kind.fixed_in(start)})

    def without_effect(self, effect: Effect) -> Self:
        """Return the model without this effect."""
        fixed = {key: value for key, value in self.fixed.items() if key != effect}
        return self.with_effects((kind for kind in self.effects if kind.effect != effect), fixed)

    def full(self, point: Point) -> list[Floats]:
        """Return every shot's displacement on the motion's grid."""
        return [self.run(i, point).displacement_m for i in range(len(self.data.shots))]

    def averaged(self, index: int, point: Point, laws: Sequence[Effect] = ()) -> Floats:
        """Return one shot's displacement, averaged like the data, shape (n,); ``laws`` as in ``derivatives``."""
        return self._averaged(index, point, laws, derivatives=False).displacement_m

    def coarse(self, index: int, point: Point) -> Floats:
        """Return one shot's displacement at the averaged samples' centres, not averaged: sufficient for a score."""
        return self.run(index, point, coarse=True).displacement_m

    def run(self, index: int, point: Point, *, coarse: bool = False, derivatives: bool = False) -> Response:
        """Return one shot's motion on the motion's grid; ``coarse``: at the averaged samples' centres.

        Raises Infeasible if there is no trajectory.  Cost: 0.3 ms, with derivatives 0.5 to 1 ms.  With a law that is
        nonlinear in the state: 1 to 2 ms, with derivatives 4 to 11 ms.
        """
        shot = self._slow_shot(index, point)
        if coarse:
            return respond(shot, shot.samples.centre_s, derivatives=derivatives)
        return respond(shot, shot.samples.time_s, derivatives=derivatives, stride=self.stride)

    def _averaged(self, index: int, point: Point, laws: Sequence[Effect], *, derivatives: bool) -> Response:
        """Return one shot's motion, averaged like the data, with ``laws`` added to its effects; else as ``run``."""
        shot, samples = self._slow_shot(index, point), self.data.shots[index]
        if laws:
            alone, shot = shot, shot.with_laws(laws)
            if shot.rates.effects > max(alone.rates.effects, math.pi / samples.spacing_s):
                raise Infeasible("a law would move something faster than the averaged samples show")
        stride = STRIDE if derivatives else self.stride
        return respond(shot, samples.time_s, block=samples.factor, derivatives=derivatives, stride=stride)

    def _slow_shot(self, index: int, point: Point) -> ShotModel:
        """Return the model of one shot; Infeasible if an oscillation in it is too fast for the samples."""
        shot = self.shot_at(index, point)
        if shot.too_fast:
            raise Infeasible("something would swing faster than any record can show")
        return shot

    def displacement(self, z: Floats, laws: Sequence[Effect] = ()) -> list[Floats]:
        """Return every shot's averaged displacement at a vector; ``laws`` as in ``derivatives``."""
        known = None if laws else self._lately.get(z.tobytes())
        if known is not None:
            return [x for x, _ in known]
        point = self.unpack(z)
        return side_by_side(lambda i: self.averaged(i, point, laws), range(len(self.data.shots)))

    def derivatives(self, z: Floats, laws: Sequence[Effect] = ()) -> Lines:
        """Return every shot's averaged displacement, shape (n,), and its derivatives by the shot's ``places``, (n, q).

        ``laws`` act in addition to the effects, with parameters that are not fitted.  Without laws the last few results
        are cached, since a search often starts where another ended.
        """
        known = None if laws else self._lately.get(z.tobytes())
        if known is not None:
            return known
        point, slopes = self.unpack(z), self.slopes(z)
        lines = side_by_side(lambda i: self._line(i, point, slopes[i], laws), range(len(self.data.shots)))
        if not laws:
            self.remember(z, lines)
        return lines

    def remember(self, z: Floats, lines: Lines) -> None:
        """Cache ``lines`` as the result of ``derivatives`` at ``z``."""
        while len(self._lately) >= _REMEMBERED:
            self._lately.pop(tuple(self._lately)[0], None)  # noqa: RUF015 (a copy: other threads may add to it)
        self._lately[z.tobytes()] = lines

    def of_shot(self, index: int, z: Floats) -> tuple[Floats, Floats]:
        """Return one shot's averaged displacement, shape (n,), and its derivatives by its ``places``, (n, q)."""
        return self._line(index, self.unpack(z), self.slopes(z)[index])

    def _line(self, index: int, point: Point, slope: Floats, laws: Sequence[Effect] = ()) -> tuple[Floats, Floats]:
        """Return the result of ``of_shot`` at a point; ``slope`` are the shot's ``slopes`` there, shape (q, q)."""
        response = self._averaged(index, point, laws, derivatives=True)
        # derivatives at the usual stride suffice for a short stride: only the displacement decides where a search ends
        shown = response.displacement_m if self.stride == STRIDE else self.averaged(index, point, laws)
        return shown, response.derivatives @ slope

    def residual_m(self, z: Floats) -> tuple[Floats, ...]:
        """Return measured minus model displacement, averaged, one array for each shot."""
        return self.data.left_m(self.displacement(z))

    def whitened(self, columns: Iterable[Floats]) -> Floats:
        """Return ``columns``, shape (n, k) per shot, whitened and concatenated over the shots: shape (rows, k)."""
        return np.concatenate([s.whitened(self.noise, c) for s, c in zip(self.data.shots, columns, strict=True)])

    def whitened_residual(self, z: Floats) -> Floats:
        """Return model minus measured at ``z``, whitened, concatenated over the shots."""
        return self.whitened(-left[:, None] for left in self.residual_m(z))[:, 0]

    def whitened_lines(self, lines: Lines) -> tuple[Floats, Arrow]:
        """Return residual and derivatives, whitened; ``lines`` as ``derivatives`` returns them.

        The residual is measured minus model, shape (rows,), concatenated over the shots.
        """
        tangents = self.arrow([tangents for _, tangents in lines])
        return self.whitened_equations(self.data.left_m(x for x, _ in lines), tangents)

    def whitened_equations(self, left_m: Iterable[Floats], columns: Arrow) -> tuple[Floats, Arrow]:
        """Return residuals, shape (n,) per shot, and ``columns``, whitened; the residuals concatenated over shots."""
        both = zip(self.data.shots, left_m, columns.blocks, strict=True)
        rows = [shot.whitened(self.noise, np.column_stack([left, block])) for shot, left, block in both]
        whitened = replace(columns, blocks=tuple(one[:, 1:] for one in rows))
        return np.concatenate([one[:, 0] for one in rows]), whitened

    def square(self, z: Floats) -> Square:
        """Return the whitened sum of squares at ``z`` with its derivatives."""
        left, tangents = self.whitened_lines(self.derivatives(z))
        left = -left
        if not all(np.all(np.isfinite(one)) for one in (left, *tangents.blocks)):
            raise Infeasible("the trajectory is not finite")
        chi2, pull = float(left @ left), tangents.pull(left)
        return Square(chi2, tangents.normal_matrix(), pull, left.size, left, tangents.along, tangents.pull)

    def with_softened_contact(self, point: Point) -> Point:
        """Return the point with a contact soft enough for the samples: a search cannot start from a rigid contact."""
        for _ in range(_SOFTER):
            if not self.shot_at(0, point).too_fast:
                break
            softer = point.base.copy()
            softer[self.data.base.contact_at] *= [0.1, 0.3]
            point = Point(softer, point.own, point.values)
        return point


@dataclass(frozen=True)
class ModelAtVector:
    """A weighted model at a vector ``z`` of its parameters."""

    problem: WeightedModel
    z: Floats

    @property
    def noise(self) -> Floor:
        """Get the noise that weights residuals."""
        return self.problem.noise

    @cached_property
    def point(self) -> Point:
        """Get the physical parameters."""
        return self.problem.unpack(self.z)

    @cached_property
    def effective(self) -> Point:
        """Get the effective parameters (``effective_parameters``)."""
        return to_effective(self.point)

"""The least-squares search over one or several shots: one sum of squares, shared and own parameters."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision.parameters import Floats, Infeasible
from analysis.inference.fit.base import OWN_NAMES
from analysis.inference.fit.coordinates import Coordinates
from analysis.inference.fit.least_squares import Minimum, Square, minimise
from analysis.inference.fit.response import Model, ShotData, respond
from analysis.shot.shot import Cancelled, Stop

_FURTHEST = 30.0  # a frequency or a time leaves its start by no more than this factor


@dataclass(frozen=True, slots=True)
class Problem:
    """A model, the shots it is fitted to, and how their parameters lie in one vector."""

    model: Model
    shots: tuple[ShotData, ...]
    whitened: tuple[Floats, ...]

    @classmethod
    def of(cls, model: Model, shots: Sequence[ShotData]) -> "Problem":
        """Return the problem with every shot's samples whitened once."""
        return cls(model, tuple(shots), tuple(s.noise.whiten(s.displacement_m, s.valid) for s in shots))

    @property
    def shared(self) -> int:
        """Get the number of shared parameters."""
        return len(self.model.shared_names)

    @property
    def own(self) -> int:
        """Get the number of parameters of each shot."""
        return len(self.model.own_names)

    def own_slice(self, index: int) -> slice:
        """Return where the own parameters of a shot stand."""
        begin = self.shared + index * self.own
        return slice(begin, begin + self.own)

    def places(self, index: int) -> np.ndarray:
        """Return where the parameters that a shot depends on stand, in the order of its derivatives."""
        return np.asarray(np.r_[0 : self.shared, self.own_slice(index)])

    def square(self, parameters: Floats) -> Square:
        """Return the whitened sum of squares with its derivatives; Infeasible where there is no trajectory."""
        size = parameters.size
        curvature, gradient = np.zeros((size, size)), np.zeros(size)
        residuals, jacobians = [], []
        for index, shot in enumerate(self.shots):
            response = respond(self.model, shot, parameters[: self.shared], parameters[self.own_slice(index)])
            both = np.column_stack([response.displacement_m, response.derivatives])
            both = shot.noise.whiten(both, shot.valid)
            residual = both[:, 0] - self.whitened[index]
            jacobian = both[:, 1:]
            place = self.places(index)
            curvature[np.ix_(place, place)] += jacobian.T @ jacobian
            gradient[place] += jacobian.T @ residual
            residuals.append(residual)
            jacobians.append((place, jacobian))
        samples = sum(part.size for part in residuals)
        for at, std in self._expected():
            residuals.append(np.atleast_1d(parameters[at] / std))
            jacobians.append((np.array([at]), np.array([[1.0 / std]])))
            curvature[at, at] += 1.0 / std**2
            gradient[at] += parameters[at] / std**2
        stacked = np.concatenate(residuals)
        chi2 = float(stacked @ stacked)
        if not (np.isfinite(chi2) and np.all(np.isfinite(gradient))):
            raise Infeasible("the trajectory is not finite")

        def along(step: Floats) -> Floats:
            return np.concatenate([jacobian @ step[place] for place, jacobian in jacobians])

        def pull(vector: Floats) -> Floats:
            out, row = np.zeros(size), 0
            for place, jacobian in jacobians:
                out[place] += jacobian.T @ vector[row : row + jacobian.shape[0]]
                row += jacobian.shape[0]
            return out

        return Square(chi2, curvature, gradient, samples, stacked, along, pull)

    def residual(self, parameters: Floats) -> Floats:
        """Return the whitened residuals of all shots, shape (n,), and how far the plates swing, in what is expected.

        Infeasible where there is no trajectory.
        """
        parts = []
        for index, shot in enumerate(self.shots):
            own = parameters[self.own_slice(index)]
            response = respond(self.model, shot, parameters[: self.shared], own, derivatives=False)
            parts.append(shot.noise.whiten(response.displacement_m, shot.valid) - self.whitened[index])
        parts += [np.atleast_1d(parameters[place] / std) for place, std in self._expected()]
        out = np.concatenate(parts)
        if not np.all(np.isfinite(out)):
            raise Infeasible("the trajectory is not finite")
        return out

    def _expected(self) -> Iterator[tuple[int, float]]:
        """Yield the places of parameters that are about nothing, each with how far it may be from that."""
        if not self.model.base.swings:
            return
        for index, shot in enumerate(self.shots):
            first = self.own_slice(index).start + len(OWN_NAMES)
            yield from ((first + k, std) for k, std in enumerate(shot.plate_std))

    def chi2(self, parameters: Floats) -> float:
        """Return the whitened sum of squares alone; Infeasible where there is no trajectory."""
        out = self.residual(parameters)
        return float(out @ out)


def search(
    problem: Problem,
    begin: Floats,
    stop: Stop,
    *,
    evaluations: int = 60,
    tolerance: float = 1e-6,
) -> Minimum:
    """Return the minimum found from ``begin``; Cancelled when asked to stop, Infeasible where the start is."""
    model, count, own = problem.model, problem.shared, problem.own
    inverse = tuple(
        model.shared_names.index(f"{e.name}.{e.amplitude}")
        for e in model.effects
        if e.inverse and f"{e.name}.{e.amplitude}" in model.shared_names
    )
    names = [*model.shared_names, *(n for _ in problem.shots for n in model.own_names)]
    limits = {name: parameter for name, _, _, parameter in model.effect_parameters}
    # An amplitude may have to pass through nothing on its way, where a logarithm has no end.
    amplitudes = {f"{e.name}.{e.amplitude}" for e in model.effects}
    logarithmic = tuple(
        place
        for place, name in enumerate(names)
        if name in limits and name not in amplitudes and limits[name].logarithmic and limits[name].lower > 0
    )
    coordinates = Coordinates(
        block_mass_kg=problem.shots[0].block_mass_kg,
        plate=not model.base.one_body,
        own_at=tuple(count + own * index for index in range(len(problem.shots))),
        reference_s=tuple(shot.course.touch_time_s for shot in problem.shots),
        inverse_at=inverse,
        logarithmic_at=logarithmic,
        further_at=model.base.further_at,
    )

    seen: dict[bytes, Square] = {}

    def function(z: Floats) -> Square:
        parameters, slope = coordinates.to_parameters(z)
        at = problem.square(parameters)
        seen[parameters.tobytes()] = at
        along, pull = at.along, at.pull
        assert along is not None and pull is not None
        return Square(
            at.chi2,
            slope.T @ at.curvature @ slope,
            slope.T @ at.gradient,
            at.samples,
            at.residual,
            lambda step: along(slope @ step),
            lambda vector: np.asarray(slope.T @ pull(vector)),
        )

    def residual(z: Floats) -> Floats:
        return problem.residual(coordinates.to_parameters(z)[0])

    start = coordinates.to_search(begin)
    lower, upper = np.full(start.size, -np.inf), np.full(start.size, np.inf)
    lower[model.base.contact_at.stop - 1] = 0.0  # a dashpot never drives
    for place, name in enumerate(names):
        if name not in limits:
            continue
        lower[place], upper[place] = limits[name].lower, limits[name].upper
        if place in inverse:
            lower[place], upper[place] = 1e-9, 1 / max(limits[name].lower, 1e-12)
        elif place in logarithmic:
            lower[place] = max(math.log(lower[place]), start[place] - math.log(_FURTHEST))
            upper[place] = min(math.log(upper[place]), start[place] + math.log(_FURTHEST))
    found = minimise(
        function,
        start,
        lower=lower,
        upper=upper,
        evaluations=evaluations,
        tolerance=tolerance,
        residual=residual,
        cancelled=stop,
    )
    if stop():
        raise Cancelled
    parameters, _ = coordinates.to_parameters(found.parameters)
    at = seen.get(parameters.tobytes())
    return replace(found, parameters=parameters, square=problem.square(parameters) if at is None else at)


def own_start(shot: ShotData, model: Model) -> Floats:
    """Return a shot's own parameters as its displacement alone suggests them, effects at nothing."""
    course = shot.course
    own = [course.velocity_in_m_per_s, course.touch_time_s, course.touch_position_m]
    return np.array([*own, *(0.0 for _ in model.own_names[len(OWN_NAMES) :])])

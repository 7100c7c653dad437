"""What each effect would do to the displacement, to first order around a fit: the ground for scoring candidates.

Around the minimum of a fit every shot has its base tangents, d(displacement)/d(parameter), and for every candidate
effect, at every point of its grid, d(displacement)/d(amplitude) at no amplitude.  ``Projection`` whitens both alike,
takes the base tangents out (also of the remainder) and says how much of chi^2 a candidate could explain.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision import general
from analysis.collision.acting import acting
from analysis.collision.effects import CATALOGUE, Effect, named
from analysis.collision.effects.row import Sensed
from analysis.collision.first_order import along, steps_for
from analysis.collision.linear_path import linear_path
from analysis.collision.parameters import Collision, Floats, Infeasible
from analysis.inference.fit.base import OWN_NAMES
from analysis.inference.fit.response import ShotData, respond
from analysis.inference.fit.search import Problem

_STEP = 1e-40
_SMALL = 1e-6  # of an effect's natural size: where its own back-action is nothing
_NOTHING = 1e9  # kg: the modal mass of a mode that is not there


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect at one point of its grid: what a unit of its amplitude does to every shot's samples, shapes (n, k).

    ``point`` holds the grid's values by parameter name.  k is 1, or 2 where an effect has two amplitudes (two phases,
    or velocity and displacement); ``own``: every shot has amplitudes of its own.  ``inverse``: the amplitude is
    1 / parameter.
    """

    name: str
    point: dict[str, float]
    columns: tuple[Floats, ...]
    own: bool
    inverse: bool = False


def base_tangents(problem: Problem, parameters: Floats) -> tuple[Floats, ...]:
    """Return d(displacement)/d(shared, own) of each shot, shapes (n, p), in the problem's order, not whitened."""
    return tuple(
        respond(problem.model, shot, parameters[: problem.shared], parameters[problem.own_slice(index)]).derivatives
        for index, shot in enumerate(problem.shots)
    )


def grid(effect: Effect) -> list[dict[str, float]]:
    """Return the points at which an effect is scored: every combination of its grids but the amplitude's and phases."""
    axes = [(p.name, p.grid) for p in effect.parameters if p.grid and p.name not in (effect.amplitude, "phase_rad")]
    names = [name for name, _ in axes]
    return [dict(zip(names, point, strict=True)) for point in itertools.product(*(values for _, values in axes))]


def candidates(problem: Problem, parameters: Floats, names: Iterable[str] | None = None) -> Iterator[Candidate]:
    """Yield every candidate of ``names`` (default: the catalogue less what the model has) around a minimum.

    Mechanical effects are solved with, exact to first order, up to three in one run;
    those with hidden states over their whole grid in one march along a linear path.
    """
    have = {effect.name for effect in problem.model.effects}
    rows = [named(name) for name in (CATALOGUE if names is None else names) if name not in have]
    singles: list[tuple[Effect, dict[str, float]]] = []
    for row in rows:
        if row.sensor is not None:
            yield from _sensed(problem, parameters, row)
        elif row.own:
            yield _each_shots_own(problem, parameters, row)
        elif row.one_body or not problem.model.base.one_body:
            if any(p.own and p.name == "phase_rad" for p in row.parameters):
                yield _quadratures(problem, parameters, row)
                continue
            hidden = _hidden(problem, parameters, row, grid(row)) if row.hidden else None
            if hidden is None:
                singles += [(row, point) for point in grid(row)]
            else:
                yield from hidden
    room = max(1, 3 - sum(effect.kernel is not None for effect in problem.model.effects))
    for begin in range(0, len(singles), room):
        yield from _mechanical(problem, parameters, singles[begin : begin + room])


def _situation(problem: Problem, parameters: Floats, index: int) -> tuple[ShotData, Floats, dict[str, float]]:
    shot, own = problem.shots[index], parameters[problem.own_slice(index)]
    return shot, own, problem.model.values(parameters[: problem.shared], own)


def _mechanical(
    problem: Problem, parameters: Floats, some: Sequence[tuple[Effect, dict[str, float]]]
) -> Iterator[Candidate]:
    columns: list[list[Floats]] = [[] for _ in some]
    for index in range(len(problem.shots)):
        shot, own, _ = _situation(problem, parameters, index)
        collision, active = _acting(problem, parameters, index)
        directions = []
        for effect, point in some:
            # At no amplitude: the effect is there only through its derivative.
            nothing = _NOTHING if effect.inverse else 0.0
            at = tuple(nothing if p.name == effect.amplitude else point.get(p.name, p.scale) for p in effect.parameters)
            directions.append(general.direction(len(active), effect.index(effect.amplitude)))
            active.append(general.Active(effect, at))
        run = general.solve(collision, active, shot.time_s - own[1], directions=directions)
        for place, (effect, _) in enumerate(some):
            column = run.displacement_derivatives[:, place : place + 1]
            columns[place].append(-(_NOTHING**2) * column if effect.inverse else column.copy())
    for (effect, point), each in zip(some, columns, strict=True):
        yield Candidate(effect.name, point, tuple(each), own=False, inverse=effect.inverse)


def _quadratures(problem: Problem, parameters: Floats, effect: Effect) -> Candidate:
    """Return the candidate of a mechanical effect whose phase is each shot's own, as two quadratures a shot."""
    points = [{"phase_rad": 0.0}, {"phase_rad": math.pi / 2}]
    found = _hidden(problem, parameters, effect, points) if effect.hidden else None
    if found is None:
        found = [one for p in points for one in _mechanical(problem, parameters, [(effect, p)])]
    sine, cosine = (one.columns for one in found)
    return Candidate(effect.name, {}, tuple(np.hstack(both) for both in zip(sine, cosine, strict=True)), own=True)


def _hidden(
    problem: Problem, parameters: Floats, effect: Effect, points: Sequence[dict[str, float]]
) -> list[Candidate] | None:
    """Return the candidates of an effect with hidden states; None where it has no first order along a path."""
    sign = -1.0 if effect.inverse else 1.0
    scale = effect.parameters[effect.index(effect.amplitude)].scale
    size = scale * _SMALL**sign
    rows = [
        [size if p.name == effect.amplitude else point.get(p.name, p.scale) for p in effect.parameters]
        for point in points
    ]
    values = np.zeros((len(points), 3))
    values[:, : len(effect.parameters)] = rows
    each = []
    for index in range(len(problem.shots)):
        shot, own, _ = _situation(problem, parameters, index)
        collision, active = _acting(problem, parameters, index)
        active.sort(key=lambda one: one.effect.hidden == 0)
        spacing = float(shot.time_s[1] - shot.time_s[0])
        steps = np.array([steps_for(effect, row, collision, spacing) for row in rows])
        columns = np.empty((shot.time_s.size, len(points)))
        for some in np.unique(steps):
            try:
                path = linear_path(collision, active, shot.time_s - own[1], int(some))
            except Infeasible:
                return None
            which = np.flatnonzero(steps == some)
            found = along(path, effect, collision, np.ascontiguousarray(values[which]), shot.time_s.size)
            if found is None:
                return None
            columns[:, which] = found
        each.append(columns / size**sign)
    return [
        Candidate(effect.name, point, tuple(e[:, place : place + 1] for e in each), own=False, inverse=effect.inverse)
        for place, point in enumerate(points)
    ]


def _acting(problem: Problem, parameters: Floats, index: int) -> tuple[Collision, list[general.Active]]:
    """Return a shot's collision and the effects that act on its motion."""
    shot, own, values = _situation(problem, parameters, index)
    model = problem.model
    start = model.plate_start(values, own, shot.plate)
    collision = model.base.collision(parameters, own[0], shot.block_mass_kg, start, shot.plate_number)
    return collision, acting(model.effects, model.by_effect(values), collision, float(own[1]))


def _each_shots_own(problem: Problem, parameters: Floats, effect: Effect) -> Candidate:
    """Return the candidate whose parameters are all each shot's own and linear: a state of the plate, or a force."""
    columns = []
    for index in range(len(problem.shots)):
        shot, own, _ = _situation(problem, parameters, index)
        collision, active = _acting(problem, parameters, index)
        directions = [6, 5]
        if effect.kernel is not None:
            directions = [general.direction(len(active), place) for place in range(len(effect.parameters))]
            active.append(general.Active(effect, (0.0,) * len(effect.parameters)))
        run = general.solve(collision, active, shot.time_s - own[1], directions=directions)
        columns.append(run.displacement_derivatives)
    return Candidate(effect.name, {}, tuple(columns), own=True)


def _sensed(problem: Problem, parameters: Floats, effect: Effect) -> Iterator[Candidate]:
    """Yield a sensor effect's candidates; one that is no effect to first order is taken at its natural size."""
    assert effect.sensor is not None
    runs = []
    for index in range(len(problem.shots)):
        shot, own, _ = _situation(problem, parameters, index)
        response = respond(problem.model, shot, parameters[: problem.shared], own, derivatives=False)
        seen = Sensed(shot.time_s, response.velocity_m_per_s, shot.wavelength_m, shot.rate_hz)
        runs.append((seen, response.displacement_m - own[OWN_NAMES.index("offset_m")]))
    phases = [p for p in effect.parameters if p.name == "phase_rad"]
    amplitude = effect.index(effect.amplitude)
    for point in grid(effect):
        columns = []
        for seen, x in runs:
            both = []
            for phase in phases[0].grid if phases else (math.nan,):
                p = np.zeros((max(3, len(effect.parameters)), 1), dtype=np.complex128)
                for place, parameter in enumerate(effect.parameters):
                    p[place] = phase if parameter.name == "phase_rad" else point.get(parameter.name, parameter.scale)
                if effect.grows_as != 1.0:
                    shown = effect.sensor(seen, x[:, None].astype(np.complex128), p)
                    both.append((shown[:, 0].real - x) / effect.parameters[amplitude].scale)
                else:
                    p[amplitude] = 1j * _STEP
                    both.append(effect.sensor(seen, x[:, None].astype(np.complex128), p)[:, 0].imag / _STEP)
            columns.append(np.stack(both, axis=1))
        yield Candidate(effect.name, point, tuple(columns), own=bool(phases))


@dataclass(frozen=True, slots=True)
class Gain:
    """What a candidate could explain: the fall of chi^2, its amplitudes and their covariance, to first order.

    ``amplitudes`` has shape (k,), or (shots k,) where they are each shot's own.  ``left``: the part of the candidate's
    whitened length that the base tangents leave (0: the base parameters could do just the same).
    """

    fall: float
    amplitudes: Floats
    covariance: Floats
    left: float


class Projection:
    """Whitened remainder and base tangents of a problem at a minimum; scores candidates with the tangents out."""

    def __init__(self, problem: Problem, parameters: Floats) -> None:
        """Whiten and orthogonalise once: about 5 ms a shot."""
        self.problem = problem
        residuals, blocks = [], []
        for index, shot in enumerate(problem.shots):
            response = respond(problem.model, shot, parameters[: problem.shared], parameters[problem.own_slice(index)])
            both = np.column_stack([response.displacement_m, response.derivatives])
            both = shot.noise.whiten(both, shot.valid)
            residuals.append(problem.whitened[index] - both[:, 0])
            block = np.zeros((both.shape[0], parameters.size))
            block[:, problem.places(index)] = both[:, 1:]
            blocks.append(block)
        self.lengths = [r.size for r in residuals]
        jacobian = np.concatenate(blocks)
        jacobian /= np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        self.basis, _ = np.linalg.qr(jacobian)
        stacked = np.concatenate(residuals)
        self.residual: Floats = stacked - self.basis @ (self.basis.T @ stacked)

    def whitened(self, candidate: Candidate) -> Floats:
        """Return the candidate's columns whitened and stacked over the shots, shape (N, k) or (N, shots k)."""
        parts = [
            shot.noise.whiten(np.ascontiguousarray(columns), shot.valid)
            for shot, columns in zip(self.problem.shots, candidate.columns, strict=True)
        ]
        if not candidate.own:
            return np.concatenate(parts)
        k = parts[0].shape[1]
        out = np.zeros((sum(self.lengths), k * len(parts)))
        row = 0
        for index, part in enumerate(parts):
            out[row : row + part.shape[0], k * index : k * index + k] = part
            row += part.shape[0]
        return out

    def without_base(self, columns: Floats) -> Floats:
        """Return ``columns``, shape (N, k), with the base tangents projected out."""
        return np.asarray(columns - self.basis @ (self.basis.T @ columns))

    def falls(self, several: Sequence[Candidate]) -> Floats:
        """Return by how much chi^2 would fall with each of ``several``, shape (m,); a grid in one pass."""
        out = np.empty(len(several))
        single = [place for place, c in enumerate(several) if not c.own and c.columns[0].shape[1] == 1]
        for begin in range(0, len(single), 64):
            places = single[begin : begin + 64]
            stacked = [
                shot.noise.whiten(np.concatenate([several[p].columns[index] for p in places], axis=1), shot.valid)
                for index, shot in enumerate(self.problem.shots)
            ]
            rest = self.without_base(np.concatenate(stacked))
            power = np.einsum("ij,ij->j", rest, rest)
            out[places] = (rest.T @ self.residual) ** 2 / np.maximum(power, 1e-300)
        for place in set(range(len(several))) - set(single):
            out[place] = self.gain(several[place]).fall
        return out

    def gain(self, candidate: Candidate) -> Gain:
        """Return how far chi^2 would fall with the candidate and all base parameters free, to first order."""
        whole = self.whitened(candidate)
        rest = self.without_base(whole)
        length = float(np.sqrt(np.sum(rest**2) / max(np.sum(whole**2), 1e-300)))
        scale = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        values, vectors = np.linalg.eigh((rest / scale).T @ (rest / scale))
        good = values > 1e-14
        right = vectors.T @ ((rest / scale).T @ self.residual)
        solved = np.where(good, right / np.where(good, values, 1.0), 0.0)
        inverse = (vectors * np.where(good, 1 / np.where(good, values, 1.0), np.inf if not good.any() else 0.0)) @ (
            vectors.T
        )
        return Gain(
            fall=float(np.sum(np.where(good, right * solved, 0.0))),
            amplitudes=np.asarray(vectors @ solved / scale),
            covariance=np.asarray(inverse / np.outer(scale, scale)),
            left=length,
        )

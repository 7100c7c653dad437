"""A fit on frames whose sway is learned from all of each shot, and what not knowing it better does to the numbers.

The flights say first how strongly a frame sways; the fit that weighs so leaves a remainder, by which contact and
flights together say it again.  Where something struck the frame during the contact, only they can.  Values are those
under the likeliest strengths; their covariance is that of the mixture of all likely ones, which is the mean of the
covariances and the covariance of where each would put the values (law of total variance).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from analysis.collision.parameters import Floats
from analysis.inference.fit.base import OWN_NAMES
from analysis.inference.fit.least_squares import Minimum, Square, covariance
from analysis.inference.fit.response import ShotData, respond
from analysis.inference.fit.search import Problem, search
from analysis.inference.noise.on_frame import sways_as
from analysis.inference.noise.sway import BELOW_HZ, Grid, Swayed, unit_sines
from analysis.inference.noise.sway_knots import knots_of
from analysis.inference.noise.sway_strengths import SeenThrough, Waves, learn
from analysis.shot.disturbance import Shaking
from analysis.shot.shot import Stop

_CLOSELY = 0.01  # of the noise of a sample: what splines may miss of the sway
_TURNS = 3  # of a fit and what it says of the sway
_SETTLED = 0.1  # standard deviations: a fit that moved less will say the same


@dataclass(frozen=True, slots=True)
class LearnedSway:
    """A fit under what all of each shot says of its frame: the problem, its minimum, the covariance (p, p)."""

    problem: Problem
    found: Minimum
    covariance: Floats | None


@dataclass(frozen=True, slots=True)
class _Share:
    """A shot's share in a fit's normal equations: where its free parameters stand, and what it tells of them.

    ``best`` are the likeliest logarithms of its octaves, ``powers_m2`` those of the sway, each (f,), all as likely, on
    a ``grid``; none where the shot's noise is known.
    """

    places: NDArray[np.intp]
    seen: SeenThrough
    grid: Grid | None = None
    best: Floats = field(default_factory=lambda: np.empty(0))
    powers_m2: tuple[Floats, ...] = ()

    def normal(self, index: int) -> Floats:
        """Return (r, J)^T V^-1 (r, J), shape (1 + q, 1 + q), for one of what may be."""
        return self.seen.normal(self.powers_m2[index]) if self.powers_m2 else self.seen.beside


def with_learned_sway(
    problem: Problem, found: Minimum, shakings: Sequence[Shaking | None], free: NDArray[np.bool_], stop: Stop
) -> LearnedSway:
    """Return the fit under what all of each shot says of its frame, from that under what the flights say.

    ``free``, shape (p,), says which parameters no bound holds.  Cost: some 50 ms a shot and turn beside the search.
    """
    shares: list[_Share] = []
    begin: list[_Share | None] = [None] * len(shakings)
    for _ in range(_TURNS):
        both = [
            _learned(problem, index, found.parameters, free, shaking, begin[index])
            for index, shaking in enumerate(shakings)
        ]
        shares = [share for _, share in both]
        begin = [*shares]
        problem, before = Problem.of(problem.model, [shot for shot, _ in both]), found
        found = search(problem, found.parameters, stop)
        move = found.parameters - before.parameters
        if float(move @ found.square.curvature @ move) < _SETTLED**2:
            break
    return LearnedSway(problem, found, _mixed(shares, free))


def _learned(
    problem: Problem, index: int, parameters: Floats, free: NDArray[np.bool_], shaking: Shaking | None,
    before: _Share | None,
) -> tuple[ShotData, _Share]:  # fmt: skip
    """Return a shot with the noise that all of it suggests, and its share in the normal equations.

    ``before`` is that share as parameters nearby had it.
    """
    model, shot, noise = problem.model, problem.shots[index], problem.shots[index].noise
    shared, own = parameters[: problem.shared], parameters[problem.own_slice(index)]
    response = respond(model, shot, shared, own)
    places = problem.places(index)
    moved = free[places] & (np.abs(response.derivatives).max(axis=0) > 0.0)
    both = np.column_stack([response.displacement_m - shot.displacement_m, response.derivatives[:, moved]])
    white = (noise.beat if isinstance(noise, Swayed) else noise).whiten(both, shot.valid)
    products = white.T @ white
    if model.base.swings:  # what is expected of the plate's start, as the search has it
        for place, std in zip(range(problem.shared + len(OWN_NAMES), places.size), shot.plate_std, strict=False):
            row = np.zeros(1 + places.size)
            row[[0, 1 + place]] = parameters[places[place]] / std, 1.0 / std
            row = row[np.append(True, moved)]
            products += np.outer(row, row)
    if shaking is None or not isinstance(noise, Swayed):
        nothing = np.empty((0, 0))
        return shot, _Share(places[moved], SeenThrough(nothing, nothing, products))
    seen_s = shot.time_s[shot.valid]
    waves = Waves.of(shaking, float(seen_s[-1] - seen_s[0]), BELOW_HZ)
    collision = model.base.collision(shared, own[0], shot.block_mass_kg, plate_number=shot.plate_number)
    touch_s = float(own[1])
    if before is None or before.grid is None:
        knots_s = knots_of(seen_s, collision, touch_s, shaking.below(BELOW_HZ), _CLOSELY * noise.beat.white_std_m)
        grid = Grid.of(noise.beat, knots_s, shot.time_s, shot.valid)
        start = waves.start(shaking)
    else:
        grid, start = before.grid, before.best
    sines, _ = unit_sines(grid, waves.frequency_hz, collision, touch_s)
    basis, seen_waves = np.linalg.qr(grid.root @ sines)
    along = basis.T @ solve_triangular(grid.root, grid.columns.T @ white, trans="T", check_finite=False)
    seen = SeenThrough(seen_waves, along, products - along.T @ along)
    best, points = learn(seen, waves, start)
    share = _Share(places[moved], seen, grid, best, tuple(waves.power_m2(point) for point in points))
    shaken = waves.shaking(waves.power_m2(best))
    return sways_as(shot, noise.beat, grid, shaken, collision, touch_s), share


def _mixed(shares: Sequence[_Share], free: NDArray[np.bool_]) -> Floats | None:
    """Return the covariance (p, p) of the parameters over all that frames may have done, None where there is none."""
    covariances, values = [], []
    for index in range(max(len(share.powers_m2) for share in shares)):
        curvature, gradient = np.zeros((free.size, free.size)), np.zeros(free.size)
        for share in shares:
            normal = share.normal(index)
            curvature[np.ix_(share.places, share.places)] += normal[1:, 1:]
            gradient[share.places] += normal[1:, 0]
        inverse = covariance(Square(0.0, curvature, gradient, 0), free)
        if inverse is None:
            return None
        covariances.append(inverse)
        values.append(-inverse @ gradient)
    apart = np.stack(values) - np.mean(values, axis=0)
    return np.asarray(np.mean(covariances, axis=0) + apart.T @ apart / len(values))

"""Test whether the flights have accelerations that no law common to all shots can explain.

A camera records metres of track; an interferometer records millimetres of bearing.  With a camera each shot uses a
different stretch of track, which curves its flights.  Drag, friction, tilt and gradient are common to all shots.  The
remaining accelerations are per shot.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.special import chdtri

from analysis.collision import NUISANCES, Effect
from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import likeliest_floor, white_floor
from analysis.shot import Floats

_MIN_SHOTS = 3  # two shots have at most four flights, fewer than the five common laws
_MARGIN = 0.15  # contact times after the release at which the outgoing flight begins
_SHORTEST = 30  # fewest samples of a flight
_TURNS = 3  # iterations of fitting and noise estimation
_ONE_WAY = np.array([False, True, True, True, False])  # laws of one sign: friction and drags only brake


@dataclass(frozen=True, slots=True)
class _Flight:
    """One flight: its n samples, and its acceleration by each common law."""

    valid: NDArray[np.bool_]
    displacement_m: Floats
    columns: Floats  # offset, velocity and acceleration, shape (n, 3)
    laws: Floats  # acceleration for unit tilt, friction, drag, quadratic drag and gradient, shape (5,)
    weight: float


def per_shot_nuisances(shots: Sequence[Samples], chance: float) -> tuple[Effect, ...]:
    """Return the nuisance effects fitted per shot: none, or an acceleration of each flight.

    The accelerations are needed if the laws common to all shots fit the flights with a probability below ``chance``.
    Only records without optics are tested.  Cost: about 0.1 s.
    """
    if len(shots) < _MIN_SHOTS or any(shot.wavelength_m is not None for shot in shots):
        return ()
    flights = [flight for shot in shots for flight in _flights(shot)]
    if len(flights) <= len(_ONE_WAY):
        return ()
    spacing_s = shots[0].spacing_s
    shared, laws = _log_likelihood(flights, np.stack([flight.laws for flight in flights]), _ONE_WAY, spacing_s)
    own, bends = _log_likelihood(flights, np.eye(len(flights)), np.zeros(len(flights), dtype=np.bool_), spacing_s)
    limit = float(chdtri(bends - laws, chance))
    return tuple(NUISANCES.values()) if 2.0 * (own - shared) > limit else ()


def _flights(shot: Samples) -> Iterator[_Flight]:
    c, t = shot.course, shot.centre_s
    before = t < c.touch_time_s - 3 * shot.spacing_s
    after = t > c.release_time_s + _MARGIN * c.contact_time_s
    for part in (before, after):
        places = np.flatnonzero(part & shot.valid)
        if places.size < _SHORTEST:
            continue
        some = slice(int(places[0]), int(places[-1]) + 1)
        valid, x = shot.valid[some], shot.displacement_m[some]
        u = t[some] - float(np.mean(t[places]))
        speed, place = (float(value) for value in np.polyfit(u[valid], x[valid], 1))
        away = place - c.touch_position_m
        yield _Flight(
            valid,
            x,
            np.stack([np.ones(u.size), u, 0.5 * u**2], axis=1),
            np.array([1.0, -np.sign(speed), -speed, -speed * abs(speed), away]),
            shot.weight,
        )


def _log_likelihood(
    flights: Sequence[_Flight], bends: Floats, one_way: NDArray[np.bool_], spacing_s: float
) -> tuple[float, int]:
    """Return the log-likelihood of all flights, fitted as accelerated lines, and the number of active accelerations.

    The accelerations are ``bends``, shape (flights, k), times k parameters; those of ``one_way`` are not negative.  A
    parameter at its bound of zero is not active.  The noise is estimated from the residual.
    """
    count = len(flights)
    series = [f.displacement_m for f in flights]
    valid, weights = [f.valid for f in flights], [f.weight for f in flights]
    least = np.concatenate([np.full(2 * count, -np.inf), np.where(one_way, 0.0, -np.inf)])
    floor, value, acting = white_floor(1.0, spacing_s), -np.inf, 0
    blocks = []
    for index, flight in enumerate(flights):
        lines = np.zeros((flight.displacement_m.size, 2 * count))
        lines[:, 2 * index : 2 * index + 2] = flight.columns[:, :2]
        blocks.append(np.column_stack([lines, flight.columns[:, 2:] * bends[index]]))
    for _ in range(_TURNS):
        white = np.concatenate(
            [
                floor.whiten(np.column_stack([x, block]), v, w)
                for x, block, v, w in zip(series, blocks, valid, weights, strict=True)
            ]
        )
        scale = np.maximum(np.linalg.norm(white[:, 1:], axis=0), 1e-300)
        found = lsq_linear(white[:, 1:] / scale, white[:, 0], (least, np.inf), method="bvls")
        acting = int(np.sum(found.active_mask[2 * count :] == 0))
        left = [x - block @ (found.x / scale) for x, block in zip(series, blocks, strict=True)]
        floor, value = likeliest_floor(left, valid, spacing_s, weights=weights, start=floor)
    return value, acting

"""First guesses of plate and contact from one shot's displacement, for the fit to start from.

The motion of two linear bodies has no scale of its own: with the block's mass and the half period of the smooth
contact as units, a candidate moves alike in every shot.  So the candidates are solved once, and a shot is compared
with all of them by one matrix product.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from analysis.collision import PAPER, Collision, Floats, TooManyEvents, Variant, solve
from analysis.inference.fit.course import Course

MASS_RATIOS = np.geomspace(0.002, 0.1, 7)
STIFFNESS_RATIOS = np.geomspace(8, 1200, 8)
DAMPING_RATIOS = (0.04, 0.15, 0.4)
_POINTS = 420
_BEFORE, _AFTER = 0.1, 1.25  # of the contact time, from the touch
_MASS_KG, _RATE_RAD_PER_S = PAPER.block_mass_kg, 110.0  # of the shot for which the candidates are solved


@dataclass(frozen=True, slots=True)
class Guess:
    """A candidate and the rms in m of the contact that it leaves unexplained with flight and touch time fitted."""

    collision: Collision
    left_m: float


@dataclass(frozen=True, slots=True)
class _Patterns:
    """The solved candidates: times ``at``, shape (p,), in contact times from the touch.

    ``moves``, shape (c, p, 4), are the normalised derivatives of each by offset, velocity, touch time and stiffness.
    """

    candidates: tuple[Collision, ...]
    at: Floats
    moves: Floats


def around_contact(course: Course, time_s: Floats) -> slice:
    """Return the samples of the contact and a little flight."""
    begin = int(np.searchsorted(time_s, course.touch_time_s - _BEFORE * course.contact_time_s))
    end = int(np.searchsorted(time_s, course.touch_time_s + _AFTER * course.contact_time_s))
    return slice(begin, end)


def rank(
    course: Course, time_s: Floats, displacement_m: Floats, block_mass_kg: float, variant: Variant, one_body: bool
) -> list[Guess]:
    """Return candidates, best first, by the residual of the contact with flight and touch time fitted.

    Offset, velocity, touch time and the plate's stiffness are projected out linearly, so that the coarse grid only has
    to find the bounces: mass ratio, contact stiffness and damping.  About 2 ms; 40 ms the first time in a process.
    """
    patterns = _patterns(variant, one_body)
    good = np.flatnonzero(np.isfinite(displacement_m))
    wanted_s = course.touch_time_s + patterns.at * course.contact_time_s
    spacing_s = (time_s[-1] - time_s[0]) / max(time_s.size - 1, 1)
    nearest = good[np.clip(np.searchsorted(time_s[good], wanted_s), 0, good.size - 1)]
    there = np.abs(time_s[nearest] - wanted_s) < 2 * spacing_s
    if there.sum() < 2 * patterns.moves.shape[2]:
        return []
    measured = np.interp(wanted_s[there], time_s[good], displacement_m[good])
    measured = measured - measured.mean()
    bases = patterns.moves if there.all() else np.linalg.qr(patterns.moves[:, there])[0]
    inside = np.einsum("cpk,p->ck", bases, measured)
    left = measured - np.einsum("cpk,ck->cp", bases, inside)
    rms = np.sqrt(np.mean(left**2, axis=1))
    return [
        Guess(_scaled(patterns.candidates[k], course, block_mass_kg), float(rms[k])) for k in np.argsort(rms).tolist()
    ]


@lru_cache(maxsize=8)
def _patterns(variant: Variant, one_body: bool) -> _Patterns:
    at = np.linspace(-_BEFORE, _AFTER, _POINTS)
    times_s = at * np.pi / _RATE_RAD_PER_S
    kept, moves = [], []
    for candidate in _candidates(variant, one_body):
        try:
            run = solve(candidate, (), times_s, directions=range(7))
        except TooManyEvents:
            continue
        stiffness = run.displacement_derivatives[:, 2 if one_body else 0]
        columns = np.stack(
            [np.ones(at.size), run.displacement_derivatives[:, 4], run.velocity_m_per_s, stiffness], axis=1
        )
        scale = np.linalg.norm(columns, axis=0)
        if np.all(np.isfinite(columns)) and np.all(scale > 0):
            kept.append(candidate)
            moves.append(np.linalg.qr(columns / scale)[0])
    return _Patterns(tuple(kept), at, np.array(moves))


def _candidates(variant: Variant, one_body: bool) -> Iterator[Collision]:
    smooth = _MASS_KG * _RATE_RAD_PER_S**2
    v = PAPER.velocity_in_m_per_s
    for damping in DAMPING_RATIOS:
        if one_body:
            gamma = 2 * damping * np.sqrt(smooth * _MASS_KG)
            yield Collision(_MASS_KG, v, 0.0, np.inf, smooth, gamma, variant=variant)
            continue
        for mass_ratio in MASS_RATIOS:
            plate_mass = mass_ratio * _MASS_KG
            reduced = _MASS_KG * plate_mass / (_MASS_KG + plate_mass)
            for stiffness_ratio in STIFFNESS_RATIOS:
                contact = stiffness_ratio * smooth
                plate = smooth * (1 + mass_ratio) / max(0.3, 1 - 1 / stiffness_ratio)
                gamma = 2 * damping * np.sqrt(contact * reduced)
                yield Collision(_MASS_KG, v, plate, plate_mass, contact, gamma, variant=variant)


def _scaled(candidate: Collision, course: Course, block_mass_kg: float) -> Collision:
    """Return the candidate with a shot's mass, contact time and speed."""
    mass, rate = block_mass_kg / _MASS_KG, course.rate_rad_per_s / _RATE_RAD_PER_S
    return Collision(
        block_mass_kg,
        course.velocity_in_m_per_s,
        candidate.plate_stiffness_n_per_m * mass * rate**2,
        candidate.plate_mass_kg * mass,
        candidate.contact_stiffness_n_per_m * mass * rate**2,
        candidate.contact_damping_n_s_per_m * mass * rate,
        variant=candidate.variant,
    )


def usual(guesses: Sequence[Guess]) -> float:
    """Return the median residual of all candidates in m: that of a wrong sequence of bounces."""
    return float(np.median([guess.left_m for guess in guesses])) if guesses else 0.0

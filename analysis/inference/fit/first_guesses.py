"""First guesses of the shared parameters: candidates that resemble the fastest shot's contact, refined by short fits.

The motion of two linear bodies is scale-free: in units of block mass and smooth contact's half period, a candidate has
the same motion in every shot.  The candidates are therefore solved once, and one matrix product compares a shot with
all of them.
"""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from analysis.collision import PAPER, Collision, Infeasible, solve
from analysis.compiled import side_by_side
from analysis.inference.fit.least_squares import Minimum
from analysis.inference.fit.problem import Problem
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import Base
from analysis.inference.model.course import Course, NoCollision
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import white_floor
from analysis.shot import Cancelled, Floats, Stop
from analysis.signal import MIN_NOISE_M

_TRIED = 6  # maximum number of fitted candidates
_EVALUATIONS = 18
_SAME_PATTERN = 0.03  # largest residual of a correct bounce sequence over a wrong one's, even with missing effects
_SWAYED_PATTERN = 0.2  # the same if the whole residual may be frame motion
_APART = 0.03  # relative difference of a parameter below which guesses count as one
_BEFORE, _AFTER = 0.1, 1.25  # contact times before and after the touch that are compared
_AT = np.linspace(-_BEFORE, _AFTER, 420)  # contact times from the touch at which they are compared
_MASS_KG, _RATE_RAD_PER_S = PAPER.block_mass_kg, 110.0  # of the shot for which the candidates are solved


def resembling_candidates(base: Base, shots: Sequence[Samples], most: int) -> list[Floats]:
    """Return the shared parameters of up to ``most`` candidates that resemble the fastest shot's contact, best first.

    The candidates are not refined by a fit, since frame motion can bias a fit without it.  Empty with several plates.
    """
    return [base.shared(candidate) for candidate in rank(_fastest(shots), base)[0][:most]] if base.plates == 1 else []


def first_guesses(base: Base, shots: Sequence[Samples], stop: Stop, sways_m: float = 0.0) -> list[Floats]:
    """Return different sets of shared parameters, best first, by a short fit of the fastest shot's contact.

    ``sways_m`` is the rms of the frame's motion: a bounce sequence whose residual is below it is accepted as correct.
    With several plates there is one set: each plate's best, with the contact found on the plate with most shots.
    Raises NoCollision if no candidate fits, Cancelled on request.
    """
    if base.plates > 1:
        return [_plate_by_plate(base, shots, stop, sways_m)]
    shot = _fastest(shots)
    (ranked, left_m), contact = rank(shot, base), _contact_of(shot)
    white = white_floor(max(contact.course.noise_std_m, MIN_NOISE_M), contact.spacing_s)
    problem = Problem(JointData((contact,), base), (), white)

    def tried(candidate: Collision) -> tuple[Minimum, Floats] | None:
        if stop():
            raise Cancelled
        with contextlib.suppress(Infeasible):
            z = problem.pack(Point(base.shared(candidate), contact.course.own[None, :], ({},)))
            found = problem.search(z, evaluations=_EVALUATIONS, cancelled=stop)
            return found, problem.unpack(found.parameters).base
        return None

    first = tried(ranked[0]) if ranked else None
    usual = float(np.median(left_m)) if ranked else 0.0  # residual of wrong sequences
    enough = max(_SAME_PATTERN * usual, min(sways_m, _SWAYED_PATTERN * usual))
    if first is not None and white.white_m * math.sqrt(first[0].square.chi2 / first[0].square.samples) < enough:
        return [first[1]]
    trials = [trial for trial in (first, *side_by_side(tried, ranked[1:_TRIED])) if trial is not None]
    if not trials:
        raise NoCollision("no trajectory of the base model resembles this contact")
    trials.sort(key=lambda trial: trial[0].square.chi2)
    out: list[Floats] = []
    for _, shared in trials:
        if all(np.any(np.abs(shared - other) > _APART * np.abs(other)) for other in out):
            out.append(shared)
    return out


def _plate_by_plate(base: Base, shots: Sequence[Samples], stop: Stop, sways_m: float) -> Floats:
    one = base.on_plates(1)
    of_plate = [[replace(s, plate_number=0) for s in shots if s.plate_number == k] for k in range(base.plates)]
    best = [first_guesses(one, those, stop, sways_m)[0] for those in of_plate]
    most = max(range(base.plates), key=lambda k: len(of_plate[k]))
    out = np.empty(len(base.names))
    out[base.contact_at] = best[most][one.contact_at]
    for k, shared in enumerate(best):
        out[list(base.places(k)[:2])] = shared[:2]
    return out


def _contact_of(shot: Samples) -> Samples:
    """Return the averaged samples of the contact and a little flight only."""
    around_s = shot.course.touch_time_s + np.array([-_BEFORE, _AFTER]) * shot.course.contact_time_s
    near = slice(*np.searchsorted(shot.centre_s, around_s).tolist())
    fine = slice(near.start * shot.factor, near.stop * shot.factor)
    return replace(
        shot,
        time_s=shot.time_s[fine],
        used=shot.used[fine],
        centre_s=shot.centre_s[near],
        displacement_m=shot.displacement_m[near],
        valid=shot.valid[near],
        weight=1.0,
        sway=None,
    )


def _fastest(shots: Sequence[Samples]) -> Samples:
    return max(shots, key=lambda shot: abs(shot.course.velocity_in_m_per_s))


def rank(shot: Samples, base: Base) -> tuple[list[Collision], Floats]:
    """Return candidates, best first, and the rms residual in m of a shot's contact given each.

    Offset, velocity, touch time and plate stiffness are projected out linearly.  The coarse grid therefore covers only
    mass ratio, contact stiffness and damping, which determine the bounces.  About 2 ms; 40 ms for the first call.
    """
    candidates, moves = _patterns(base)
    course, time_s, good = shot.course, shot.centre_s, np.flatnonzero(shot.valid)
    wanted_s = course.touch_time_s + _AT * course.contact_time_s
    nearest = good[np.clip(np.searchsorted(time_s[good], wanted_s), 0, good.size - 1)]
    there = np.abs(time_s[nearest] - wanted_s) < 2 * shot.spacing_s
    if there.sum() < 2 * moves.shape[2]:
        return [], np.empty(0)
    measured = np.interp(wanted_s[there], time_s[good], shot.displacement_m[good])
    measured = measured - measured.mean()
    bases = moves if there.all() else np.linalg.qr(moves[:, there])[0]
    inside = np.einsum("cpk,p->ck", bases, measured)
    left = measured - np.einsum("cpk,ck->cp", bases, inside)
    rms = np.sqrt(np.mean(left**2, axis=1))
    order = np.argsort(rms)
    return [_scaled(candidates[k], course, shot.moving_mass_kg) for k in order.tolist()], rms[order]


@lru_cache(maxsize=8)
def _patterns(base: Base) -> tuple[tuple[Collision, ...], Floats]:
    """Return the c solved candidates, and the normalised derivatives of each at p times, shape (c, p, 4).

    They are by offset, velocity, touch time and stiffness.
    """
    times_s = _AT * np.pi / _RATE_RAD_PER_S
    kept, moves = [], []
    for candidate in base.candidates(_MASS_KG, _MASS_KG * _RATE_RAD_PER_S**2, PAPER.velocity_in_m_per_s):
        try:
            run = solve(candidate, (), times_s, directions=range(7))
        except Infeasible:
            continue
        stiffness = run.displacement_derivatives[:, base.in_kernel[0]]
        columns = np.stack(
            [np.ones(_AT.size), run.displacement_derivatives[:, 4], run.velocity_m_per_s, stiffness], axis=1
        )
        scale = np.linalg.norm(columns, axis=0)
        if np.all(np.isfinite(columns)) and np.all(scale > 0):
            kept.append(candidate)
            moves.append(np.linalg.qr(columns / scale)[0])
    return tuple(kept), np.array(moves)


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

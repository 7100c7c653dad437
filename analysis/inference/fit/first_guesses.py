"""First guesses of a set's shared parameters: candidates like the fastest shot's contact, and short fits of it."""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.inference.fit import guesses
from analysis.inference.fit.base import Base
from analysis.inference.fit.course import NoCollision
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.least_squares import Minimum
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.samples import Samples
from analysis.inference.fit.search_vector import JointData
from analysis.inference.noise.floor import white_floor
from analysis.shot import Cancelled, Floats, Stop
from analysis.signal import LEAST_NOISE_M

_TRIED = 6  # candidates
_EVALUATIONS = 18
_SAME_PATTERN = 0.03  # of a wrong sequence's residual: a right one leaves less, even where effects are missing
_SWAYED_PATTERN = 0.2  # the same where all of the residual may be the frame's motion
_APART = 0.03  # of a parameter: guesses nearer to each other than that count as one


def resembled(base: Base, shots: Sequence[Samples], most: int) -> list[Floats]:
    """Return the shared parameters of up to ``most`` candidates that resemble the fastest shot's contact, best first.

    Nothing is fitted, since a fit without the frame may be led astray by its motion.  Empty with several plates.
    """
    return [base.shared(guess.collision) for guess in _ranked(base, shots)[1][:most]] if base.plates == 1 else []


def first_guesses(base: Base, shots: Sequence[Samples], stop: Stop, sways_m: float = 0.0) -> list[Floats]:
    """Return different sets of shared parameters, best first, by a short fit of the fastest shot's contact.

    ``sways_m`` is the rms of the frame's motion: a sequence of bounces that leaves no more than that is the right one.
    With several plates there is one set, of each plate's best, with the contact found on the plate of most shots.
    Raises NoCollision where no candidate fits, Cancelled when asked to stop.
    """
    if base.plates > 1:
        return [_plate_by_plate(base, shots, stop, sways_m)]
    shot, ranked = _ranked(base, shots)
    contact = _contact_of(shot)
    white = white_floor(max(contact.course.noise_std_m, LEAST_NOISE_M), contact.spacing_s)
    problem = Problem(JointData((contact,), base), (), white)

    def tried(guess: guesses.Guess) -> tuple[Minimum, Floats] | None:
        if stop():
            raise Cancelled
        with contextlib.suppress(Infeasible):
            z = problem.pack(Point(base.shared(guess.collision), contact.course.own[None, :], ({},)))
            found = problem.search(z, evaluations=_EVALUATIONS, tolerance=1e-6, cancelled=stop)
            return found, problem.unpack(found.parameters).base
        return None

    first = tried(ranked[0]) if ranked else None
    usual = guesses.usual(ranked)
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
    one = replace(base, plates=1)
    of_plate = [[replace(s, plate_number=0) for s in shots if s.plate_number == k] for k in range(base.plates)]
    best = [first_guesses(one, those, stop, sways_m)[0] for those in of_plate]
    most = max(range(base.plates), key=lambda k: len(of_plate[k]))
    out = np.empty(len(base.names))
    out[base.contact_at] = best[most][one.contact_at]
    for k, shared in enumerate(best):
        out[list(base.places(k)[:2])] = shared[:2]
    return out


def _ranked(base: Base, shots: Sequence[Samples]) -> tuple[Samples, list[guesses.Guess]]:
    """Return the fastest shot and the candidates for its contact, best first."""
    shot = max(shots, key=lambda s: abs(s.course.velocity_in_m_per_s))
    seen_m = np.where(shot.valid, shot.displacement_m, np.nan)
    mass_kg = shot.moving_mass_kg
    return shot, guesses.rank(shot.course, shot.centre_s, seen_m, mass_kg, base.variant, base.one_body)


def _contact_of(shot: Samples) -> Samples:
    """Return the averaged samples of the contact and a little flight alone."""
    near = guesses.around_contact(shot.course, shot.centre_s)
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

"""Where the base model comes nearest: from first guesses, past wrong patterns of bounces, on frames that sway."""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision.parameters import Floats, Infeasible
from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit import guesses, starts
from analysis.inference.fit.base import Base
from analysis.inference.fit.least_squares import Minimum
from analysis.inference.fit.prepare import prepare_set
from analysis.inference.fit.response import Model, ShotData
from analysis.inference.fit.search import Problem, own_start, search
from analysis.inference.noise import noise as noise_model
from analysis.inference.noise.on_frame import on_frames
from analysis.inference.noise.sway import Swayed
from analysis.shot.disturbance import Shaking
from analysis.shot.motion import Motion
from analysis.shot.shot import Cancelled, Stop

_TRIED_STARTS = 6
_SAME_PATTERN = 0.03  # of what another pattern of bounces leaves: what missing effects do is smaller, a wrong one more
_SWAYED_PATTERN = 0.2  # ... where the frame's motion may be all that is left
_FOLLOWED_STARTS = 3
_TRIED_ON_FRAMES = 3
_LOUDER = 100.0
_DOWN = 1.5  # chi^2 a sample: as the frame and the beat would leave it
_EARLY = 0.3  # of the contact time: the bounces
STRONG = 30.0  # chi^2 a sample, above which a base fit may have been drawn far from its parameters


def first_guesses(base: Base, shots: Sequence[ShotData], stop: Stop, sways_m: float = 0.0) -> list[Floats]:
    """Return different sets of shared parameters, best first, by a short fit of the fastest shot's contact.

    ``sways_m`` is the rms of the frame's motion: a pattern of bounces that leaves no more is the right one.  Of several
    plates one set, the best of each, with the contact that the plate of most shots suggests.
    """
    if base.plates > 1:
        return [_plate_by_plate(base, shots, stop, sways_m)]
    shot, ranked = _ranked(base, shots)
    some = guesses.thinned(shot.course, shot.time_s)
    coarse = ShotData(
        shot.time_s[some],
        shot.displacement_m[some],
        shot.valid[some],
        shot.block_mass_kg,
        shot.course,
        noise_model.white(max(shot.course.noise_std_m, 1e-15)),
    )
    problem = Problem.of(Model(base), [coarse])

    def tried(guess: guesses.Guess) -> Minimum | None:
        if stop():
            raise Cancelled
        begin = np.concatenate([base.shared(guess.collision), own_start(coarse, problem.model)])
        with contextlib.suppress(Infeasible):
            return search(problem, begin, stop, evaluations=18)
        return None

    first = tried(ranked[0]) if ranked else None
    usual = guesses.usual(ranked)
    enough = max(_SAME_PATTERN * usual, min(sways_m, _SWAYED_PATTERN * usual))
    if first is not None and _left_m(first, coarse) < enough:
        return [first.parameters[: len(base.names)]]
    trials = [trial for trial in (first, *side_by_side(tried, ranked[1:_TRIED_STARTS])) if trial is not None]
    if not trials:
        raise starts.NoCollision("no trajectory of the base model resembles this contact")
    trials.sort(key=lambda trial: trial.square.chi2)
    out: list[Floats] = []
    for trial in trials:
        shared = trial.parameters[: len(base.names)]
        if all(np.any(np.abs(shared - other) > 0.03 * np.abs(other)) for other in out):
            out.append(shared)
    return out


def _plate_by_plate(base: Base, shots: Sequence[ShotData], stop: Stop, sways_m: float) -> Floats:
    one = replace(base, plates=1)
    of_plate = [[replace(s, plate_number=0) for s in shots if s.plate_number == k] for k in range(base.plates)]
    best = [first_guesses(one, those, stop, sways_m)[0] for those in of_plate]
    most = max(range(base.plates), key=lambda k: len(of_plate[k]))
    out = np.empty(len(base.names))
    out[base.contact_at] = best[most][one.contact_at]
    for k, shared in enumerate(best):
        out[list(base.places(k)[:2])] = shared[:2]
    return out


def _ranked(base: Base, shots: Sequence[ShotData]) -> tuple[ShotData, list[guesses.Guess]]:
    """Return the fastest shot and what its contact resembles, best first."""
    shot = max(shots, key=lambda s: abs(s.course.velocity_in_m_per_s))
    return shot, guesses.rank(
        shot.course, shot.time_s, shot.displacement_m, shot.block_mass_kg, base.variant, base.one_body
    )


def _left_m(found: Minimum, shot: ShotData) -> float:
    """Return the root mean square of what a minimum leaves of a shot with white noise, in m."""
    return shot.noise.std_m * math.sqrt(found.square.chi2 / found.square.samples)


def base_minimum(bare: Problem, begins: Sequence[Floats], stop: Stop) -> Minimum:
    """Return the best minimum of the base model; one far above the noise makes the other starts worth trying.

    Such a remainder is either an effect's or a wrong pattern of bounces; the first bounces alone tell which.
    """
    best = search(bare, begins[0], stop)
    if best.square.chi2 < STRONG * best.square.samples:
        return best
    early = early_minimum(bare, best.parameters, stop)
    others = list(begins[1:_FOLLOWED_STARTS])
    if early is not None and early.square.chi2 < STRONG * early.square.samples:
        others = [early.parameters]
    for begin in others:
        with contextlib.suppress(Infeasible):
            trial = search(bare, begin, stop)
            if trial.square.chi2 < best.square.chi2:
                best = trial
            if best.square.chi2 < STRONG * best.square.samples:
                break
    return best


def base_on_frames(
    base: Base,
    motions: Sequence[Motion],
    shots: Sequence[ShotData],
    known: Sequence[Shaking | None],
    begins: Sequence[Floats],
    stop: Stop,
) -> tuple[Floats, Problem, Minimum]:
    """Return where the frames' noise was computed, the problem on frames and its minimum.

    Where there are no ``begins``, from what the fastest shot's contact resembles: a fit that knows of no frame, however
    short, may be led far away by what the frame does.
    """
    own = [own_start(shot, Model(base)) for shot in shots]
    found: list[tuple[Floats, Problem, Minimum]] = []
    resembled = [] if begins or base.plates > 1 else _ranked(base, shots)[1][:_TRIED_ON_FRAMES]
    for shared in (base.shared(guess.collision) for guess in resembled):
        with contextlib.suppress(Infeasible):
            found.append(_coarse_to_fine(base, shots, known, shared, own, stop))
            if _a_sample(found[-1][2]) < _DOWN:
                return found[-1]
    begins = begins or first_guesses(base, shots, stop, max(one.rms_m for one in known if one))
    with contextlib.suppress(Infeasible):
        problem = Problem.of(Model(base), on_frames(shots, known, base, begins[0], own))
        least = base_minimum(problem, [np.concatenate([shared, *own]) for shared in begins], stop)
        found.append((begins[0], problem, least))
    if not found or min(_a_sample(least) for _, _, least in found) > STRONG:
        found.append(_by_way_of_rest(base, motions, shots, known, stop))
    return min(found, key=lambda one: one[2].square.chi2)


def _coarse_to_fine(
    base: Base,
    shots: Sequence[ShotData],
    known: Sequence[Shaking | None],
    shared: Floats,
    own: Sequence[Floats],
    stop: Stop,
) -> tuple[Floats, Problem, Minimum]:
    """Return where a fit ends that takes the beat for louder than it is, and then for what it is.

    Beside a sway that is much larger than the beat's noise only what is quick and small speaks for the bounces: their
    valleys are narrow and bent, and too far from a first guess to be seen.
    """
    loud = [replace(shot, noise=shot.noise.louder(_LOUDER)) for shot in shots if not isinstance(shot.noise, Swayed)]
    begin = np.concatenate([shared, *own])
    rough = search(Problem.of(Model(base), on_frames(loud, known, base, shared, own)), begin, stop, evaluations=30)
    count, each = shared.size, own[0].size
    shared = rough.parameters[:count]
    mine = list(rough.parameters[count:].reshape(-1, each))
    problem = Problem.of(Model(base), on_frames(shots, known, base, shared, mine))
    return shared, problem, search(problem, rough.parameters, stop)


def _a_sample(found: Minimum) -> float:
    return found.square.chi2 / found.square.samples


def _by_way_of_rest(
    base: Base, motions: Sequence[Motion], shots: Sequence[ShotData], known: Sequence[Shaking | None], stop: Stop
) -> tuple[Floats, Problem, Minimum]:
    """Return where a fit ends that takes what frames do for noise, the problem on frames from there and its minimum.

    What frames do leaves little but bounces to hold on to: where an effect is missing, too, a start that is not near
    is drawn to no collision at all.
    """
    at_rest = replace(base, swings=False)
    still = Problem.of(Model(at_rest), prepare_set(motions))
    own = [own_start(shot, still.model) for shot in still.shots]
    begins = first_guesses(at_rest, still.shots, stop)
    there = base_minimum(still, [np.concatenate([shared, *own]) for shared in begins], stop).parameters
    shared, mine = there[: still.shared], [np.pad(there[still.own_slice(k)], (0, 2)) for k in range(len(shots))]
    problem = Problem.of(Model(base), on_frames(shots, known, base, shared, mine))
    return shared, problem, search(problem, np.concatenate([shared, *mine]), stop)


def early_minimum(bare: Problem, parameters: Floats, stop: Stop) -> Minimum | None:
    """Return the base parameters that the first bounces alone suggest, or None where they suggest none.

    Most effects build up with time, travel or deflection: over the first bounces they have disturbed little, whereas
    a fit of the whole shot may have left the bounces' valley to make up for them.
    """
    shots = []
    for shot in bare.shots:
        early = shot.valid & (shot.time_s < shot.course.touch_time_s + _EARLY * shot.course.contact_time_s)
        noise = shot.noise
        if isinstance(noise, Swayed):
            noise = noise.of_first(int(np.count_nonzero(noise.beat.whole(early))))
        shots.append(replace(shot, valid=early, noise=noise))
    problem = Problem.of(bare.model, shots)
    try:
        return search(problem, parameters, stop, evaluations=30)
    except Infeasible:
        return None

"""A model fitted to one shot or to several at once, in displacement, with honest uncertainties."""

import contextlib
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis import noise as noise_model
from analysis.disturbance import Shaking
from analysis.fit import Fit
from analysis.model import guesses, starts
from analysis.model.build_fit import Estimate, Part, Path, build_fit
from analysis.model.effect_starts import effect_starts
from analysis.model.effects import MOST_AT_ONCE, findings, named
from analysis.model.least_squares import Infeasible, Minimum, covariance
from analysis.model.on_frame import can_tell, elsewhere, on_frames
from analysis.model.parameters import Floats, Variant
from analysis.model.response import DEFAULT_WAVELENGTH_M, Base, Model, ShotData, respond
from analysis.model.search import Problem, own_start, search
from analysis.model.sway import BELOW_HZ, Swayed
from analysis.motion import Motion
from analysis.shot import AnalysisError, Cancelled, Progress, Stop
from analysis.side_by_side import side_by_side

MODELS = ("paper", "clamped", "no_tension", "contact")
FITTED_CONTACT_TIMES = 5.0  # of flight on either side that take part in the fit
_TRIED_STARTS = 6
_SAME_PATTERN = 0.03  # of what another pattern of bounces leaves: what missing effects do is smaller, a wrong one more
_SWAYED_PATTERN = 0.2  # ... where the frame's motion may be all that is left
_FOLLOWED_STARTS = 3
_EARLY = 0.3  # of the contact time: the bounces
_STRONG = 30.0  # chi^2 a sample, above which a base fit may have been drawn far from its parameters
_LAST_EVALUATIONS = 120  # for the best of several searches that were all cut short
_FRAME_TURNS = 4  # of a fit and the frame's noise about it
_GOOD_ENOUGH = 1.1  # chi^2 a sample: a minimum down at the noise, no other start can do better


def fit_shots(
    motions: Sequence[Motion],
    *,
    model: str = "paper",
    effects: Sequence[str] = (),
    start: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
    shakings: Sequence[Shaking | None] = (),
) -> Fit:
    """Fit base ``model`` and ``effects`` (at most three) to the displacement of ``motions``.

    Plate, contact and effects are shared, each shot has its own start (and own effect parameters where the catalogue
    says so).  ``start`` may give parameters by name ("plate_stiffness_n_per_m", "tilt.angle_rad"); what it lacks is
    found from the data.  Several starts of the effects are tried and the best minimum kept.  ``shakings`` say what
    shook the frame of each shot: the fit of two bodies then weighs what that does in flight and in contact, and lets
    the plate swing before it is touched as far as the frame can have made it.  Raises ValueError for unknown names,
    NoCollision (an AnalysisError) where a motion shows no collision, AnalysisError where no motion of
    the model comes near, Cancelled when asked to stop.
    A search that did not end in a minimum comes back with ``converged`` False: its numbers are no result.
    """
    began = time.perf_counter()
    if not motions:
        raise ValueError("no shot to fit")
    if len(findings(effects)) > MOST_AT_ONCE or len(set(effects)) != len(effects):
        raise ValueError(f"effects must be at most {MOST_AT_ONCE} different ones")
    given = dict(start or {})
    base = base_named(model)
    rows = tuple(named(name) for name in effects)
    tell = progress or (lambda _what, _fraction: None)
    stop = cancelled or (lambda: False)
    tell("reading the flights", 0.0)
    shaken = model == "paper" and "plate_motion" not in effects and all(can_tell(motion) for motion in motions)
    known = [*shakings, *[None] * len(motions)][: len(motions)] if shaken else [None] * len(motions)
    shots = [prepare(motion, shaking) for motion, shaking in zip(motions, known, strict=True)]
    tell("finding a start", 0.1)
    base = replace(base, swings=any(known))
    own = [own_start(shot, Model(base)) for shot in shots]
    try:
        if all(name in given for name in base.names):
            begins = [np.array([float(given[name]) for name in base.names])]
        else:
            begins = first_guesses(base, shots, stop, max((one.rms_m for one in known if one), default=0.0))
        tell("fitting", 0.4)
        if any(known):
            before, bare, found = _base_on_frames(base, motions, shots, known, begins, stop)
        else:
            before, bare = begins[0], Problem.of(Model(base), shots)
            found = _base_minimum(bare, [np.concatenate([shared, *own]) for shared in begins], stop)
        problem = bare
        for _ in range(_FRAME_TURNS):
            here = found.parameters
            if not elsewhere(shots, known, before, here[: bare.shared]):
                break
            before, mine = here[: bare.shared], [here[bare.own_slice(index)] for index in range(len(shots))]
            bare = problem = Problem.of(Model(base), on_frames(bare.shots, known, base, here, mine))
            found = search(bare, here, stop)
        if rows:
            tell("fitting the effects", 0.6)
            problem, found = _with_effects(bare, found, Model(base, rows), given, stop)
    except Infeasible as why:
        raise AnalysisError(f"no motion of the {model} model comes near these shots: {why}") from why
    tell("uncertainties", 0.9)
    fit = fit_of(model, problem, motions, found, time.perf_counter() - began)
    tell("fitted", 1.0)
    return fit


def base_named(model: str) -> Base:
    """Return the base model of that name; ValueError names those there are."""
    if model == "contact":
        return Base(Variant.PAPER, one_body=True)
    if model not in MODELS:
        raise ValueError(f"no base model {model!r}; there are {', '.join(MODELS)}")
    return Base(Variant.named(model), one_body=False)


def prepare(motion: Motion, shaking: Shaking | None = None) -> ShotData:
    """Read a motion's flights and the beat's noise, ``shaking`` apart; NoCollision says why there is nothing to fit."""
    valid = np.asarray(motion.valid & np.isfinite(motion.displacement_m))
    course = starts.read(motion.time_s, motion.displacement_m, valid)
    quiet_in, quiet_out = starts.quiet_stretches(course, motion.displacement_m, valid)
    above_hz = 0.0 if shaking is None else BELOW_HZ
    noise = noise_model.estimate(quiet_in, quiet_out, 1 / motion.sample_rate_hz, above_hz=above_hz)
    # Flights of seconds around a contact of milliseconds tell more of the track than of the collision.
    around = FITTED_CONTACT_TIMES * course.contact_time_s
    near = (motion.time_s > course.touch_time_s - around) & (motion.time_s < course.release_time_s + around)
    return ShotData(
        motion.time_s,
        motion.displacement_m,
        valid & near,
        motion.moving_mass_kg,
        course,
        noise,
        motion.wavelength_m or DEFAULT_WAVELENGTH_M,
        motion.sample_rate_hz,
    )


def first_guesses(base: Base, shots: Sequence[ShotData], stop: Stop, sways_m: float = 0.0) -> list[Floats]:
    """Return different sets of shared parameters, best first, by a short fit of the fastest shot's contact.

    ``sways_m`` is the rms of the frame's motion: a pattern of bounces that leaves no more is the right one.
    """
    shot = max(shots, key=lambda s: abs(s.course.velocity_in_m_per_s))
    ranked = guesses.rank(
        shot.course, shot.time_s, shot.displacement_m, shot.block_mass_kg, base.variant, base.one_body
    )
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


def _left_m(found: Minimum, shot: ShotData) -> float:
    """Return the root mean square of what a minimum leaves of a shot with white noise, in m."""
    return shot.noise.std_m * math.sqrt(found.square.chi2 / found.square.samples)


def _base_minimum(bare: Problem, begins: Sequence[Floats], stop: Stop) -> Minimum:
    """Return the best minimum of the base model; one far above the noise makes the other starts worth trying.

    Such a remainder is either an effect's or a wrong pattern of bounces; the first bounces alone tell which.
    """
    best = search(bare, begins[0], stop)
    if best.square.chi2 < _STRONG * best.square.samples:
        return best
    early = _early(bare, best.parameters, stop)
    others = list(begins[1:_FOLLOWED_STARTS])
    if early is not None and early.square.chi2 < _STRONG * early.square.samples:
        others = [early.parameters]
    for begin in others:
        with contextlib.suppress(Infeasible):
            trial = search(bare, begin, stop)
            if trial.square.chi2 < best.square.chi2:
                best = trial
            if best.square.chi2 < _STRONG * best.square.samples:
                break
    return best


def _base_on_frames(
    base: Base,
    motions: Sequence[Motion],
    shots: Sequence[ShotData],
    known: Sequence[Shaking | None],
    begins: Sequence[Floats],
    stop: Stop,
) -> tuple[Floats, Problem, Minimum]:
    """Return where the frames' noise was computed, the problem on frames and its minimum."""
    own = [own_start(shot, Model(base)) for shot in shots]
    found: list[tuple[Floats, Problem, Minimum]] = []
    with contextlib.suppress(Infeasible):
        problem = Problem.of(Model(base), on_frames(shots, known, base, begins[0], own))
        least = _base_minimum(problem, [np.concatenate([shared, *own]) for shared in begins], stop)
        found.append((begins[0], problem, least))
    if not found or least.square.chi2 > _STRONG * least.square.samples:
        found.append(_by_way_of_rest(base, motions, shots, known, stop))
    return min(found, key=lambda one: one[2].square.chi2)


def _by_way_of_rest(
    base: Base, motions: Sequence[Motion], shots: Sequence[ShotData], known: Sequence[Shaking | None], stop: Stop
) -> tuple[Floats, Problem, Minimum]:
    """Return where a fit ends that takes what frames do for noise, the problem on frames from there and its minimum.

    What frames do leaves little but bounces to hold on to: where an effect is missing, too, a start that is not near
    is drawn to no collision at all.
    """
    at_rest = replace(base, swings=False)
    still = Problem.of(Model(at_rest), [prepare(motion) for motion in motions])
    own = [own_start(shot, still.model) for shot in still.shots]
    begins = first_guesses(at_rest, still.shots, stop)
    there = _base_minimum(still, [np.concatenate([shared, *own]) for shared in begins], stop).parameters
    shared, mine = there[: still.shared], [np.pad(there[still.own_slice(k)], (0, 2)) for k in range(len(shots))]
    problem = Problem.of(Model(base), on_frames(shots, known, base, shared, mine))
    return shared, problem, search(problem, np.concatenate([shared, *mine]), stop)


def _with_effects(
    bare: Problem, base_minimum: Minimum, model: Model, given: Mapping[str, float], stop: Stop
) -> tuple[Problem, Minimum]:
    """Return the best joint minimum over the starts that the base fit's remainder suggests."""
    best: tuple[Problem, Minimum] | None = None
    why: Infeasible | None = None
    if model.own_names == bare.model.own_names and all(name in given for name in model.shared_names):
        chosen = tuple((name, given.get(name, p.scale)) for name, _, _, p in model.effect_parameters if p.fixed)
        problem = Problem(Model(model.base, model.effects, chosen), bare.shots, bare.whitened)
        own = base_minimum.parameters[bare.shared :]
        begin = np.concatenate([[float(given[name]) for name in model.shared_names], own])
        with contextlib.suppress(Infeasible):
            best = (problem, search(problem, begin, stop, evaluations=40))
            if best[1].converged:
                return best
    bases = [base_minimum.parameters]
    if base_minimum.square.chi2 > _STRONG * base_minimum.square.samples:
        early = _early(bare, base_minimum.parameters, stop)
        if early is not None:
            bases.insert(0, early.parameters)
    for chosen, begin in effect_starts(bare, bases, model, given):
        problem = Problem(Model(model.base, model.effects, chosen), bare.shots, bare.whitened)
        try:
            trial = search(problem, begin, stop, evaluations=40)
        except Infeasible as reason:
            why = reason
            continue
        better = best is None or trial.square.chi2 < best[1].square.chi2 - 1e-3
        if better and (best is None or trial.converged or not best[1].converged):
            best = (problem, trial)
            if trial.converged and trial.square.chi2 < _GOOD_ENOUGH * trial.square.samples:
                break
    if best is not None and not best[1].converged:
        with contextlib.suppress(Infeasible):
            best = (best[0], search(best[0], best[1].parameters, stop, evaluations=_LAST_EVALUATIONS))
    if best is None:
        raise Infeasible(f"no start of {', '.join(e.name for e in model.effects)} gives a trajectory: {why}")
    return best


def _early(bare: Problem, parameters: Floats, stop: Stop) -> Minimum | None:
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


def fit_of(model_name: str, problem: Problem, motions: Sequence[Motion], found: Minimum, seconds: float) -> Fit:
    """Return a minimum as a Fit."""
    model, count = problem.model, problem.shared
    free = np.ones(found.parameters.size, dtype=np.bool_)
    free[list(found.at_bound)] = False
    freedom = max(1, found.square.samples - int(free.sum()))
    inverse = covariance(found.square, free)
    known = np.full((found.parameters.size, found.parameters.size), np.nan) if inverse is None else inverse
    flags = [f"{model.shared_names[i]}_at_bound" for i in found.at_bound if i < count]
    if not all(shot.noise.trusted for shot in problem.shots):
        flags.append("noise_not_known")
    estimate = Estimate(
        model=model_name,
        effects=tuple(effect.name for effect in model.effects),
        values=found.parameters,
        # A remainder above the noise must not make the parameters look better known than they are (Birge's ratio).
        covariance=known * max(1.0, found.square.chi2 / freedom),
        shared={name: place for place, name in enumerate(model.shared_names)},
        free=int(free.sum()),
        converged=found.converged,
        how="fit",
        chosen=dict(model.chosen),
        flags=tuple(flags),
    )
    parts = [_part(problem, index, motion, found) for index, motion in enumerate(motions)]
    noise_std_m = float(np.sqrt(np.mean([shot.noise.std_m**2 for shot in problem.shots])))
    return build_fit(estimate, parts, noise_std_m, seconds)


def _part(problem: Problem, index: int, motion: Motion, found: Minimum) -> Part:
    model, shot, places = problem.model, problem.shots[index], problem.places(index)
    own = found.parameters[problem.own_slice(index)]
    response = respond(model, shot, found.parameters[: problem.shared], own)
    rest = np.where(shot.valid, shot.displacement_m - response.displacement_m, 0.0)
    return Part(
        motion=motion,
        own={name: int(place) for name, place in zip(model.own_names, places[problem.shared :], strict=True)},
        path=Path.of(response, float(own[1])),
        used=shot.valid,
        whitened=shot.noise.whiten(rest, shot.valid),
        frame_m_per_s=shot.noise.speeds_m_per_s if isinstance(shot.noise, Swayed) else (0.0, 0.0),
    )

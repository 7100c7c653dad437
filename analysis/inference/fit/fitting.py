"""A model fitted to one shot or to several at once, in displacement, with honest uncertainties."""

import contextlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects import MOST_AT_ONCE, findings, named
from analysis.collision.parameters import Infeasible
from analysis.inference.fit.base_minimum import STRONG, base_minimum, base_on_frames, early_minimum, first_guesses
from analysis.inference.fit.build_fit import Estimate, Part, Path, build_fit
from analysis.inference.fit.effect_starts import effect_starts
from analysis.inference.fit.least_squares import Minimum, covariance
from analysis.inference.fit.prepare import base_of, prepare_set
from analysis.inference.fit.response import Model, respond
from analysis.inference.fit.search import Problem, own_start, search
from analysis.inference.noise.frame_residual import sway_left_std_m
from analysis.inference.noise.learned_sway import LearnedSway, with_learned_sway
from analysis.inference.noise.noise import Noise
from analysis.inference.noise.on_frame import can_tell, elsewhere, on_frames
from analysis.inference.noise.sway import Swayed
from analysis.shot.disturbance import Shaking
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisError, Progress, Stop

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

    Contact and effects are shared, the plate by the shots that state the same; each shot has its own start (and own
    effect parameters where the catalogue says so).  ``start`` may give parameters by name ("plate_stiffness_n_per_m",
    "tilt.angle_rad"); what it lacks is found from the data.  Several starts of the effects are tried and the best
    minimum kept.  ``shakings`` say what shook the frame of each shot: the fit of two bodies then weighs what that does
    in flight and in contact, and lets the plate swing before it is touched as far as the frame can have made it.
    Raises ValueError for unknown names, NoCollision (an AnalysisError) where a motion shows no collision, AnalysisError
    where no motion of the model comes near, Cancelled when asked to stop.
    A search that did not end in a minimum comes back with ``converged`` False: its numbers are no result.
    """
    began = time.perf_counter()
    if not motions:
        raise ValueError("no shot to fit")
    if len(findings(effects)) > MOST_AT_ONCE or len(set(effects)) != len(effects):
        raise ValueError(f"effects must be at most {MOST_AT_ONCE} different ones")
    given = dict(start or {})
    base = base_of(model, motions)
    rows = tuple(named(name) for name in effects)
    tell = progress or (lambda _what, _fraction: None)
    stop = cancelled or (lambda: False)
    tell("reading the flights", 0.0)
    shaken = model == "paper" and "plate_motion" not in effects and all(can_tell(motion) for motion in motions)
    known = [*shakings, *[None] * len(motions)][: len(motions)] if shaken else [None] * len(motions)
    shots = prepare_set(motions, known)
    tell("finding a start", 0.1)
    base = replace(base, swings=any(known))
    own = [own_start(shot, Model(base)) for shot in shots]
    try:
        begins = []
        if all(name in given for name in base.names):
            begins = [np.array([float(given[name]) for name in base.names])]
        if any(known):
            before, bare, found = base_on_frames(base, motions, shots, known, begins, stop)
        else:
            begins = begins or first_guesses(base, shots, stop)
            tell("fitting", 0.4)
            before, bare = begins[0], Problem.of(Model(base), shots)
            found = base_minimum(bare, [np.concatenate([shared, *own]) for shared in begins], stop)
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
        learned = None
        if any(known) and found.converged:
            tell("weighing the frame's motion", 0.8)
            with contextlib.suppress(Infeasible, np.linalg.LinAlgError):  # two parameters that do the same
                learned = with_learned_sway(problem, found, known, _free(found), stop)
    except Infeasible as why:
        raise AnalysisError(f"no motion of the {model} model comes near these shots: {why}") from why
    tell("uncertainties", 0.9)
    fit = fit_of(model, problem, motions, found, time.perf_counter() - began, learned)
    tell("fitted", 1.0)
    return fit


def _with_effects(
    bare: Problem, of_base: Minimum, model: Model, given: Mapping[str, float], stop: Stop
) -> tuple[Problem, Minimum]:
    """Return the best joint minimum over the starts that the base fit's remainder suggests."""
    best: tuple[Problem, Minimum] | None = None
    why: Infeasible | None = None
    if model.own_names == bare.model.own_names and all(name in given for name in model.shared_names):
        chosen = tuple((name, given.get(name, p.scale)) for name, _, _, p in model.effect_parameters if p.fixed)
        problem = Problem(Model(model.base, model.effects, chosen), bare.shots, bare.whitened)
        own = of_base.parameters[bare.shared :]
        begin = np.concatenate([[float(given[name]) for name in model.shared_names], own])
        with contextlib.suppress(Infeasible):
            best = (problem, search(problem, begin, stop, evaluations=40))
            if best[1].converged:
                return best
    bases = [of_base.parameters]
    if of_base.square.chi2 > STRONG * of_base.square.samples:
        early = early_minimum(bare, of_base.parameters, stop)
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


def fit_of(
    model_name: str,
    problem: Problem,
    motions: Sequence[Motion],
    found: Minimum,
    seconds: float,
    learned: LearnedSway | None = None,
) -> Fit:
    """Return a minimum as a Fit; with ``learned`` its values and covariance, chi^2 by what was known before."""
    weighed = problem
    free = _free(found)
    inverse = covariance(found.square, free)
    if learned is not None and learned.found.converged and learned.covariance is not None:
        weighed, found, inverse = learned.problem, learned.found, learned.covariance
    model, count = problem.model, problem.shared
    freedom = max(1, found.square.samples - int(free.sum()))
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
    parts = [_part(problem, weighed.shots[index].noise, index, motion, found) for index, motion in enumerate(motions)]
    noise_std_m = float(np.sqrt(np.mean([shot.noise.std_m**2 for shot in problem.shots])))
    return build_fit(estimate, parts, noise_std_m, seconds)


def _free(found: Minimum) -> NDArray[np.bool_]:
    """Return which parameters no bound holds, shape (p,)."""
    free = np.ones(found.parameters.size, dtype=np.bool_)
    free[list(found.at_bound)] = False
    return free


def _part(problem: Problem, noise: Noise | Swayed, index: int, motion: Motion, found: Minimum) -> Part:
    """Return a shot's part; ``noise`` is the one it was fitted with, which says how its frame sways."""
    model, shot, places = problem.model, problem.shots[index], problem.places(index)
    own = found.parameters[problem.own_slice(index)]
    response = respond(model, shot, found.parameters[: problem.shared], own)
    rest = np.where(shot.valid, shot.displacement_m - response.displacement_m, 0.0)
    swayed = noise if isinstance(noise, Swayed) else None
    return Part(
        motion=motion,
        own={name: int(place) for name, place in zip(model.own_names, places[problem.shared :], strict=True)},
        path=Path.of(response, float(own[1])),
        used=shot.valid,
        whitened=shot.noise.whiten(rest, shot.valid),
        plate_number=shot.plate_number,
        frame_m_per_s=swayed.speeds_m_per_s if swayed else (0.0, 0.0),
        sway_std_m=sway_left_std_m(swayed, shot.time_s, shot.valid, response.derivatives) if swayed else None,
    )

"""The base model fitted to one shot or to several at once, in displacement, with honest uncertainties."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis import noise as noise_model
from analysis.fit import Fit, ShotFit
from analysis.model import guesses, starts
from analysis.model.coordinates import Coordinates
from analysis.model.exact import Trajectory
from analysis.model.least_squares import Infeasible, Minimum, Square, covariance, minimise
from analysis.model.overlay import lay_over
from analysis.model.parameters import Floats, Variant
from analysis.model.response import OWN_NAMES, Base, Response, ShotData, respond
from analysis.motion import Motion
from analysis.quantity import Quantity
from analysis.shot import Cancelled

Progress = Callable[[str, float], None]
MODELS = ("paper", "clamped", "no_tension", "contact")
FITTED_CONTACT_TIMES = 5.0  # of flight on either side that take part in the fit
_TRIED_STARTS = 6


def fit_shots(
    motions: Sequence[Motion],
    *,
    model: str = "paper",
    effects: Sequence[str] = (),
    start: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Fit:
    """Fit the base ``model`` to the displacement of ``motions``: plate and contact shared, own start a shot.

    ``start`` may give shared parameters by name; otherwise the data alone do.  Raises ValueError for an unknown model,
    NoCollision (an AnalysisError) where a motion shows no collision, Cancelled when asked to stop.  A search that did
    not end in a minimum comes back with ``converged`` False: its numbers are no result.
    """
    began = time.perf_counter()
    if not motions:
        raise ValueError("no shot to fit")
    if effects:
        raise ValueError("effects are not fitted yet")
    base = base_named(model)
    tell = progress or (lambda _what, _fraction: None)
    stop = cancelled or (lambda: False)
    tell("reading the flights", 0.0)
    shots = [prepare(motion) for motion in motions]
    tell("finding a start", 0.1)
    shared = _given(base, start) if start else _first_guess(base, shots, stop)
    tell("fitting", 0.5)
    own = [np.array([s.course.velocity_in_m_per_s, s.course.touch_time_s, s.course.touch_position_m]) for s in shots]
    found = _search(base, shots, shared, own, stop)
    tell("uncertainties", 0.9)
    fit = _result(model, base, motions, shots, found, time.perf_counter() - began)
    tell("fitted", 1.0)
    return fit


def base_named(model: str) -> Base:
    """Return the base model of that name; ValueError names those there are."""
    if model == "contact":
        return Base(Variant.PAPER, one_body=True)
    if model not in MODELS:
        raise ValueError(f"no base model {model!r}; there are {', '.join(MODELS)}")
    return Base(Variant.named(model), one_body=False)


def prepare(motion: Motion) -> ShotData:
    """Read a motion's flights and noise; NoCollision says why there is nothing to fit."""
    valid = np.asarray(motion.valid & np.isfinite(motion.displacement_m))
    course = starts.read(motion.time_s, motion.displacement_m, valid)
    quiet_in, quiet_out = starts.quiet_stretches(course, motion.displacement_m, valid)
    noise = noise_model.estimate(quiet_in, quiet_out, 1 / motion.sample_rate_hz)
    # Flights of seconds around a contact of milliseconds tell more of the track than of the collision.
    around = FITTED_CONTACT_TIMES * course.contact_time_s
    near = (motion.time_s > course.touch_time_s - around) & (motion.time_s < course.release_time_s + around)
    return ShotData(motion.time_s, motion.displacement_m, valid & near, motion.moving_mass_kg, course, noise)


def _given(base: Base, start: Mapping[str, float]) -> Floats:
    missing = [name for name in base.names if name not in start]
    if missing:
        raise ValueError(f"the start lacks {', '.join(missing)}")
    return np.array([float(start[name]) for name in base.names])


def _first_guess(base: Base, shots: Sequence[ShotData], stop: Callable[[], bool]) -> Floats:
    """Return the shared parameters that a short fit of the fastest shot's contact likes best."""
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
    course = shot.course
    best: Minimum | None = None
    for candidate in ranked[:_TRIED_STARTS]:
        if stop():
            raise Cancelled
        own = np.array([course.velocity_in_m_per_s, course.touch_time_s, course.touch_position_m])
        try:
            trial = _search(base, [coarse], base.shared(candidate), [own], stop, evaluations=18)
        except Infeasible:
            continue
        if best is None or trial.square.chi2 < best.square.chi2:
            best = trial
    if best is None:
        raise starts.NoCollision("no trajectory of the base model resembles this contact")
    return best.parameters[: len(base.names)]


def _search(
    base: Base,
    shots: Sequence[ShotData],
    shared: Floats,
    own: Sequence[Floats],
    stop: Callable[[], bool],
    evaluations: int = 60,
) -> Minimum:
    count = len(base.names)
    measured = [shot.noise.whiten(shot.displacement_m, shot.valid) for shot in shots]

    def square_at(parameters: Floats) -> Square:
        size = parameters.size
        curvature, gradient = np.zeros((size, size)), np.zeros(size)
        chi2, samples = 0.0, 0
        for index, shot in enumerate(shots):
            mine = slice(count + 3 * index, count + 3 * index + 3)
            response = respond(base, shot, parameters[:count], parameters[mine])
            both = np.column_stack([response.displacement_m, response.derivatives])
            both = shot.noise.whiten(both, shot.valid)
            residual = both[:, 0] - measured[index]
            jacobian = both[:, 1:]
            place = np.r_[0:count, mine]
            curvature[np.ix_(place, place)] += jacobian.T @ jacobian
            gradient[place] += jacobian.T @ residual
            chi2 += float(residual @ residual)
            samples += residual.size
        if not np.isfinite(chi2):
            raise Infeasible("the trajectory is not finite")
        return Square(chi2, curvature, gradient, samples)

    coordinates = Coordinates(
        block_mass_kg=shots[0].block_mass_kg,
        plate=not base.one_body,
        own_at=tuple(count + 3 * index for index in range(len(shots))),
        reference_s=tuple(shot.course.touch_time_s for shot in shots),
    )

    def function(z: Floats) -> Square:
        parameters, slope = coordinates.to_parameters(z)
        at = square_at(parameters)
        return Square(at.chi2, slope.T @ at.curvature @ slope, slope.T @ at.gradient, at.samples)

    begin = coordinates.to_search(np.concatenate([shared, *own]))
    lower = np.full(begin.size, -np.inf)
    lower[count - 1] = 0.0  # a dashpot never drives
    found = minimise(function, begin, lower=lower, evaluations=evaluations, cancelled=stop)
    if stop():
        raise Cancelled
    parameters, _ = coordinates.to_parameters(found.parameters)
    return replace(found, parameters=parameters, square=square_at(parameters))


def _result(
    model: str,
    base: Base,
    motions: Sequence[Motion],
    shots: Sequence[ShotData],
    found: Minimum,
    seconds: float,
) -> Fit:
    count = len(base.names)
    free = np.ones(found.parameters.size, dtype=np.bool_)
    free[list(found.at_bound)] = False
    samples = found.square.samples
    freedom = max(1, samples - int(free.sum()))
    reduced = found.square.chi2 / freedom
    inverse = covariance(found.square, free)
    converged = found.converged and inverse is not None
    if inverse is None:
        inverse = np.full((found.parameters.size, found.parameters.size), np.nan)
    # A remainder above the noise must not make the parameters look better known than they are (Birge's ratio).
    inverse = inverse * max(1.0, reduced)
    flags = [] if converged else ["fit_not_converged"]
    flags += [f"{base.names[i]}_at_bound" for i in found.at_bound if i < count]
    if not all(shot.noise.trusted for shot in shots):
        flags.append("noise_not_known")
    quantities = {
        name: Quantity(float(found.parameters[i]), float(np.sqrt(inverse[i, i])), "fit")
        for i, name in enumerate(base.names)
    }
    fits = []
    for index, (motion, shot) in enumerate(zip(motions, shots, strict=True)):
        mine = np.r_[0:count, count + 3 * index : count + 3 * index + 3]
        fits.append(_shot_fit(base, motion, shot, found.parameters[mine], inverse[np.ix_(mine, mine)]))
    return Fit(
        model=model,
        parameters=quantities,
        covariance=inverse[:count, :count],
        shots=tuple(fits),
        reduced_chi2=reduced,
        noise_std_m=float(np.sqrt(np.mean([shot.noise.std_m**2 for shot in shots]))),
        converged=converged,
        flags=tuple(flags),
        seconds=seconds,
    )


def _shot_fit(base: Base, motion: Motion, shot: ShotData, parameters: Floats, inverse: Floats) -> ShotFit:
    count = len(base.names)
    response = respond(base, shot, parameters[:count], parameters[count:])
    run, touch = response.trajectory, float(parameters[count + 1])
    events = tuple((e.kind, e.time_s + touch) for e in run.events if e.kind in ("touch", "release"))
    overlay = lay_over(motion, response.displacement_m, run.plate_displacement_m, run.gap_m, events)
    residual = np.where(shot.valid, shot.displacement_m - response.displacement_m, np.nan)
    whitened = shot.noise.whiten(shot.displacement_m - response.displacement_m, shot.valid)
    own = {
        name: Quantity(float(parameters[count + i]), float(np.sqrt(inverse[count + i, count + i])), "fit")
        for i, name in enumerate(OWN_NAMES)
    }
    return ShotFit(
        velocity_in_m_per_s=own["velocity_in_m_per_s"],
        velocity_out_m_per_s=_velocity_out(base, response, inverse[: count + 1, : count + 1]),
        touch_time_s=own["touch_time_s"],
        offset_m=own["offset_m"],
        overlay=overlay,
        residual_m=residual,
        reduced_chi2=float(whitened @ whitened) / max(1, whitened.size - parameters.size),
    )


def _velocity_out(base: Base, response: Response, inverse: Floats) -> Quantity:
    """Return the block's velocity after its last release, with what the fit knows of it."""
    run: Trajectory = response.trajectory
    release = run.released
    if release is None:
        return Quantity(float("nan"), float("nan"), "the record ends in contact")
    slope = release.state_derivatives[[*base.columns, 4], 1]
    return Quantity(float(release.state[1]), float(np.sqrt(slope @ inverse @ slope)), "fit")

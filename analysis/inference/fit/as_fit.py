"""Convert a fitted problem into a ``Fit``: parameters with uncertainties, and each shot's overlay and residual."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision import Effect
from analysis.inference.fit.problem import Fitted
from analysis.inference.model.base import OWN_NAMES
from analysis.inference.model.response import Response
from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.shot import NOT_CONVERGED, Fit, Floats, Motion, Overlay, Quantity, ShotFit
from analysis.signal import derivatives

_ROUNDING = 1e-13
_POINTS = 128  # over the fitted stretch: the frame's motion varies slowly
_WINDOW = 150  # samples
_LOUD_SIGMAS = 8.0  # excess of a loud window's chi^2 over its expectation, in standard deviations
_MOST_LOUD = 0.4  # fraction of loud windows above which the model is wrong throughout, not for a moment


def effect_parameters(fitted: Fitted) -> dict[Effect, dict[str, Quantity]]:
    """Return every effect's parameters; per-shot ones have a suffix ``.2``, ``.3`` from the second shot on."""
    out: dict[Effect, dict[str, Quantity]] = {effect: {} for effect in fitted.effects}
    problem, std = fitted.problem, fitted.std
    values = problem.flat(fitted.point)
    for at, (effect, free, shot) in enumerate(problem.free_parameters, problem.offset):
        name = free.name if shot < 1 else f"{free.name}.{shot + 1}"
        out[effect][name] = Quantity(float(values[at]), float(std[at]), "joint fit")
    for effect, fixed in problem.fixed.items():
        if effect in out:
            out[effect].update({key: Quantity(value, 0.0, "tried") for key, value in fixed.items()})
    return out


def as_fit(
    fitted: Fitted,
    motions: Sequence[Motion],
    model: str,
    seconds: float,
    *,
    how: str = "joint fit",
    by: Floor | None = None,
    chi2: float = 0.0,
    flags: Sequence[str] = (),
) -> Fit:
    """Return the fit, with overlays and residuals on the motions' own time grids.

    ``by`` is a noise known independently of this fit's residual, if any; ``chi2`` is then in its units, and the
    covariance is multiplied by the reduced chi^2 if that exceeds one (Birge's ratio).  Per-shot effect parameters are
    in the shots' own parts.
    """
    problem = fitted.problem
    birge = max(1.0, chi2 / max(1, fitted.samples - problem.size))
    covariances = birge * fitted.covariances
    by_shot: list[dict[str, Quantity]] = [{} for _ in range(len(motions) + 1)]  # the last are those of all shots
    stds = math.sqrt(birge) * fitted.std
    for (name, shot), value, std in zip(problem.names, problem.flat(fitted.point), stds, strict=True):
        by_shot[shot][name] = Quantity(float(value), float(std), how)
    whitened, lines = fitted.whitened(by), problem.derivatives(fitted.z)
    chosen = {f"{effect.key}.{key}": v for effect, given in problem.fixed.items() for key, v in given.items()}
    parameters = by_shot.pop() | {name: Quantity(value, 0.0, "chosen") for name, value in chosen.items()}
    converged = fitted.converged and bool(np.all(np.isfinite(np.einsum("ijj->ij", covariances))))
    shared, factor = len(problem.shared), problem.data.shots[0].factor
    shots = [
        _shot_fit(fitted, index, *of_shot)
        for index, of_shot in enumerate(zip(by_shot, covariances, motions, whitened, lines, strict=True))
    ]
    chi2_by_noise = float(sum(white @ white for white in whitened))
    return Fit(
        model=model,
        parameters=parameters,
        covariance=np.pad(covariances[0, :shared, :shared], (0, len(chosen))),
        shots=tuple(shots),
        reduced_chi2=chi2_by_noise / max(1, fitted.samples - problem.size),
        # of one sample of the motion, whose white part is larger than that of a block's mean
        noise_std_m=replace(fitted.noise, white_m=math.sqrt(factor) * fitted.noise.white_m).std_m,
        wander=fitted.noise.wander,
        converged=converged,
        effects=fitted.effects,
        flags=(*(() if converged else (NOT_CONVERGED,)), *flags),
        seconds=seconds,
        chi2=chi2_by_noise,
        samples=fitted.samples,
        free_parameters=problem.size,
        on_frames=any(_frame_m_per_s(shot, fitted.noise)[0] > 0.0 for shot in problem.data.shots),
    )


def _shot_fit(
    fitted: Fitted,
    index: int,
    own: dict[str, Quantity],
    covariance: Floats,
    motion: Motion,
    whitened: Floats,
    line: tuple[Floats, Floats],
) -> ShotFit:
    """Return one shot's part of the fit.

    ``own`` are its parameters by name; ``covariance``, shape (q, q), is that of all parameters it depends on.
    ``whitened`` is the whitened residual of each fitted sample; ``line`` is the shot's of ``Problem.derivatives``.
    """
    problem, noise = fitted.problem, fitted.noise
    shot = problem.data.shots[index]
    response = problem.run(index, fitted.point)
    released = problem.run(index, fitted.point, coarse=True, derivatives=True).velocity_out
    velocity_in, touch_time, offset = (own.pop(name) for name in OWN_NAMES)
    before, after = _frame_m_per_s(shot, noise)
    velocity_out = Quantity(math.nan, math.nan, "the record ends in contact")
    if released is not None:
        value, slope = released
        variance = float(slope @ covariance @ slope)
        velocity_out = Quantity(value, math.hypot(math.sqrt(max(variance, 0.0)), after), velocity_in.how)
    # the model's speeds are relative to the frame; speeds read from a motion are in space
    velocity_in = replace(velocity_in, std=math.hypot(velocity_in.std, before))
    return ShotFit(
        velocity_in_m_per_s=velocity_in,
        velocity_out_m_per_s=velocity_out,
        touch_time_s=touch_time,
        offset_m=offset,
        overlay=_overlay(motion, response, touch_time.value),
        residual_m=np.where(shot.used, motion.displacement_m - response.displacement_m, np.nan),
        reduced_chi2=float(whitened @ whitened) / max(1, whitened.size - problem.places.shape[1]),
        own_parameters=own,
        rings=_has_transient_excess(whitened),
        sway_std_m=_sway_left_std_m(shot, noise, line[1]) if shot.sway is not None else None,
        plate_number=shot.plate_number,
    )


def _overlay(motion: Motion, response: Response, touch_time_s: float) -> Overlay:
    """Return the overlay of a solved shot.

    Velocity and force are derivatives of the displacement by the motion's own filters, so that model and measurement
    have the same resolution.
    """
    velocity, acceleration = derivatives(response.displacement_m, motion.sample_rate_hz, motion.bandwidth_hz)
    shown = [event for event in response.log.events if event.kind in ("touch", "release")]
    return Overlay(
        time_s=motion.time_s,
        displacement_m=response.displacement_m,
        velocity_m_per_s=velocity,
        force_n=motion.moving_mass_kg * acceleration,
        gap_m=response.gap_m,
        events_s=tuple((event.kind, event.time_s + touch_time_s) for event in shown),
    )


def _frame_m_per_s(shot: Samples, noise: Floor) -> tuple[float, float]:
    """Return the stds of velocities relative to the frame minus those in space, at touch and after release."""
    return (0.0, 0.0) if shot.sway is None else shot.sway.speeds_m_per_s(noise)


def _sway_left_std_m(shot: Samples, noise: Floor, derivatives: Floats) -> Floats:
    """Return the std in m of the frame's motion in a fit's residual, on the motion's own grid, shape (n,).

    ``derivatives`` J are those of the averaged displacement by the fit's parameters.  The residual covariance of
    generalised least squares is C - J (J^T C^-1 J)^-1 J^T for noise covariance C (Rao, "Linear Statistical Inference
    and Its Applications", section 4a).  The fit follows the samples about the contact most closely, so the residual
    frame motion grows towards both ends of the record.  Cost: about 5 ms.
    """
    assert shot.sway is not None
    rows = np.flatnonzero(shot.valid)
    some = np.unique(np.linspace(0, rows.size - 1, _POINTS).astype(np.intp))
    size = np.exp(0.5 * np.asarray(noise.site))[shot.sway.band]
    sines = shot.sway.basis[some] @ (shot.sway.factors * size)
    columns = derivatives[rows[some]]
    columns = columns[:, np.abs(columns).max(axis=0) > 0.0]
    every = (noise.white_m * shot.weight) ** 2 * some.size / rows.size  # a point represents the samples around it
    covariance = sines @ sines.T
    every = max(every, _ROUNDING * float(np.trace(covariance)))
    root = np.linalg.cholesky(covariance + every * np.eye(some.size))
    whitened = np.linalg.solve(root, columns)
    taken = root @ np.linalg.qr(whitened / np.linalg.norm(whitened, axis=0))[0]
    left_m2 = np.sum(sines**2, axis=1) - np.sum(taken**2, axis=1)
    return np.asarray(np.interp(shot.time_s, shot.centre_s[rows[some]], np.sqrt(np.maximum(left_m2, 0.0))))


def _has_transient_excess(whitened: Floats) -> bool:
    """Return whether a whitened residual, shape (n,), exceeds the noise only for a moment, as when a plate rings."""
    count = whitened.size // _WINDOW
    if count < 2:
        return False
    chi2 = (whitened[: count * _WINDOW] ** 2).reshape(count, _WINDOW).sum(axis=1)
    quiet = float(np.median(chi2)) / _WINDOW
    loud = chi2 / max(quiet, 1e-300) - _WINDOW > _LOUD_SIGMAS * math.sqrt(2.0 * _WINDOW)
    return bool(loud.any() and loud.mean() <= _MOST_LOUD)

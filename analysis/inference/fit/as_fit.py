"""Convert a fitted problem into a ``Fit``: parameters with uncertainties, overlays and residuals of each shot."""

from collections.abc import Sequence

import numpy as np

from analysis.collision import Effect, Parameter
from analysis.inference.fit.build_fit import Estimate, Part, Path, build_fit
from analysis.inference.fit.problem import Fitted
from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.shot import Fit, Floats, Motion, Quantity

_ROUNDING = 1e-13
_POINTS = 128  # over the fitted stretch: the frame's motion varies slowly


def effect_parameters(fitted: Fitted) -> dict[Effect, dict[str, Quantity]]:
    """Return every effect's parameters; each shot's own are named with ``.2``, ``.3`` from the second shot on."""
    out: dict[Effect, dict[str, Quantity]] = {effect: {} for effect in fitted.effects}
    problem, point = fitted.problem, fitted.point
    std = fitted.std
    for k, (effect, free, shot) in enumerate(problem.free_parameters):
        value = point.values[max(shot, 0)][effect][free.name]
        out[effect][_parameter_name(free, shot)] = Quantity(value, float(std[problem.offset + k]), "joint fit")
    for effect, fixed in fitted.problem.fixed.items():
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

    ``by`` is the noise to weigh with where it is known otherwise than from the residual of this fit; ``chi2`` is then
    in its units, and the covariance is multiplied by the reduced chi^2 where that exceeds one (Birge's ratio).
    """
    problem, point = fitted.problem, fitted.point
    birge = max(1.0, chi2 / max(1, fitted.samples - problem.size))
    places = {(name, shot): place for place, (name, shot) in enumerate(problem.names)}
    estimate = Estimate(
        model=model,
        effects=fitted.effects,
        values=problem.flat(point),
        covariance=birge * fitted.covariance,
        shared={name: place for (name, shot), place in places.items() if shot < 0},
        free=problem.size,
        converged=fitted.converged,
        how=how,
        flags=tuple(flags),
        chosen={f"{effect.key}.{key}": v for effect, given in problem.fixed.items() for key, v in given.items()},
    )
    parts = [
        Part(
            motion=motion,
            own={name: place for (name, of), place in places.items() if of == index},
            path=_path(fitted, index),
            used=shot.used,
            whitened=white,
            plate_number=shot.plate_number,
            frame_m_per_s=shot.sway.speeds_m_per_s(fitted.noise) if shot.sway is not None else (0.0, 0.0),
            sway_std_m=sway_left_std_m(shot, fitted.noise, line[1]) if shot.sway is not None else None,
        )
        for index, (motion, shot, white, line) in enumerate(
            zip(motions, problem.data.shots, fitted.whitened(by), problem.derivatives(fitted.z), strict=True)
        )
    ]
    return build_fit(estimate, parts, _sample_noise_m(fitted), fitted.noise.wander, seconds)


def _path(fitted: Fitted, index: int) -> Path:
    point = fitted.point
    response = fitted.problem.run(index, point, derivatives=True)
    return Path.of(response, float(point.own[index][1]))


def _parameter_name(free: Parameter, shot: int) -> str:
    return free.name if shot < 1 else f"{free.name}.{shot + 1}"


def _sample_noise_m(fitted: Fitted) -> float:
    """Return the noise std of one sample of the motion in m: the white part there is larger than in a block's mean."""
    floor, factor = fitted.noise, fitted.problem.data.shots[0].factor
    return float(np.sqrt(factor * floor.white_m**2 + floor.rms_m[0] ** 2 + floor.rms_m[1] ** 2))


def sway_left_std_m(shot: Samples, noise: Floor, derivatives: Floats) -> Floats:
    """Return the std in m of the frame's motion in a fit's residual, on the motion's own grid, shape (n,).

    ``derivatives`` are those of the averaged displacement by the fit's parameters.  Generalised least squares leaves
    C - J (J^T C^-1 J)^-1 J^T of the noise covariance C, with J the derivatives by the parameters (Rao, "Linear
    Statistical Inference and Its Applications", section 4a).  The fit follows the samples about the contact most
    closely, so the remaining part grows towards both ends of the record.  Cost about 5 ms.
    """
    assert shot.sway is not None
    rows = np.flatnonzero(shot.valid)
    some = np.unique(np.linspace(0, rows.size - 1, _POINTS).astype(np.intp))
    size = np.exp(0.5 * np.asarray(noise.site))[shot.sway.band]
    sines = shot.sway.basis[some] @ (shot.sway.factors * size)
    columns = derivatives[rows[some]]
    columns = columns[:, np.abs(columns).max(axis=0) > 0.0]
    every = (noise.white_m * shot.weight) ** 2 * some.size / rows.size  # a point stands for the samples around it
    covariance = sines @ sines.T
    every = max(every, _ROUNDING * float(np.trace(covariance)))
    root = np.linalg.cholesky(covariance + every * np.eye(some.size))
    whitened = np.linalg.solve(root, columns)
    taken = root @ np.linalg.qr(whitened / np.linalg.norm(whitened, axis=0))[0]
    left_m2 = np.sum(sines**2, axis=1) - np.sum(taken**2, axis=1)
    return np.asarray(np.interp(shot.time_s, shot.centre_s[rows[some]], np.sqrt(np.maximum(left_m2, 0.0))))

"""A fit in the form that everything else reads."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects.row import Effect, Parameter
from analysis.inference.fit.build_fit import Estimate, Part, Path, build_fit
from analysis.inference.fit.derivatives import solved
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.frame_residual import sway_left_std_m
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity

Floats = NDArray[np.float64]


def effect_parameters(fitted: Fitted) -> dict[Effect, dict[str, Quantity]]:
    """Return every effect's parameters; what is each shot's own is that of the first, ``.2``, ``.3`` of the others."""
    out: dict[Effect, dict[str, Quantity]] = {effect: {} for effect in fitted.effects}
    hypothesis, point = fitted.hypothesis, fitted.point
    std = fitted.std
    for k, (effect, free, shot) in enumerate(hypothesis.free_parameters):
        value = point.values[max(shot, 0)][effect][free.name]
        out[effect][_called(free, shot)] = Quantity(value, float(std[hypothesis.offset + k]), "joint fit")
    for effect, fixed in fitted.hypothesis.fixed.items():
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
    """Return the fit with overlays and remainders on the motions' own grids.

    Where the noise is known ``by`` other ways than by what the fit leaves, ``chi2`` is in its units, and a remainder
    above it does not make parameters look better known than they are (Birge's ratio).
    """
    hypothesis, point = fitted.hypothesis, fitted.point
    birge = max(1.0, chi2 / max(1, fitted.samples - hypothesis.size))
    places = {(name, shot): place for place, (name, shot) in enumerate(hypothesis.names)}
    estimate = Estimate(
        model=model,
        effects=fitted.effects,
        values=hypothesis.flat(point),
        covariance=birge * fitted.covariance,
        shared={name: place for (name, shot), place in places.items() if shot < 0},
        free=hypothesis.size,
        converged=fitted.converged,
        how=how,
        flags=tuple(flags),
        chosen={f"{effect.key}.{key}": v for effect, given in hypothesis.fixed.items() for key, v in given.items()},
    )
    parts = [
        Part(
            motion=motion,
            own={name: place for (name, of), place in places.items() if of == index},
            path=_path(fitted, index),
            used=shot.used,
            whitened=white,
            plate_number=shot.plate_number,
            frame_m_per_s=shot.sway.speeds_m_per_s(fitted.floor) if shot.sway is not None else (0.0, 0.0),
            sway_std_m=sway_left_std_m(shot, fitted.floor, line[1]) if shot.sway is not None else None,
        )
        for index, (motion, shot, white, line) in enumerate(
            zip(motions, hypothesis.data.shots, fitted.whitened(by), hypothesis.linearised(fitted.z), strict=True)
        )
    ]
    return build_fit(estimate, parts, _of_one_sample(fitted), seconds)


def _path(fitted: Fitted, index: int) -> Path:
    point = fitted.point
    _, response = solved(fitted.hypothesis, index, point, derivatives=True, averaged=False)
    return Path.of(response, float(point.own[index][1]))


def _called(free: Parameter, shot: int) -> str:
    return free.name if shot < 1 else f"{free.name}.{shot + 1}"


def _of_one_sample(fitted: Fitted) -> float:
    """Return the noise of one sample of the motion, which is averaged away less than the floor that was learnt."""
    floor, factor = fitted.floor, fitted.hypothesis.data.shots[0].factor
    return float(np.sqrt(factor * floor.white_m**2 + floor.rms_m[0] ** 2 + floor.rms_m[1] ** 2))

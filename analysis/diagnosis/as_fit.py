"""A diagnosis' own fit in the form that everything else reads."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.derivatives import has_tangents, released
from analysis.diagnosis.free_parameters import FreeParameter
from analysis.diagnosis.hypothesis_fit import Fitted
from analysis.diagnosis.quick_shot import Run
from analysis.fit import Fit, ShotFit
from analysis.model.overlay import lay_over
from analysis.motion import Motion
from analysis.quantity import Quantity

Floats = NDArray[np.float64]


def effect_parameters(fitted: Fitted) -> dict[str, dict[str, Quantity]]:
    """Return every effect's parameters; what is each shot's own is that of the first, ``.2``, ``.3`` of the others."""
    out: dict[str, dict[str, Quantity]] = {name: {} for name in fitted.names}
    hypothesis, point = fitted.hypothesis, fitted.point
    std = fitted.std
    for k, (name, free, shot) in enumerate(hypothesis.free_parameters):
        value = point.values[max(shot, 0)][name][free.name]
        out[name][_called(free, shot)] = Quantity(value, float(std[hypothesis.offset + k]), "joint fit")
    for name, fixed in fitted.hypothesis.fixed.items():
        if name in out:
            out[name].update({key: Quantity(value, 0.0, "tried") for key, value in fixed.items()})
    return out


def as_fit(fitted: Fitted, motions: Sequence[Motion], model: str, seconds: float) -> Fit:
    """Return the fit with overlays and remainders on the motions' own grids."""
    hypothesis, point = fitted.hypothesis, fitted.point
    data = hypothesis.data
    count = data.count
    std = fitted.std
    parameters = {
        name: Quantity(float(point.base[i]), float(std[i]), "joint fit") for i, name in enumerate(data.base.names)
    }
    places = list(range(count))
    effects = effect_parameters(fitted)
    for k, (name, free, of) in enumerate(hypothesis.free_parameters):
        parameter = _called(free, of)
        parameters[f"{name}.{parameter}"] = effects[name][parameter]
        places.append(hypothesis.offset + k)
    shots = []
    freedom = sum(int(s.valid.sum()) for s in data.shots) - hypothesis.size
    chi2 = 0.0
    for index, (motion, shot, white) in enumerate(zip(motions, data.shots, fitted.whitened(), strict=True)):
        run = hypothesis.run(index, point)
        kinds = ("touch", "release")
        events = tuple((kinds[k % 2], t) for k, t in enumerate(run.changes_s))
        chi2 += float(white @ white)
        own = slice(count + 3 * index, count + 3 * index + 3)
        values, spread = point.own[index], std[own]
        shots.append(
            ShotFit(
                velocity_in_m_per_s=Quantity(float(values[0]), float(spread[0]), "joint fit"),
                velocity_out_m_per_s=_velocity_out(fitted, index, run),
                touch_time_s=Quantity(float(values[1]), float(spread[1]), "joint fit"),
                offset_m=Quantity(float(values[2]), float(spread[2]), "joint fit"),
                overlay=lay_over(motion, run.displacement_m, run.plate_m, run.gap_m, events),
                residual_m=np.where(shot.used, motion.displacement_m - run.displacement_m, np.nan),
                reduced_chi2=float(white @ white) / max(1, white.size - hypothesis.size),
            )
        )
    return Fit(
        model=model,
        parameters=parameters,
        covariance=fitted.covariance[np.ix_(places, places)],
        shots=tuple(shots),
        reduced_chi2=chi2 / max(1, freedom),
        noise_std_m=_of_one_sample(fitted),
        converged=fitted.converged and bool(np.all(np.isfinite(std))),
        effects=fitted.names,
        flags=() if fitted.converged else ("fit_not_converged",),
        seconds=seconds,
    )


def _velocity_out(fitted: Fitted, index: int, run: Run) -> Quantity:
    """Return the block's velocity after its last release, as uncertain as all parameters together leave it."""
    hypothesis, z = fitted.hypothesis, fitted.z
    if has_tangents(hypothesis):
        out = released(hypothesis, index, z)
        if out is None:
            return Quantity(math.nan, math.nan, "the record ends in contact")
        value, slope = out
    else:
        value, slope = _at_release(hypothesis.data.shots[index].time_s, run), np.zeros(z.size)
        for column in range(z.size):
            if hypothesis.touches(column, index):
                step = 0.3 * math.sqrt(fitted.inverse[column, column]) * np.eye(z.size)[column]
                ahead, behind = (hypothesis.run(index, hypothesis.unpack(z + s * step)) for s in (1, -1))
                times_s = hypothesis.data.shots[index].time_s
                change = _at_release(times_s, ahead) - _at_release(times_s, behind)
                slope[column] = change / (2 * step[column])
    return Quantity(value, math.sqrt(max(float(slope @ fitted.inverse @ slope), 0.0)), "joint fit")


def _at_release(times_s: Floats, run: Run) -> float:
    """Return the velocity of the last release, led back from the two samples after it: there the force is steady."""
    after = int(np.searchsorted(times_s, run.changes_s[-1]))
    if len(run.changes_s) % 2 or after + 2 > times_s.size:
        return math.nan
    (one, two), v = times_s[after : after + 2], run.velocity_m_per_s[after : after + 2]
    return float(v[0] + (run.changes_s[-1] - one) * (v[1] - v[0]) / (two - one))


def _called(free: FreeParameter, shot: int) -> str:
    return free.name if shot < 1 else f"{free.name}.{shot + 1}"


def _of_one_sample(fitted: Fitted) -> float:
    """Return the noise of one sample of the motion, which is averaged away less than the floor that was learnt."""
    floor, factor = fitted.floor, fitted.hypothesis.data.shots[0].factor
    return float(np.sqrt(factor * floor.white_m**2 + floor.rms_m[0] ** 2 + floor.rms_m[1] ** 2))

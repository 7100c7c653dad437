"""A diagnosis' own fit in the form that everything else reads."""

from collections.abc import Sequence

import numpy as np

from analysis.diagnosis.compare import Fitted
from analysis.diagnosis.knobs import Knob
from analysis.fit import Fit, ShotFit
from analysis.model.overlay import lay_over
from analysis.motion import Motion
from analysis.quantity import Quantity


def effect_parameters(fitted: Fitted) -> dict[str, dict[str, Quantity]]:
    """Return every effect's parameters; what is each shot's own is that of the first, ``.2``, ``.3`` of the others."""
    out: dict[str, dict[str, Quantity]] = {name: {} for name in fitted.names}
    hypothesis, point = fitted.hypothesis, fitted.point
    std = fitted.std
    for k, (name, knob, shot) in enumerate(hypothesis.knobs):
        value = point.values[max(shot, 0)][name][knob.name]
        out[name][_called(knob, shot)] = Quantity(value, float(std[hypothesis.offset + k]), "joint fit")
    for name, fixed in fitted.hypothesis.fixed.items():
        if name in out:
            out[name].update({key: Quantity(value, 0.0, "tried") for key, value in fixed.items()})
    return out


def as_fit(fitted: Fitted, motions: Sequence[Motion], model: str, seconds: float) -> Fit:
    """Return the fit with overlays and remainders on the motions' own grids."""
    hypothesis, point = fitted.hypothesis, fitted.point
    rig = hypothesis.rig
    count = rig.count
    std = fitted.std
    parameters = {
        name: Quantity(float(point.base[i]), float(std[i]), "joint fit") for i, name in enumerate(rig.base.names)
    }
    places = list(range(count))
    effects = effect_parameters(fitted)
    for k, (name, knob, of) in enumerate(hypothesis.knobs):
        parameter = _called(knob, of)
        parameters[f"{name}.{parameter}"] = effects[name][parameter]
        places.append(hypothesis.offset + k)
    shots = []
    freedom = sum(int(s.valid.sum()) for s in rig.shots) - hypothesis.size
    chi2 = 0.0
    for index, (motion, shot, white) in enumerate(zip(motions, rig.shots, fitted.whitened(), strict=True)):
        run = hypothesis.run(index, point)
        kinds = ("touch", "release")
        events = tuple((kinds[k % 2], t) for k, t in enumerate(run.changes_s))
        chi2 += float(white @ white)
        own = slice(count + 3 * index, count + 3 * index + 3)
        values, spread = point.own[index], std[own]
        shots.append(
            ShotFit(
                velocity_in_m_per_s=Quantity(float(values[0]), float(spread[0]), "joint fit"),
                velocity_out_m_per_s=Quantity(float(run.velocity_m_per_s[-1]), float(spread[0]), "end of the record"),
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


def _called(knob: Knob, shot: int) -> str:
    return knob.name if shot < 1 else f"{knob.name}.{shot + 1}"


def _of_one_sample(fitted: Fitted) -> float:
    """Return the noise of one sample of the motion, which is averaged away less than the floor that was learnt."""
    floor, factor = fitted.floor, fitted.hypothesis.rig.shots[0].factor
    return float(np.sqrt(factor * floor.white_m**2 + floor.rms_m[0] ** 2 + floor.rms_m[1] ** 2))

"""A diagnosis' own fit in the form that everything else reads."""

from collections.abc import Sequence

import numpy as np

from analysis.diagnosis.compare import Fitted
from analysis.diagnosis.hypothesis import parameters_of
from analysis.fit import Fit, ShotFit
from analysis.model.overlay import lay_over
from analysis.motion import Motion
from analysis.quantity import Quantity


def effect_parameters(fitted: Fitted) -> dict[str, dict[str, Quantity]]:
    """Return every effect's parameters; what is each shot's own is that of the first, ``.2``, ``.3`` of the others."""
    out: dict[str, dict[str, Quantity]] = {name: {} for name in fitted.names}
    for name, parameter, shot, value, std in parameters_of(fitted.hypothesis, fitted.z, fitted.inverse):
        out[name][parameter if shot < 1 else f"{parameter}.{shot + 1}"] = Quantity(value, std, "joint fit")
    for name, fixed in fitted.hypothesis.fixed.items():
        if name in out:
            out[name].update({key: Quantity(value, 0.0, "tried") for key, value in fixed.items()})
    return out


def as_fit(fitted: Fitted, motions: Sequence[Motion], model: str, seconds: float) -> Fit:
    """Return the fit with overlays and remainders on the motions' own grids."""
    hypothesis, point = fitted.hypothesis, fitted.point
    rig = hypothesis.rig
    count = rig.count
    _, slope = hypothesis.coordinates.to_parameters(fitted.z[: hypothesis.offset])
    whole = np.eye(hypothesis.size)
    whole[: hypothesis.offset, : hypothesis.offset] = slope
    for k, (_, knob, _) in enumerate(hypothesis.knobs):
        at = hypothesis.offset + k
        whole[at, at] = knob.slope(float(fitted.z[at]))
    inverse = whole @ fitted.inverse @ whole.T
    std = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    parameters = {
        name: Quantity(float(point.base[i]), float(std[i]), "joint fit") for i, name in enumerate(rig.base.names)
    }
    places = list(range(count))
    for k, (name, knob, of) in enumerate(hypothesis.knobs):
        at = hypothesis.offset + k
        key = f"{name}.{knob.name}" if of < 1 else f"{name}.{knob.name}.{of + 1}"
        parameters[key] = Quantity(knob.to_value(float(fitted.z[at])), float(std[at]), "joint fit")
        places.append(at)
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
        covariance=inverse[np.ix_(places, places)],
        shots=tuple(shots),
        reduced_chi2=chi2 / max(1, freedom),
        noise_std_m=fitted.floor.std_m,
        converged=fitted.converged and bool(np.all(np.isfinite(std))),
        effects=fitted.names,
        flags=() if fitted.converged else ("fit_not_converged",),
        seconds=seconds,
    )

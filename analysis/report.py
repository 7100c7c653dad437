"""Build the result file, schema levimass.result/1 of docs/formats.md, from shots and diagnosis."""

import math
from collections.abc import Sequence
from typing import Any

from analysis.diagnosis import Diagnosis, PredictionTest, diagnosis_result, prediction_test_result
from analysis.fitted import readings_model, readings_model_result
from analysis.shot import Disturbance, Fit, Shot, program_version, to_json
from analysis.uncertainty import Origin, budget, budget_result, collision_numbers, series, series_result

SCHEMA = "levimass.result/1"


def result(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, foretold: PredictionTest | None = None
) -> dict[str, Any]:
    """Return the whole result, ready for JSON (no NaN, no infinity)."""
    return {
        "schema": SCHEMA,
        "version": program_version(),
        "shots": [shot_result(shot, [other for other in shots if other is not shot]) for shot in shots],
        "series": _finite(series_result(series(shots))) if len(shots) > 1 else None,
        "diagnosis": None if diagnosis is None else _finite(diagnosis_result(diagnosis)),
        "foretold": None if foretold is None else _finite(prediction_test_result(foretold)),
    }


def shot_result(shot: Shot, others: Sequence[Shot] = ()) -> dict[str, Any]:
    """Return one shot's entry; unobserved numbers are null.  ``others`` of the same rig give the repeatability."""
    impact = shot.impact
    entry: dict[str, Any] = {
        "name": shot.name,
        "path": shot.path,
        "status": "failed" if shot.problem else "ok",
        "problem": shot.problem,
        "fit_problem": shot.fit_problem,
        "flags": list(shot.flags),
        "sample_rate_hz": shot.sample_rate_hz,
        "samples": shot.samples,
        "trigger_time_s": shot.trigger_time_s,
        "rest_frequency_hz": to_json(shot.motion.rest_frequency_hz) if shot.motion else None,
    }
    for number in collision_numbers(Origin.READ):
        group, _, name = number.key.rpartition(".")
        (entry.setdefault(group, {}) if group else entry)[name] = to_json(number.find(shot))
    entry["readings_model"] = readings_model_result(readings_model(shot))
    entry["disturbance"] = disturbance_result(impact.disturbance if impact else None)
    entry["fit"] = fit_result(shot.fit)
    entry["budget"] = budget_result(budget(shot, others=others)) if impact else None
    entry["seconds"] = {key: shot.seconds.get(key, 0.0) for key in ("load", "demodulate", "impact", "fit")}
    finite: dict[str, Any] = _finite(entry)
    return finite


def disturbance_result(disturbance: Disturbance | None) -> dict[str, Any] | None:
    """Return the disturbance of the optical path, with its share of each number's variance."""
    if disturbance is None:
        return None
    return {
        "lines": [
            {
                "frequency_hz": to_json(line.frequency_hz),
                "amplitude_m": to_json(line.amplitude_m),
                "phase_rad": line.phase_rad,
            }
            for line in disturbance.lines
        ],
        "floor_rms_m": disturbance.floor_rms_m,
        "floor_rms_m_per_s": disturbance.floor_rms_m_per_s,
        "knocks_s": [list(knock) for knock in disturbance.knocks_s],
        "variance_shares": dict(disturbance.shares),
    }


def fit_result(fit: Fit | None) -> dict[str, Any] | None:
    """Return the fit's entry; the parameters of a fit that did not converge are null."""
    if fit is None:
        return None
    called = fit.short_names
    parameters = {
        called[name]: to_json(quantity) if fit.converged else None for name, quantity in fit.parameters.items()
    }
    return {
        "model": fit.model,
        "parameters": parameters,
        "reduced_chi2": fit.reduced_chi2,
        "converged": fit.converged,
        "effects": [effect.key for effect in fit.effects],
    }


def _finite(value: Any) -> Any:
    """Replace non-finite numbers by null, at every depth."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value

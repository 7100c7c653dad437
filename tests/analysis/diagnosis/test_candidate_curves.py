"""The small curves of what each candidate would explain: near to its own fit, small, and not in the result file."""

import json

import numpy as np
import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Candidate
from analysis.diagnosis.findings.result_file import diagnosis_result
from analysis.diagnosis.verdict import alternatives
from analysis.diagnosis.verdict.alternatives import POINTS, averaged_to, curve_of_fit, curve_to_first_order
from analysis.inference.fit.added_effect import refit
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


@pytest.mark.parametrize(
    ("name", "effects", "off"),
    [
        ("viscous_drag", {"viscous_drag": {"coefficient_n_s_per_m": 2e-5}}, 0.02),
        ("cyclic_error", {"cyclic_error": {"amplitude_m": 2e-9, "order": 2.0}}, 0.02),  # of each shot's own phase
        (
            "block_mode",
            {"block_mode": {"mass_kg": 2e-5, "frequency_hz": 870.0, "damping_ratio": 0.01}},
            0.25,
        ),  # of a grid
    ],
)
def test_the_first_order_is_near_to_what_the_fit_with_the_effect_gives(name: str, effects: dict, off: float) -> None:
    before = base_fit(shots(effects))
    at = before.linearise()
    best = at.scores(KINDS[name])[0]
    fitted = refit(at, KINDS[name], best.start, calm)
    assert fitted is not None
    exact, quick = curve_of_fit(fitted, before), curve_to_first_order(at, best)
    assert quick is not None and [curve.shape for curve in quick] == [curve.shape for curve in exact]
    left, near = np.concatenate(exact), np.concatenate(quick)
    assert np.sqrt(np.mean(left**2)) > 3e-11  # above what the means over so many samples have as noise
    assert np.sqrt(np.mean((near - left) ** 2)) < off * np.sqrt(np.mean(left**2))


def test_no_fitted_parameter_could_explain_more_beside_the_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alternatives, "POINTS", 10**6)  # every sample, so that whitening does not see steps
    before = base_fit(shots({"viscous_drag": {"coefficient_n_s_per_m": 2e-5}}))
    at = before.linearise()
    curve = curve_to_first_order(at, at.scores(KINDS["bearing_gradient"])[0])
    assert curve is not None
    remains = [left - explained for left, explained in zip(before.residual_m, curve, strict=True)]
    white = at.problem.whitened([column[:, None] for column in remains])[:, 0]
    beside = at.basis.projected(white)
    assert np.linalg.norm(white - beside) < 1e-3 * np.linalg.norm(white)


def test_every_candidate_of_a_diagnosis_has_its_curve_and_the_result_file_has_none() -> None:
    motions = shots({"coulomb_friction": {"force_n": 1e-4}})
    found = diagnose(motions, seconds=20.0)
    assert found.candidates
    for candidate in found.candidates:
        assert candidate.explains_m is not None and len(candidate.explains_m) == len(motions)
        assert all(c.dtype == np.float32 and c.size <= POINTS and np.isfinite(c).all() for c in candidate.explains_m)
    best = next(candidate for candidate in found.candidates if candidate.name == "coulomb_friction")
    left = averaged_to(POINTS, np.nan_to_num(found.fit_before.shots[0].residual_m))
    assert best.explains_m is not None
    assert np.corrcoef(left, best.explains_m[0])[0, 1] > 0.9  # it explains what is left
    written = json.dumps(diagnosis_result(found)["candidates"])
    assert "explains" not in written
    assert set(diagnosis_result(found)["candidates"][0]) == {"name", "score", "delta_bic", "parameters", "remark"}


def test_candidates_with_curves_are_compared_without_them() -> None:
    curve = (np.ones(3, np.float32),)
    assert Candidate("tilt", 1.0, None, explains_m=curve) == Candidate("tilt", 1.0, None)


def test_a_record_is_averaged_to_equal_parts() -> None:
    assert np.array_equal(averaged_to(4, np.arange(3.0)), [0.0, 1.0, 2.0])
    assert averaged_to(4, np.arange(10.0)) == pytest.approx([0.5, 3.0, 5.5, 8.0])

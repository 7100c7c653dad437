"""A written law with a value that each shot has for itself: a frame shakes the plate, at any phase a shot."""

import math

import pytest

from analysis.diagnosis.diagnose import diagnose
from analysis.diagnosis.result import Verdict
from analysis.laws.own import from_mapping
from analysis.model.fitting import fit_shots
from analysis.motion import Motion
from tests.law_rigs import LawRig, Memory

SIZE_N, LINE_HZ = 2e-3, 90.0
SHAKEN = from_mapping(
    {
        "name": "shaken",
        "where": "plate",
        "formula": "a*sin(2*pi*f*t + phase_rad)",
        "parameters": {
            "a": {"unit": "N", "start": 1e-3, "lower": 0.0},
            "f": {"unit": "Hz", "start": 88.0, "lower": 20.0, "upper": 400.0},
            "phase_rad": {"unit": "rad", "start": 0.1, "own": True},
        },
    }
)


def shot(speed_m_per_s: float, phase: float, index: int) -> Motion:
    def force(_x: float, _v: float, _y: float, _u: float, t: float) -> float:
        return SIZE_N * math.sin(2 * math.pi * LINE_HZ * t + phase)

    return LawRig(memory=Memory(lambda *_: 1.0, on_plate=force)).shot(speed_m_per_s, index)


@pytest.fixture(scope="module")
def shots() -> list[Motion]:
    return [shot(0.17, 2.5, 0), shot(0.33, -1.9, 1)]  # far from where the law's start has the phase


def test_a_diagnosis_finds_each_shots_phase(shots: list[Motion]) -> None:
    told = diagnose(shots, laws=(SHAKEN.key,))
    assert told.verdict is Verdict.EFFECT_FOUND
    (found,) = told.effects
    assert found.name == SHAKEN.key
    for name, truth in (("a", SIZE_N), ("f", LINE_HZ), ("phase_rad", 2.5), ("phase_rad.2", -1.9)):
        known = found.parameters[name]
        assert abs(known.value - truth) < 4 * known.std, name
    assert told.error_after.reduced_chi2 == pytest.approx(1.0, abs=0.1)


def test_a_fit_finds_them_too(shots: list[Motion]) -> None:
    fit = fit_shots(shots, effects=[SHAKEN.key])
    assert fit.converged
    assert fit.parameters[f"{SHAKEN.key}.a"].value == pytest.approx(SIZE_N, rel=1e-4)
    assert fit.parameters[f"{SHAKEN.key}.f"].value == pytest.approx(LINE_HZ, rel=1e-4)

"""A written law with a value that each shot has for itself: a frame shakes the plate, at any phase a shot."""

import math
from dataclasses import replace

import numpy as np
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


@pytest.mark.slow
def test_a_frame_that_shakes_plate_and_optics_is_told_whole() -> None:
    """The block flies free in the room; the optics go with the frame, and the plate's clamp with 0.8 of it."""
    frame_m_per_s, share, omega = 5e-5, 0.8, 2 * math.pi * LINE_HZ
    force_n = LawRig().bodies.k_p * share * frame_m_per_s / omega
    seen = []
    for index, (speed, phase) in enumerate(((0.15, 0.4), (0.24, 2.5), (0.36, -1.9))):

        def force(_x: float, _v: float, _y: float, _u: float, t: float, phase: float = phase) -> float:
            return force_n * (math.cos(omega * t + phase) - math.cos(phase))

        motion = LawRig(memory=Memory(lambda *_: 1.0, on_plate=force)).shot(speed, index)
        swing = frame_m_per_s / omega * np.cos(omega * (motion.time_s - 0.02) + phase)
        seen.append(replace(motion, displacement_m=motion.displacement_m - swing))
    told = diagnose(seen, laws=(SHAKEN.key,))
    assert told.verdict is Verdict.EFFECT_FOUND
    found = {effect.name: effect.parameters for effect in told.effects}
    line, shaken = found["frame_vibration"], found[SHAKEN.key]
    assert abs(line["amplitude_m_per_s"].value - frame_m_per_s) < 4 * line["amplitude_m_per_s"].std
    assert abs(shaken["a"].value - force_n) < 4 * shaken["a"].std
    assert told.error_after.reduced_chi2 == pytest.approx(1.0, abs=0.1)

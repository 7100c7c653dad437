"""A line that shakes the plate, at any phase a shot: as a written law, and as a frame that carries the optics too."""

import math

import pytest

from analysis.collision.effects import effect_named
from analysis.collision.laws.user_law import law_from_table
from analysis.diagnosis.catalogue_search import accept
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.diagnosis.findings.result import Verdict
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.model.free_parameters import trial_effects
from analysis.shot.motion import Motion
from tests.analysis.diagnosis.shots import base_fit
from tests.analysis.diagnosis.shots import shots as shots_of
from tests.law_rigs import LawRig, Memory

SIZE_N, LINE_HZ = 2e-3, 90.0
SHAKEN = law_from_table(
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
    told = diagnose(shots, laws=(SHAKEN,))
    assert told.verdict is Verdict.EFFECT_FOUND
    (found,) = told.effects
    assert found.effect == SHAKEN
    for name, truth in (("a", SIZE_N), ("f", LINE_HZ), ("phase_rad", 2.5), ("phase_rad.2", -1.9)):
        known = found.parameters[name]
        assert abs(known.value - truth) < 4 * known.std, name
    assert told.error_after.reduced_chi2 == pytest.approx(1.0, abs=0.1)


def test_a_fit_finds_them_too(shots: list[Motion]) -> None:
    fit = fit_shots(shots, effects=[SHAKEN])
    assert fit.converged
    assert fit.parameters[f"{SHAKEN.key}.a"].value == pytest.approx(SIZE_N, rel=1e-4)
    assert fit.parameters[f"{SHAKEN.key}.f"].value == pytest.approx(LINE_HZ, rel=1e-4)


WIDE = "frame_vibration_with_plate"
FRAME = {"amplitude_m_per_s": 5e-5, "frequency_hz": LINE_HZ, "phase_rad": 0.4}


@pytest.fixture(scope="module")
def on_a_frame() -> tuple[Motion, ...]:
    """The block flies free in the room; the optics go with the frame, and the plate's clamp with 0.8 of it."""
    return shots_of({WIDE: {**FRAME, "plate_factor": 0.8}}, seed=31)


def test_a_frame_that_shakes_plate_and_optics_is_told_whole(on_a_frame: tuple[Motion, ...]) -> None:
    told = diagnose(on_a_frame)
    assert told.verdict is Verdict.EFFECT_FOUND
    (found,) = told.effects
    assert found.name == WIDE and found.indistinguishable_from == ()
    for name, truth in (("amplitude_m_per_s", 5e-5), ("frequency_hz", LINE_HZ), ("plate_factor", 0.8)):
        known = found.parameters[name]
        assert abs(known.value - truth) < 4 * known.std, name
    assert found.parameters["plate_factor"].std < 1e-3
    assert told.error_before.displacement_rms_m > 5e-8 and told.error_after.displacement_rms_m < 1.05e-10
    assert told.error_held_out_after.displacement_rms_m < 1.1e-10


def test_in_the_model_it_is_all_there_is(on_a_frame: tuple[Motion, ...]) -> None:
    told = diagnose(on_a_frame, accepted=(WIDE,))
    assert told.verdict is Verdict.ADEQUATE
    read = from_text(to_text(saved(told.fit_after, ("a", "b", "c"), told)))
    assert read.effects == (effect_named(WIDE),) and read.parameters[f"{WIDE}.plate_factor"].value == pytest.approx(
        0.8, abs=2e-3
    )


def test_the_narrow_one_in_the_model_stays_what_it_is(on_a_frame: tuple[Motion, ...]) -> None:
    start = accept(base_fit(on_a_frame), trial_effects(), (effect_named("frame_vibration"),), lambda: False)
    assert start.effects == (effect_named("frame_vibration"),)


def test_a_plate_that_stays_is_none_of_it() -> None:
    told = diagnose(shots_of({WIDE: {**FRAME, "plate_factor": 0.0}}, seed=32, count=2))
    (found,) = told.effects
    assert found.name == "frame_vibration" and found.indistinguishable_from == ()
    assert told.verdict is Verdict.EFFECT_FOUND and found.evidence["lead_over_runner_up"] > 100.0

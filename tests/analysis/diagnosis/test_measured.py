"""Measured collisions on an air track: a damping that grows with the overlap, not a cubic spring."""

from pathlib import Path

import pytest

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from analysis.signal.record import motion_from_displacement
from instrument.files.motion_file import read_motion


@pytest.mark.slow
def test_the_air_track_lacks_a_damping_that_grows(measured: Path) -> None:
    motions = []
    for run in range(1, 6):
        record = read_motion(measured / f"airtrack-{run}.csv")
        motions.append(
            motion_from_displacement(
                record.time_s, record.displacement_m, None, None, record.moving_mass_kg, record.moving_mass_u_kg or 0.0
            )
        )
    found = diagnose(motions, model="contact")
    assert found.verdict is not Verdict.ADEQUATE
    by_name = {candidate.name: candidate.delta_bic for candidate in found.candidates}
    damping, cubic = by_name["nonlinear_contact_damping"], by_name["cubic_stiffness"]
    assert damping is not None
    assert cubic is not None
    assert damping < min(cubic - 6, -10)
    named = {effect.name: effect for effect in found.effects}
    assert CATALOGUE["cubic_stiffness"] not in named["nonlinear_contact_damping"].indistinguishable_from
    assert found.error_held_out_before is not None
    assert found.error_held_out_after is not None
    assert found.error_held_out_after.displacement_rms_m < 0.75 * found.error_held_out_before.displacement_rms_m

"""Clean sets of the bench as recorded and demodulated are adequate, although a faint line is read where none is."""

from pathlib import Path

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from analysis.pipeline import analyse
from instrument.bench.simulated_shots import simulate
from instrument.bench.site import site_named
from instrument.files.recording_file import open_recording


@pytest.mark.slow
@pytest.mark.parametrize(("site", "seed"), [("VC-D", 521), ("VC-D", 634), ("VC-A", 422)])
def test_clean_recordings_in_a_building_are_adequate(site: str, seed: int, tmp_path: Path) -> None:
    """Their flights show a line between 670 and 800 Hz, beside which the wander of the path was once not seen."""
    paths = simulate(tmp_path, 3, seed, site=site_named(site))
    diagnosis = diagnose([analyse(open_recording(path)) for path in paths])
    assert diagnosis.verdict is Verdict.ADEQUATE, diagnosis.sentence

"""What a joint diagnosis costs grows with the number of its shots, not with its square."""

import tracemalloc

import numpy as np

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from analysis.shot.shot import AnalysisSettings, Shot
from tests.building_rig import Path, Rig

_RIG = Rig(site="", path=Path(wander_m=0.0), length_s=0.06, approach_s=0.012)
_WORKED_ON_BYTES, _A_SHOT_BYTES = 40e6, 4e6  # the paths of two shots that are being scored; what is kept of each


def test_a_shot_more_takes_four_megabytes_at_most() -> None:
    motions = _RIG.shots(5, tuple(np.linspace(0.15, 0.35, 9)))
    shots = [Shot("", None, AnalysisSettings(), None, None, None, None, motion, None, None) for motion in motions]
    tracemalloc.start()
    try:
        found = diagnose(shots)  # whose readings, had they any, would be made before
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.verdict is Verdict.ADEQUATE
    assert peak < _WORKED_ON_BYTES + _A_SHOT_BYTES * len(motions)

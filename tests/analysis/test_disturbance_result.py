"""What a table does to a shot, as the result file has it."""

import json

import pytest

from analysis.pipeline import analyse_motion
from analysis.report import shot_result
from analysis.shot import AnalysisSettings
from tests.analysis.collision import Rig
from tests.analysis.disturbance import Disturbance, Line, disturbed_motion

RIG = Rig(speed_m_per_s=0.16, touch_s=0.012003)


def test_lines_floor_and_shares_stand_in_the_result() -> None:
    motion = disturbed_motion(RIG, Disturbance(lines=(Line(300.0, 2e-8, 1.0),), criterion="VC-E"))
    shot = analyse_motion(motion, AnalysisSettings(fit=False), name="shaken")
    entry = json.loads(json.dumps(shot_result(shot)))["disturbance"]
    (line,) = entry["lines"]
    assert line["frequency_hz"]["value"] == pytest.approx(300.0, abs=0.5)
    assert line["amplitude_m"]["value"] == pytest.approx(2e-8, rel=0.1)
    assert 1e-6 < entry["floor_rms_m_per_s"] < 5e-5
    assert entry["knocks_s"] == []
    assert entry["variance_shares"]["velocity_in_m_per_s"] > 0.9

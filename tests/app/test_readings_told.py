"""What a table does to a shot, and which model a reading rests on, as result file and report tell it."""

import html
import json
from dataclasses import replace

import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.findings.model_file import from_text
from analysis.fitted.fitted_shot import fit_jointly, read_with, with_fit
from analysis.fitted.readings_from_fit import fitted_contact_cor
from analysis.pipeline import analyse_motion
from analysis.report import shot_result
from analysis.shot.shot import AnalysisSettings
from app.report.number_tables import summary
from app.report.page import report_of
from tests.analysis.disturbance import Disturbance, Line, disturbed_motion
from tests.analysis.synthetic_collision import MASS_KG, Synthetic

RIG = Synthetic(speed_m_per_s=0.16, touch_s=0.012003)


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
    page = report_of([shot])
    assert "Vibration of the path" in page and "Spectral lines present" in page
    assert "velocity before touch" in page


def test_what_rests_on_a_model_says_on_which() -> None:
    motion = disturbed_motion(RIG, Disturbance())
    bare = analyse_motion(motion, AnalysisSettings(fit=False), name="bare")
    assert shot_result(bare)["readings_model"] is None
    assert "read from the motion alone" in report_of([bare])
    fitted = analyse_motion(motion, AnalysisSettings(effects=(effect_named("viscous_drag"),)), name="fitted")
    told = json.loads(json.dumps(shot_result(fitted)))["readings_model"]
    assert told == {"base": "paper", "effects": ["viscous_drag"], "readings": ["cor_kinetic.contact"]}
    page = report_of([replace(fitted, path="shot.sigmf-meta")])
    assert "From the fitted model paper with" in page
    assert "--model model.toml" in page  # to repeat it, with the very effects
    written = from_text(html.unescape(page.partition("<pre>")[2].partition("</pre>")[0]))
    assert fitted.fit is not None and written.effects == (effect_named("viscous_drag"),)
    assert written.parameters["viscous_drag.coefficient_n_s_per_m"].value == pytest.approx(
        fitted.fit.parameters["viscous_drag.coefficient_n_s_per_m"].value, rel=1e-9
    )


def test_readings_made_again_after_a_diagnosis_say_so_in_result_table_and_report() -> None:
    shot = analyse_motion(disturbed_motion(RIG, Disturbance()), AnalysisSettings(), name="shot")
    found = fit_jointly([shot], "paper", (effect_named("viscous_drag"),))
    assert shot.fit is not None
    again = read_with(shot, found)
    assert again.fit is shot.fit and again.impact is not None and shot.impact is not None
    assert again.impact.cor_kinetic.contact == fitted_contact_cor(found, MASS_KG)
    assert again.impact.cor_kinetic.contact != shot.impact.cor_kinetic.contact
    told = shot_result(again)["readings_model"]
    assert told == {"base": "paper", "effects": ["viscous_drag"], "readings": ["cor_kinetic.contact"]}
    assert "from model paper + viscous_drag" in summary(again)
    assert "made again" not in summary(shot)
    assert "From the fitted model paper with" in report_of([again])
    assert with_fit(again, shot.fit).readings_fit is None

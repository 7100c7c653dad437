"""The report's sections on a diagnosis, a prediction and several shots, number by number."""

import math
import re
from dataclasses import replace

import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Errors, PredictedShot, PredictionTest
from analysis.shot.quantity import Quantity
from analysis.uncertainty import budget, series
from app.report.diagnosis_section import diagnosis_section, error_rows, prediction_section
from app.report.session_section import session_section, shared_stds
from tests.app.synthetic import diagnosis, learned_law, shot

NAN = math.nan


def _tables(markup: str) -> list[list[list[str]]]:
    """Return the cells of each row of each table."""
    return [
        [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)]
        for table in re.findall(r"<table.*?</table>", markup)
    ]


def test_a_kind_of_error_has_the_unit_of_its_largest_value_and_goes_where_none_is_known() -> None:
    columns = [("a", Errors(1.2e-6, NAN, 3e-3, 2.5)), ("b", Errors(9e-8, NAN, 2e-5, NAN))]
    assert error_rows(columns) == [
        ["displacement, rms (µm)", "1.2", "0.09"],
        ["force, rms (mN)", "3", "0.02"],
        ["reduced χ²", "2.5", "–"],
    ]


def test_a_predictions_shots_are_in_the_unit_of_their_heading() -> None:
    """900 nm stood under "displacement, rms (µm)" as 900."""
    effects = effects_named(("quadratic_drag",))
    shots = (
        PredictedShot("one", False, Errors(9e-7, 1e-4, 2e-2, 50.0), Errors(2e-9, 1e-5, 2e-3, 1.1)),
        PredictedShot("two", True, Errors(3e-6, 1e-4, 2e-2, 50.0), Errors(4e-8, 1e-5, 2e-3, 1.2)),
        PredictedShot("three", False, None, None, "no impact"),
        PredictedShot("four", False, Errors(5e-7, 1e-4, 2e-2, 50.0), None, "not fitted"),
    )
    told = PredictionTest("paper", effects, Errors(1.5e-6, 1e-4, 2e-2, 50.0), Errors(3e-8, 1e-5, 2e-3, 1.15), shots)
    page = str(prediction_section(told))
    whole, each = _tables(page)
    assert whole == [
        ["", "base model", "saved model"],
        ["displacement, rms (µm)", "1.5", "0.03"],
        ["velocity, rms (µm/s)", "100", "10"],
        ["force, rms (mN)", "20", "2"],
        ["reduced χ²", "50", "1.15"],
    ]
    assert each == [
        ["shot", "base model: displacement, rms (µm)", "saved model", "remarks"],
        ["one", "0.9", "0.002", ""],
        ["two", "3", "0.04", "used to fit the model: no test"],
        ["three", "–", "–", "no impact"],
        ["four", "0.5", "–", "not fitted"],
    ]
    assert f"Model paper with {effects[0].words}, as saved" in page
    assert "with no effect," in str(prediction_section(replace(told, effects=())))


def test_errors_before_and_after_stand_beside_those_of_the_shot_held_out() -> None:
    said = diagnosis(shot())
    (errors, *_) = _tables(str(diagnosis_section(said, [shot()])))
    assert errors[0] == ["", "before", "after", "validation shot, before", "validation shot, after"]
    assert errors[1] == ["displacement, rms (nm)", "62", "1.1", "70", "1.3"]
    assert errors[4] == ["reduced χ²", "3800", "1.01", "4000", "1.05"]
    (alone, *_) = _tables(str(diagnosis_section(replace(said, error_held_out_after=None), [shot()])))
    assert [len(row) for row in alone] == 5 * [3]


def test_a_diagnosis_says_of_what_it_was_made_and_every_effect_it_tried() -> None:
    said = diagnosis(shot())
    page = str(diagnosis_section(said, [shot(), shot("two", seed=3), shot("no", problem="no impact")]))
    assert "Based on 2 shots" in page and "Based on 1 shot." in str(diagnosis_section(said, [shot()]))
    (_, tried, *_) = _tables(page)
    assert tried[0] == ["effect", "score", "ΔBIC", "size", "remark"]
    assert [row[:3] for row in tried[1:3]] == [
        [said.candidates[0].effect.words, "60", "-812"],
        [said.candidates[1].effect.words, "30", "-203"],
    ]
    assert "coefficient (1.90 ± 0.10)e-3 N s²/m²" in page.replace("\u00a0", " ").replace("\u2060", "")
    assert "Evidence: delta bic 812." in page and "cannot distinguish it from viscous drag" in page
    scored = replace(said, candidates=(replace(said.candidates[0], delta_bic=None),))
    assert _tables(str(diagnosis_section(scored, [shot()])))[1][1][2] == "–"
    assert "Shot that would distinguish the candidates" in str(diagnosis_section(said, [shot()], "throw it faster"))


def test_the_residuals_of_a_diagnosis_are_drawn_where_two_fits_differ() -> None:
    said, one = diagnosis(shot()), shot()
    assert "Residual of displacement" not in diagnosis_section(said, [one])
    part = one.fit.shots[0]
    before = replace(one.fit, shots=(replace(part, residual_m=50.0 * part.residual_m),))
    page = str(diagnosis_section(replace(said, fit_before=before), [one]))
    assert "Residual of displacement, before and after." in page
    assert "Model of all shots, before" in page and "Model of all shots, after" in page
    assert "shot-1 (nm)" in page
    unnamed = str(diagnosis_section(replace(said, fit_before=before), [one, shot("two", seed=3)]))
    assert "shot 1 (nm)" in unnamed and "shot-1 (nm)" not in unnamed


def test_a_learned_law_is_told_with_its_range_and_its_rivals() -> None:
    law = learned_law()
    page = str(diagnosis_section(replace(diagnosis(shot()), laws=(law,)), [shot()]))
    assert "force on the block</b> as a function of place: a*exp(-abs(x)/b)" in page
    assert "Range covered: -0.002 to 0.001 m. Not observable: any part outside the range covered." in page
    assert "do not exclude inverse square (ΔBIC +4.2), hinge (ΔBIC +8.0)." in page
    assert f"a = {law.parameters['a'][0]} N; b = {law.parameters['b'][0]} m" in page
    bare = replace(law, formula=None, same_by_gauge=("it may be a spring",), other_forms=())
    page = str(diagnosis_section(replace(diagnosis(shot()), laws=(bare,)), [shot()]))
    assert "no closed form" in page and "Also: it may be a spring." in page and "do not exclude" not in page


@pytest.fixture(scope="module")
def shots():
    return [shot("one"), replace(shot("two", 0.31, seed=2), note="heavy"), shot("three", 0.22, seed=3)]


def test_what_all_shots_share_is_the_median_of_each_shots_own(shots) -> None:
    shared = shared_stds([*shots, shot("no", problem="no impact")])
    own = [{q.key: q.std_b for q in budget(one).quantities} for one in shots]
    for key in ("force_peak_n", "velocity_in_m_per_s"):
        assert shared[key] == pytest.approx(sorted(one[key] for one in own)[1], rel=1e-12, abs=0.0)


def test_a_session_tells_every_shot_and_their_mean_with_what_all_share(shots) -> None:
    page = str(session_section([*shots, shot("four", seed=4, problem="no impact")]))
    assert "All 4 shots" in page
    overview, means = _tables(page)[:2]
    assert [row[0] for row in overview[1:]] == [
        f'<a href="#shot-{place}">{name}</a>' for place, name in enumerate(("one", "two", "three", "four"), 1)
    ]
    assert [row[-1] for row in overview[1:]] == ["", "clipped; heavy", "", "failed: no impact"]
    assert overview[1][1] == shots[0].started_at
    found = series([*shots, shot("four", seed=4, problem="no impact")])
    shared = shared_stds(shots)
    assert len(means) == 1 + len(found.summaries)
    for summary, row in zip(found.summaries, means[1:], strict=True):
        assert row[1] == str(len(summary.shots))
        if summary.key == "force_peak_n":
            assert isinstance(summary.mean, Quantity)
            whole = math.hypot(summary.mean.std, shared[summary.key])
            factor = 1e3 if "mN" in row[0] else 1.0
            assert str(Quantity(summary.mean.value, whole).scaled(factor)) in row[2]
            assert row[3] == f"{factor * summary.mean.std:.2g}"
    captions = page.count("time from first touch (ms)")
    assert captions >= 3 and "Trends." in page
    alone = str(session_section([shots[0], shot("no", problem="no impact")]))
    assert "Overlay." not in alone and "Trends." not in alone

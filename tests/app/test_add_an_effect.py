"""Follow docs/add-an-effect.md with the code that stands there: one function and one row, and every place knows it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import levimass
from analysis.collision.effects import CATALOGUE
from analysis.collision.parameters import PAPER
from analysis.collision.solver import general
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.diagnosis.findings.result import FoundEffect, Verdict
from analysis.shot.quantity import Quantity
from app.report.page import report_of
from app.session.session import Session
from app.session.verdict_basis import ModelEffects
from app.words.model_texts import verdict_words
from app.words.wording import effect_numbers, unbroken
from instrument.files.motion_file import MotionRecord
from tests.app import synthetic
from tests.pages import code_blocks, effect_of_the_page

NAME, SIZE = "cubic_drag", Quantity(3e-3, 1e-5)


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> Any:
    effect = effect_of_the_page()
    monkeypatch.setitem(CATALOGUE, effect.name, effect)
    return effect


def test_the_pages_function_brakes_as_its_equation_says(added: Any) -> None:
    collision, time_s = replace(PAPER, velocity_in_m_per_s=-0.4), np.arange(-1500, 1) * 1e-5
    strength = 3e-2
    run = general.solve(collision, [general.ActiveEffect(added, (strength,))], time_s)
    here = np.gradient(run.velocity_m_per_s, time_s)[10:-10]
    speed = run.velocity_m_per_s[10:-10]
    assert here == pytest.approx(-strength * speed**3 / collision.block_mass_kg, rel=1e-3)


@pytest.mark.usefixtures("added")
def test_the_pages_script_writes_motion_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(code_blocks("add-an-effect.md")[2], "cubic.py", "exec"), {})
    (fast,) = (tmp_path / "cubic").glob("shot-3.csv")
    record = levimass.read(fast)
    assert isinstance(record, MotionRecord) and record.model == "plate" and record.time_s.size == 6000


def test_the_row_is_named_in_model_files_sessions_verdicts_and_reports(added: Any, tmp_path: Path) -> None:
    shot = synthetic.shot()
    parameter = f"{NAME}.coefficient_n_s3_per_m3"
    parameters, size = {**shot.fit.parameters, parameter: SIZE}, len(shot.fit.parameters) + 1
    fit = replace(shot.fit, effects=(added,), parameters=parameters, covariance=np.eye(size))
    assert from_text(to_text(saved(fit, ["shot-1"]))).effects == (added,)
    session = Session(tmp_path / "session.json")
    session.set_effects(ModelEffects().with_effects("paper", (added,)))
    assert Session.reopen(tmp_path / "session.json").effects.collision == (added,)
    assert added.words == verdict_words(Verdict.EFFECT_FOUND, (added,))
    assert verdict_words(Verdict.EFFECT_FOUND, (added,), short=True) == "cubic drag"
    assert effect_numbers(added, {"coefficient_n_s3_per_m3": SIZE}).endswith(unbroken("e-3 N s³/m³"))
    found = FoundEffect(added, {"coefficient_n_s3_per_m3": SIZE}, {})
    page = report_of([replace(shot, fit=fit)], replace(synthetic.diagnosis(shot), effects=(found,), fit_after=fit))
    assert page.count(added.words) >= 2 and "N s³/m³" in page

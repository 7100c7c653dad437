"""A person's own laws in the window: typed, kept, asked; and a learned law drawn, compared, exported."""

import csv
import json
import pickle
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE, NUISANCES, WIDER_EFFECTS, effect_named
from analysis.collision.laws.user_law import law_from_table
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.diagnosis.findings.result import Verdict
from analysis.drive.catalogue import GAIN_ERROR, LAWS
from analysis.report import fit_result
from analysis.shot.quantity import Quantity
from app.report.exports import export_laws
from app.session.model_in_use import OwnLaws
from app.session.result_archive import NotStorable, rebuild, split
from app.session.session import Session
from app.session.verdict_basis import ModelEffects, VerdictBasis
from app.window.panels.law import LawCurve, LawSheet
from instrument.files.law_file import read_law, write_law
from instrument.files.recording_error import RecordingError
from tests.app.synthetic import diagnosis, learned_law, shot

STIR = {
    "name": "stir",
    "words": 'a "stirring" drag',
    "where": "block",
    "formula": "-c * v**3 + 0*b",
    "parameters": {"c": {"unit": "N s3/m3", "start": 3e-3, "lower": 0.0}, "b": {"unit": "", "start": 1.0}},
}


SHAKEN = {
    "name": "shaken",
    "words": "a frame that shakes the plate",
    "where": "plate",
    "formula": "a*sin(565*t + phase_rad)",
    "parameters": {"a": {"unit": "N", "start": 1e-3}, "phase_rad": {"unit": "rad", "start": 0.1, "own": True}},
}


@pytest.mark.parametrize("table", [STIR, SHAKEN], ids=["shared", "fitted per shot"])
def test_a_law_is_written_as_it_is_read(tmp_path, table):
    law = law_from_table(table)
    path = write_law(law, tmp_path / "laws")
    assert read_law(path) == law
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="already"):
        write_law(replace(law, words="another"), tmp_path / "laws")
    assert path.read_bytes() == before


def test_a_law_in_the_model_goes_through_files_and_processes_as_the_same_effect(tmp_path):
    law, other = law_from_table(STIR), law_from_table({**STIR, "formula": "-c * v**5 + 0*b"})
    assert law != other and law.name == other.name and {law, other} - {law_from_table(STIR)} == {other}
    of = shot()
    sizes = {**of.fit.parameters, f"{law.key}.c": Quantity(3e-3, 1e-5), f"{law.key}.b": Quantity(1.0, 0.1)}
    fit = replace(of.fit, effects=(law,), parameters=sizes, covariance=np.eye(len(sizes)))
    of = replace(
        of, path=str(tmp_path / "a.csv"), fit=fit, settings=replace(of.settings, effects=(law, effect_named("tilt")))
    )
    text = to_text(saved(fit, ["a"], tried=(law,)))
    assert from_text(text).effects == from_text(text).tried == (law,)
    assert tomllib.loads(text)["effects"] == ['stir{"name":"stir",' + law.key.partition(",")[2]]
    assert pickle.loads(pickle.dumps(of.settings)) == of.settings
    assert rebuild(*split(of)).fit.effects == (law,)
    session = Session(tmp_path / "session.json")
    session.add(of)
    session.set_effects(ModelEffects((law,), tried=(law,)))
    session.set_verdict(1, VerdictBasis((law,), (other,), (1,), Verdict.LAW_LEARNED))
    written = json.loads((tmp_path / "session.json").read_text())
    assert written["effects"] == written["tried"] == [law.key]
    assert written["shots"][0]["settings"]["effects"] == [law.key, "tilt"]
    assert written["shots"][0]["verdict_of"]["found"] == [other.key]
    again = Session.reopen(tmp_path / "session.json")
    assert again.effects == session.effects and again.entries[0].verdict_of == session.entries[0].verdict_of
    assert again.entries[0].settings == of.settings
    assert list(fit_result(fit)["parameters"])[-2:] == ["stir.c", "stir.b"] and fit_result(fit)["effects"] == [law.key]


def test_every_effect_and_candidate_is_kept_and_sent_to_another_process():
    for effect in (*CATALOGUE.values(), *WIDER_EFFECTS.values(), *NUISANCES.values(), *LAWS.values(), GAIN_ERROR):
        assert rebuild(*split(effect)) == pickle.loads(pickle.dumps(effect)) == effect, effect
    with pytest.raises(NotStorable, match="gremlins"):
        rebuild({"effect": "gremlins", "base": ""}, [])


def test_what_a_later_version_named_is_no_verdict_of_this_one(tmp_path):
    session = Session(tmp_path / "session.json")
    session.add(replace(shot(), path=str(tmp_path / "a.csv")))
    session.set_verdict(1, VerdictBasis((), (effect_named("tilt"),), (1,), Verdict.EFFECT_FOUND))
    path = tmp_path / "session.json"
    path.write_text(path.read_text().replace('"tilt"', '"gremlins"'))
    (entry,) = Session.reopen(path).entries
    assert entry.verdict == "" and entry.verdict_of is None


def test_the_folder_of_laws_is_asked_and_a_spoilt_file_told(tmp_path):
    laws = OwnLaws(tmp_path)
    assert laws.read() == ((), ())
    laws.keep(STIR)
    (tmp_path / "broken.toml").write_text("name = 3\n")
    (tmp_path / "twice.toml").write_text((tmp_path / "stir.toml").read_text())
    found, problems = laws.read()
    assert found == (law_from_table(STIR),)
    assert [
        problem.partition(":")[0].endswith(name)
        for problem, name in zip(problems, ("broken.toml", "twice.toml"), strict=True)
    ]
    assert len(problems) == 2 and all("\n" not in problem for problem in problems)


def test_the_sheet_says_what_is_wrong_while_it_is_typed(qtbot):
    sheet = LawSheet()
    qtbot.addWidget(sheet)
    assert not sheet.save.isEnabled() and sheet.said.text() == ""
    for shown in (True, False):
        sheet.toggle()
        assert sheet.isVisible() == shown
    sheet.fill(SHAKEN)
    assert sheet.save.isEnabled() and sheet.table() == SHAKEN
    sheet.own[0].setChecked(True)
    assert not sheet.save.isEnabled() and "that the shots share" in sheet.said.text()
    sheet.fill(STIR)
    assert sheet.save.isEnabled() and "Formula is valid" in sheet.said.text()
    assert sheet.table() == STIR
    sheet.formula.setText("-c * w**3 + 0*b")
    assert not sheet.save.isEnabled() and "column 6: no 'w' is known here" in sheet.said.text()
    sheet.formula.setText(STIR["formula"])
    sheet.parameters[0]["start"].setText("3,5e-3")  # a comma is a decimal as well
    assert sheet.save.isEnabled() and sheet.table()["parameters"]["c"]["start"] == 3.5e-3
    sheet.parameters[0]["start"].setText("much")
    assert not sheet.save.isEnabled() and "parameters.c.start" in sheet.said.text()
    sheet.parameters[0]["start"].setText("1")
    with qtbot.waitSignal(sheet.wanted) as given:
        sheet.save.click()
    assert given.args[0]["parameters"]["c"]["start"] == 1.0


def test_the_curve_has_its_band_and_the_forms_that_fit(qtbot):
    panel = LawCurve()
    qtbot.addWidget(panel)
    assert panel.isHidden()
    law = learned_law()
    panel.show_laws((law,))
    assert not panel.isHidden() and panel.other.isHidden()
    drawn = {curve.label: curve.samples for curve in panel.plot.plot.sampled}
    assert drawn["free curve"] == pytest.approx(1e3 * law.curve_force_n)  # in mN
    assert drawn["+ 2 σ"] - drawn["- 2 σ"] == pytest.approx(np.full(31, 4e-2))
    assert drawn["exponential"].size == 31 and "inverse square" not in drawn
    panel.compare.click()
    drawn = {curve.label: curve.samples for curve in panel.plot.plot.sampled}
    assert drawn["inverse square"] == pytest.approx(900 * law.curve_force_n)
    assert panel.plot.span == pytest.approx((-2.0, 1.0))  # mm, the range visited
    with qtbot.waitSignal(panel.keep_wanted) as kept:
        panel.keep.click()
    assert kept.args == [law.effect]
    panel.show_laws((law, replace(law, argument="bend")))
    assert "1 OF 2" in panel._heading.text()
    panel.other.click()
    assert "2 OF 2" in panel._heading.text() and "bend" in panel._heading.text()
    panel.show_laws(())
    assert panel.isHidden() and all(curve.samples.size == 0 for curve in panel.plot.plot.sampled)


def test_the_curve_is_exported(tmp_path):
    law = learned_law()
    (path,) = export_laws(replace(diagnosis(shot()), laws=(law,)), tmp_path)
    header, *rows = list(csv.reader(path.read_text().splitlines()))
    assert header == ["place_m", "force_n", "force_std_n", "exponential_n", "inverse_square_n"]
    assert np.array(rows, dtype=float)[:, 1] == pytest.approx(law.curve_force_n, rel=1e-15)

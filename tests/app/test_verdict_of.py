"""A verdict belongs to the model and the shots that it was passed on."""

import json
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt

from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.findings.result import Verdict
from analysis.shot.shot import AnalysisSettings
from app.report.diagnosis_section import diagnosis_section
from app.session.session import Session
from app.session.settings_store import SettingsStore
from app.session.verdict_basis import Diagnosed, Diagnoses, VerdictBasis, verdict_of
from app.session.workbench import Workbench
from app.window.controls.theme import Theme, Tone
from app.window.panels.layout import Layout
from app.window.panels.session_model import VERDICT, SessionModel
from app.window.panels.state_words import misfit_advice, verdict_line
from app.window.presenters.diagnosis import DiagnosisPresenter
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter
from app.words.model_texts import VERDICTS, verdict_words
from tests.app import synthetic
from tests.app.stepped_work import SteppedWork


def _found(effects=()):
    """Return a diagnosis of shots 1 and 2 with these effects in the model, which found quadratic drag."""
    told = synthetic.diagnosis(synthetic.shot())
    return replace(told, fit_before=replace(told.fit_before, effects=effects_named(effects)))


@pytest.mark.parametrize(
    ("before", "now", "there", "holds"),
    [
        ((), (), (1, 2, 3), True),
        ((), ("quadratic_drag",), (1, 2), True),  # what was found is in the model: the diagnosis fitted that
        ((), ("viscous_drag",), (1, 2), False),
        (("tilt",), (), (1, 2), False),
        (("tilt",), ("quadratic_drag", "tilt"), (1, 2), True),
        ((), (), (1,), False),
    ],
)
def test_it_holds_for_its_model_and_its_shots(before, now, there, holds):
    assert verdict_of(_found(before), (1, 2)).is_valid(effects_named(now), there) is holds


def test_it_is_kept_with_the_session_and_an_older_file_has_none(tmp_path):
    session = Session(tmp_path / "session.json")
    session.add(replace(synthetic.shot(), path=str(tmp_path / "a.csv")))
    session.set_verdict(1, verdict_of(_found(("tilt",)), (1,)))
    (entry,) = Session.reopen(tmp_path / "session.json").entries
    assert entry.verdict_of == session.entries[0].verdict_of
    kept = json.loads((tmp_path / "session.json").read_text())
    del kept["shots"][0]["verdict_of"]
    (tmp_path / "session.json").write_text(json.dumps(kept))
    again = Session.reopen(tmp_path / "session.json")
    assert again.problem is None and again.verdict_is_valid(again.entries[0])


def test_taken_out_of_the_model_an_effect_takes_its_verdict_with_it_here_and_after_a_restart(qtbot, tmp_path):
    """The table said "adequate" beside a model that lacks what was taken out."""
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    path = tmp_path / "session.json"
    bench = Workbench(Session(path), AnalysisSettings, subprocess_worker=SteppedWork())  # type: ignore[arg-type]
    selection = SelectionPresenter(bench, panels, panels)
    session = SessionPresenter(bench, SettingsStore(tmp_path / "settings.json"), panels, selection, panels)
    page = DiagnosisPresenter(bench, panels, panels)
    try:
        shot = synthetic.shot()
        bench.model.add("paper", (effect_named("quadratic_drag"),))
        fit = replace(shot.fit, effects=(effect_named("quadratic_drag"),))
        settings = replace(shot.settings, effects=(effect_named("quadratic_drag"),))
        bench.add_shot(replace(shot, path=str(tmp_path / "a.csv"), fit=fit, settings=settings))
        told = replace(_found(("quadratic_drag",)), verdict=Verdict.ADEQUATE, effects=(), fit_after=fit)
        bench._take_diagnosis((1,), told)

        def looks():
            session.refresh()
            page.refresh()
            panels.table.select([1])
            font = panels.table.model.data(panels.table.model.index(0, VERDICT), Qt.ItemDataRole.FontRole)
            return font is not None and font.strikeOut(), panels.model.verdict.text(), panels.diagnosis._verdict.text()

        struck, beside, heading = looks()
        assert not struck and beside.endswith("adequate") and "ADEQUATE" in heading and "<s>" not in heading
        bench.model.remove("paper", effect_named("quadratic_drag"))
        struck, beside, heading = looks()
        assert struck and "run Diagnose again" in beside and "<s>ADEQUATE</s>" in heading
        again = Session.reopen(path)
        assert not again.verdict_is_valid(again.entries[0])
        bench.undo()
        struck, beside, heading = looks()
        assert not struck and beside.endswith("adequate") and "<s>" not in heading
    finally:
        bench._work._subprocess_worker.close()
        bench.close()


def test_forces_modelled_for_an_older_diagnosis_are_not_shown_beside_a_newer(qtbot, tmp_path, monkeypatch):
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    bench = Workbench(Session(tmp_path / "session.json"), AnalysisSettings, subprocess_worker=SteppedWork())  # type: ignore[arg-type]
    page, shown = DiagnosisPresenter(bench, panels, panels), []
    monkeypatch.setattr(panels.diagnosis.residuals, "show_forces", lambda *given: shown.append(given))
    try:
        bench.add_shot(synthetic.shot())
        older, newer = _found(), _found()

        def come(diagnosis):
            page._show_forces(bench.session.entries[0], (diagnosis, "before", "after"))

        come(older)
        assert shown == []  # nothing is diagnosed any more
        bench._take_diagnosis((1,), newer)
        come(older)
        assert shown == []
        come(newer)
        assert shown == [(bench.session.entries[0].shot, "before", "after")]
    finally:
        bench._work._subprocess_worker.close()
        bench.close()


def _entry(conclusion, found=()):
    session = Session()
    session.add(synthetic.shot())
    session.set_verdict(1, VerdictBasis((), effects_named(found), (1,), conclusion))
    return session.entries[0]


@pytest.mark.parametrize(
    ("conclusion", "found", "model", "tone", "more"),
    [
        (Verdict.ADEQUATE, (), (), Tone.GOOD, ""),
        (Verdict.UNEXPLAINED, ("tilt",), ("tilt",), Tone.BAD, ""),
        (Verdict.EFFECT_FOUND, ("tilt", "adhesion"), ("tilt",), Tone.WARNING, ""),
        (Verdict.EFFECT_FOUND, ("tilt", "adhesion"), ("adhesion", "tilt", "viscous_drag"), Tone.GOOD, ": in the model"),
        (Verdict.PARTLY_EXPLAINED, (), (), Tone.WARNING, ""),
    ],
)
def test_a_verdicts_tone_comes_from_what_was_concluded_and_not_from_its_words(conclusion, found, model, tone, more):
    entry, model = _entry(conclusion, found), effects_named(model)
    assert verdict_line(entry, model) == (entry.verdict + more, tone)
    assert verdict_line(entry, model, holds=False) == (
        f"<s>{entry.verdict}</s> outdated: run Diagnose again",
        Tone.NEUTRAL,
    )


def test_a_fit_without_what_its_diagnosis_found_is_said_to_lack_it():
    words = "this fit lacks what the diagnosis found: add it to the model"
    found = _entry(Verdict.EFFECT_FOUND, ("tilt", "adhesion"))
    assert misfit_advice(found, effects_named(("tilt",)), True) == words
    assert misfit_advice(found, effects_named(("adhesion", "tilt")), True) == ""
    assert misfit_advice(found, (), False) == misfit_advice(None, (), True) == "run Diagnose"
    assert misfit_advice(_entry(Verdict.UNEXPLAINED, ("tilt",)), (), True) == ""  # nothing was found


def test_every_conclusion_is_worded_in_one_place(qtbot):
    assert set(VERDICTS) == set(Verdict)
    found = effects_named(("quadratic_drag", "tilt"))
    for conclusion, said in VERDICTS.items():
        assert Tone(said.tone) and verdict_words(conclusion, ()) == said.brief == said.brief.lower()
        whole, short = (verdict_words(conclusion, found, short=short) for short in (False, True))
        assert whole == ("quadratic drag on the block + a tilt of the guideway" if said.names else said.brief)
        assert short == ("quadratic drag + 1" if said.names else said.brief)
        diagnosis = replace(_found(), verdict=conclusion)
        assert said.full in str(diagnosis_section(diagnosis, [synthetic.shot()]))
        model = SessionModel()
        model.show_entries((_entry(conclusion, found),))
        assert model.data(model.index(0, VERDICT)) == short
        assert model.data(model.index(0, VERDICT), Qt.ItemDataRole.EditRole) == whole


def test_of_several_diagnoses_the_newest_of_just_the_selection_is_shown_else_one_with_its_last_shot():
    one, both, again, other = (Diagnosed(None, numbers) for numbers in ((1,), (1, 2), (2, 1), (2,)))
    kept = Diagnoses([one, both, again, other])
    assert kept.newest is other and Diagnoses().newest is None
    assert kept.of([1, 2]) is again and kept.of([1]) is one
    assert kept.of([3, 1]) is again and kept.of([3]) is None  # of some with the last that was selected
    assert kept.within({1, 2, 3}) is other and kept.within({1, 3}) is one and kept.within({3}) is None

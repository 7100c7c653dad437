"""The model as a file, from the window's own presenter: saved, loaded, held against a shot, refused in one line."""

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QLineEdit
from pytestqt.qtbot import QtBot

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.drive.catalogue import LAWS
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError
from app.session.model_in_use import drift_words, load_model, model_words, save_model
from app.session.session import Session
from app.session.verdict_basis import ModelEffects
from app.window.main_window import open_window
from instrument.files.recording_error import RecordingError
from tests.app import rigs, synthetic

WAIT_MS = 60_000


def _never() -> bool:
    return False


QUIETLY = {"progress": lambda *_: None, "cancelled": _never}


def test_a_model_that_cannot_be_saved_or_read_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(AnalysisError, match="no shot is fitted"):
        save_model(tmp_path / "m.toml", [synthetic.bare_shot("a")], ModelEffects(), None, **QUIETLY)
    with pytest.raises(RecordingError, match=r"none\.toml: no such file"):
        load_model(tmp_path / "none.toml")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("schema = 3")
    with pytest.raises(RecordingError, match=r"wrong\.toml: schema"):
        load_model(wrong)


def test_what_lies_beyond_chance_is_named_largest_first() -> None:
    fit = synthetic.shot("a", 0.2, 1).fit
    assert fit is not None
    known = saved(fit, ["a"])
    assert drift_words(known, fit) == ""
    assert model_words(known) == "paper model, no added effects, from 1 shot"
    first, second = list(fit.parameters)[:2]

    def moved(name: str, sigmas: float) -> Quantity:
        q = fit.parameters[name]
        return Quantity(q.value + sigmas * 2**0.5 * q.std, q.std, q.how)

    other = replace(fit, parameters={**fit.parameters, first: moved(first, 6.0), second: moved(second, -9.0)})
    words = drift_words(known, other)
    assert words.index("-9.0 σ") < words.index("+6.0 σ")
    assert drift_words(replace(known, base="clamped"), other) == ""


def test_a_model_that_is_saved_says_which_effects_were_only_tried(tmp_path: Path) -> None:
    shot = synthetic.shot("a", 0.2, 1)
    found = synthetic.diagnosis(shot)
    assert shot.fit is not None
    (named,), adhesion = {finding.effect for finding in found.effects}, CATALOGUE["adhesion"]
    found = replace(found, fit_after=replace(shot.fit, effects=(named, adhesion)))
    effects = ModelEffects((named, adhesion), tried=(adhesion, named))
    said = save_model(tmp_path / "m.toml", [shot], effects, found, **QUIETLY)
    assert load_model(tmp_path / "m.toml").tried == (adhesion,)  # the other was named meanwhile
    assert "adhesion at release (tried)" in said


def test_the_accepted_effects_come_back_with_the_session(tmp_path: Path) -> None:
    session = Session(tmp_path / "session.json")
    drag, friction = (CATALOGUE["quadratic_drag"],), (LAWS["coulomb_friction"],)
    session.set_effects(ModelEffects(drag, friction))
    again = Session.reopen(tmp_path / "session.json").effects
    assert again.of("clamped") == drag and again.of("driven") == friction


def test_saved_and_opened_by_keys(qtbot: QtBot, tmp_path: Path, warm_kernels: None) -> None:
    window = open_window(tmp_path, rigs.idle_bench, apart=False)
    qtbot.addWidget(window)

    def answer(path: Path) -> None:
        qtbot.waitUntil(lambda: bool(window.findChildren(QFileDialog)), timeout=WAIT_MS)
        name = window.findChildren(QFileDialog)[0].findChild(QLineEdit)
        name.setText(str(path))
        qtbot.keyClick(name, Qt.Key.Key_Return)
        qtbot.waitUntil(lambda: not window.findChildren(QFileDialog), timeout=WAIT_MS)
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)

    try:
        window.show()
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)
        both = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
        shot = synthetic.shot("a", 0.2, 1)
        assert shot.fit is not None
        model = saved(shot.fit, ["a"])
        pair = CATALOGUE["tilt"], CATALOGUE["adhesion"]
        for name, effects, tried in (("tilted", pair, pair[1:]), ("plain", (), ())):
            path = tmp_path / f"{name}.toml"
            path.write_text(to_text(replace(model, effects=effects, tried=tried)), encoding="utf-8")
            qtbot.keyClick(window, Qt.Key.Key_O, both)
            answer(path)
            qtbot.waitUntil(lambda path=path: path.name in window.panels.work.notices.words, timeout=WAIT_MS)
            assert window.workbench.session.effects.of("paper") == effects
            assert window.workbench.session.effects.tried == tried
        assert not window.panels.model.known.text()
        entry = window.workbench.add_shot(shot)
        window.pull()
        window.panels.table.select([entry.number])
        qtbot.waitUntil(lambda: "agrees with the model file" in window.panels.model.known.text(), timeout=WAIT_MS)
        qtbot.keyClick(window, Qt.Key.Key_S, both)
        answer(tmp_path / "out")  # the ending is added
        qtbot.waitUntil(lambda: "out.toml" in window.panels.work.notices.words, timeout=WAIT_MS)
        assert from_text((tmp_path / "out.toml").read_text(encoding="utf-8")).base == shot.fit.model
    finally:
        window.close()

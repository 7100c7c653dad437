"""Sessions by name, what was open lately, and the window as it was left."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog

from app.session.session import Session
from app.session.session_files import last_session, named_session
from app.session.workbench import Workbench
from app.window.main_window import open_window
from instrument.files.recording_error import RecordingError
from tests.app import rigs, synthetic
from tests.app.on_screen import click_head


@pytest.fixture
def workbench(tmp_path):
    shot = synthetic.bare_shot("a")
    workbench = Workbench(last_session("", tmp_path), lambda: shot.settings)
    workbench.session.add(replace(shot, path=str(tmp_path / "a.csv"), note="first"))
    yield workbench
    workbench.close()


def test_a_session_goes_on_under_its_new_name_and_comes_back(workbench, tmp_path):
    run = tmp_path / "runs" / "monday.json"
    assert "does not exist" in (workbench.save_session(run) or "")
    run.parent.mkdir()
    assert workbench.save_session(run) is None and workbench.save_session(run) is None
    workbench.session.set_note(1, "second")
    assert workbench.open_unnamed_session() is None
    assert [entry.note for entry in workbench.session.entries] == ["first"]  # as it was when it got its name
    assert workbench.session.undo() is None
    assert workbench.open_session(run) is None
    assert [entry.note for entry in workbench.session.entries] == ["second"]
    with pytest.raises(RecordingError, match="this session is open in another window"):
        named_session(run)
    there = last_session(str(run), tmp_path / "second")
    assert there.problem is not None and "another window" in there.problem
    there.unlock()


def test_what_is_no_session_is_left_as_it_is(workbench, tmp_path):
    other = tmp_path / "result.json"
    other.write_text('{"schema": "levimass.result/1"}')
    assert "not a Levimass session" in (workbench.open_session(other) or "")
    assert "no such file" in (workbench.open_session(tmp_path / "none.json") or "")
    assert other.read_text() == '{"schema": "levimass.result/1"}' and workbench.session.entries[0].name == "a"


def test_what_was_asked_in_another_session_changes_nothing_in_this(workbench, tmp_path):
    found, take = synthetic.diagnosis(synthetic.shot()), partial(workbench._take_diagnosis, (1,))
    workbench.jobs.submit("diagnosis", lambda _, __: found, "diagnosis", take)
    while workbench.jobs.open_jobs:
        pass
    other = tmp_path / "other.json"
    Session(other).set_effects(Session().effects)
    assert workbench.open_session(other) is None
    workbench.poll()
    assert workbench.diagnoses == [] and workbench.session.entries == ()


def test_the_window_reopens_as_it_was_left(qtbot, tmp_path, warm_kernels):
    data = tmp_path / "data"
    data.mkdir()
    (tmp_path / "settings.json").write_text(json.dumps({"levimass_settings": 1, "folder": str(data)}))
    window = open_window(tmp_path, rigs.idle_bench, apart=False)
    qtbot.addWidget(window)
    window.resize(1100, 700)
    window.show()
    window.panels.across.setSizes([500, 500])
    window.panels.table.table.setColumnWidth(2, 333)
    named = data / "tuesday.json"
    window.files_presenter.save_to(named)
    assert window.windowTitle() == "tuesday – Levimass"
    window.files_presenter._fill()
    assert [action.text() for action in window.files_presenter.recent.actions()] == ["tuesday.json"]
    for ask in (
        window.session_presenter.open_recordings, partial(window.session_presenter.export, "export"),
        window.session_presenter.load_model, window.files_presenter.open_session,
    ):  # fmt: skip
        ask()
        (question,) = window.findChildren(QFileDialog)
        assert Path(question.directory().absolutePath()) == data
        question.close()
        qtbot.waitUntil(lambda: not window.findChildren(QFileDialog))
    window.files_presenter.save_session()
    (question,) = window.findChildren(QFileDialog)
    assert question.windowTitle() == "Save the session as" and Path(question.selectedFiles()[0]).name == "session.json"
    assert question.acceptMode() is QFileDialog.AcceptMode.AcceptSave and question.defaultSuffix() == "json"
    question.filesSelected.emit([str(data / "wednesday.json")])
    assert window.windowTitle() == "wednesday – Levimass"
    qtbot.waitUntil(lambda: (data / "wednesday.json").is_file())  # a thread of its own writes it
    question.close()
    qtbot.waitUntil(lambda: not window.findChildren(QFileDialog))
    window.files_presenter.open_named(named)
    window.showMaximized()
    across = window.panels.across.saveState()
    click_head(window.panels.table.table, 2)
    assert window.panels.table.table.horizontalHeader().isSortIndicatorShown()
    window.close()
    again = open_window(tmp_path, rigs.idle_bench, apart=False)
    qtbot.addWidget(again)
    again.show()
    assert again.isMaximized() and again.windowTitle() == "tuesday – Levimass"
    assert again.panels.table.table.columnWidth(2) == 333 and again.panels.across.saveState() == across
    header = again.panels.table.table.horizontalHeader()
    assert again.panels.table.model.order.column is None and not header.isSortIndicatorShown()
    click_head(again.panels.table.table, 2)
    click_head(again.panels.table.table, 2)
    assert again.panels.table.model.order.falling and header.isSortIndicatorShown()
    click_head(again.panels.table.table, 2)
    assert again.panels.table.model.order.column is None and not header.isSortIndicatorShown()
    again.close()
    spoilt = json.loads((tmp_path / "settings.json").read_text()) | {"window": "AAAA none of it"}
    (tmp_path / "settings.json").write_text(json.dumps(spoilt))
    third = open_window(tmp_path, rigs.idle_bench, apart=False)
    qtbot.addWidget(third)
    third.close()

"""Shots that a full disk leaves in memory are offered to be saved elsewhere."""

import json
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QLineEdit
from pytestqt.qtbot import QtBot

from analysis.shot.shot import AnalysisSettings
from app.session.session import Session
from app.session.workbench import Event, EventKind, Workbench
from app.window.main_window import open_window
from instrument.files.recording_error import RecordingError, SomeShotsNotSaved
from instrument.files.recording_file import open_recording
from instrument.files.recording_writer import RecordingWriter
from tests.app import rigs, synthetic
from tests.app.on_screen import read_entries

WAIT_MS = 30_000


class _FullDisk(RecordingWriter):
    def append(self, counts: object) -> None:
        raise RecordingError(self.data_path, "No space left on device")


def test_a_shot_in_memory_is_saved_elsewhere_by_the_banners_button(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, warm_kernels: None
) -> None:
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", _FullDisk)
    chosen = {"levimass_settings": 1, "folder": str(tmp_path / "data"), "duration_s": 0.12}
    (tmp_path / "settings.json").write_text(json.dumps(chosen))
    window = open_window(tmp_path, rigs.quick_bench, apart=False)
    qtbot.addWidget(window)
    try:
        window.show()
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)
        button = window.panels.banner.save_elsewhere
        qtbot.waitUntil(lambda: window.panels.controls.arm.isEnabled() and window.rig.channels != (), timeout=WAIT_MS)
        assert not button.isVisible()
        qtbot.keyClick(window, Qt.Key.Key_Space)
        qtbot.waitUntil(lambda: window.panels.banner.word.text() != "READY", timeout=WAIT_MS)
        qtbot.waitUntil(
            lambda: button.isVisible() and len(read_entries(window.workbench.session)) == 1, timeout=WAIT_MS
        )
        assert button.text() == "Save 1 shot elsewhere …"
        assert "No space left" in window.panels.banner.detail.text() and "memory" in window.panels.banner.detail.text()
        window.close()
        assert window.isVisible()  # the first time it only warns
        assert "only in memory" in window.panels.work.notices.words

        button.click()
        (question,) = window.findChildren(QFileDialog)
        assert question.isVisible() and not question.isModal()
        question.close()
        window.rig_presenter.save_elsewhere_wanted.emit(tmp_path / "none")
        qtbot.waitUntil(lambda: "does not exist" in window.panels.work.notices.words, timeout=WAIT_MS)
        assert button.isVisible()

        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        qtbot.waitUntil(lambda: not window.findChildren(QFileDialog), timeout=WAIT_MS)
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)
        qtbot.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
        (question,) = window.findChildren(QFileDialog)
        name = question.findChild(QLineEdit)
        name.setText(str(elsewhere))
        qtbot.keyClick(name, Qt.Key.Key_Return)
        qtbot.waitUntil(lambda: not button.isVisible(), timeout=WAIT_MS)
        (meta,) = elsewhere.glob("*.sigmf-meta")
        qtbot.waitUntil(lambda: "1 shot saved to" in window.panels.work.notices.words, timeout=WAIT_MS)
        assert window.workbench.session.entries[0].path == str(meta)
        assert open_recording(meta).samples > 0
        window.pull()

        window.activateWindow()
        qtbot.waitUntil(lambda: window.isActiveWindow() and window.panels.controls.arm.isEnabled(), timeout=WAIT_MS)
        window.panels.controls.arm.click()  # the next such shot is warned of anew
        qtbot.waitUntil(lambda: len(window.rig.latest().unsaved) == 1, timeout=WAIT_MS)
        window.close()
        assert window.isVisible()
    finally:
        window.close()
    assert not window.isVisible()


def test_what_was_saved_before_the_disk_failed_keeps_its_path(qtbot: QtBot, tmp_path: Path) -> None:
    def save(folder: Path) -> dict[str, Path]:
        raise SomeShotsNotSaved(
            RecordingError(folder, "No space left on device"), {"shot-0001": folder / "a.sigmf-meta"}
        )

    workbench = Workbench(Session(tmp_path / "session.json"), AnalysisSettings)
    try:
        workbench.session.add(synthetic.bare_shot("shot-0001"))
        workbench.unsaved.save(save, tmp_path)
        happened: list[Event] = []
        qtbot.waitUntil(lambda: bool(happened.extend(workbench.poll()) or happened), timeout=WAIT_MS)
        assert happened[0].kind is EventKind.PROBLEM
        assert "1 shot saved" in happened[0].words and "No space left" in happened[0].words
        assert workbench.session.entries[0].path == str(tmp_path / "a.sigmf-meta")
    finally:
        workbench.close()


def test_a_shot_saved_before_it_was_analysed_keeps_its_path(qtbot: QtBot, tmp_path: Path) -> None:
    workbench = Workbench(Session(tmp_path / "session.json"), AnalysisSettings)
    try:
        workbench.unsaved.save(lambda folder: {"shot-0001": folder / "a.sigmf-meta"}, tmp_path)
        qtbot.waitUntil(lambda: bool(workbench.poll()), timeout=WAIT_MS)
        assert workbench.add_shot(synthetic.bare_shot("shot-0001")).path == str(tmp_path / "a.sigmf-meta")
        assert workbench.add_shot(synthetic.bare_shot("shot-0001")).path is None  # another of that name
    finally:
        workbench.close()

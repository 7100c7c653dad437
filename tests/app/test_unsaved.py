"""Shots that a full disk leaves in memory are offered to be saved elsewhere."""

import json
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from app.window import open_window
from instrument.open_recording import open_recording
from instrument.recording_error import RecordingError
from instrument.recording_writer import RecordingWriter
from tests.app import rigs

WAIT_MS = 30_000


class _FullDisk(RecordingWriter):
    def append(self, counts: object) -> None:
        raise RecordingError(self.data_path, "No space left on device")


def test_a_shot_in_memory_is_saved_elsewhere_by_the_banners_button(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, warm_kernels: None
) -> None:
    monkeypatch.setattr("instrument.recorder.RecordingWriter", _FullDisk)
    chosen = {"levimass_settings": 1, "folder": str(tmp_path / "data"), "duration_s": 0.12}
    (tmp_path / "settings.json").write_text(json.dumps(chosen))
    window = open_window(tmp_path, rigs.quick_bench)
    qtbot.addWidget(window)
    try:
        window.show()
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)
        button = window.panels.banner.save_elsewhere
        qtbot.waitUntil(lambda: window.panels.controls.arm.isEnabled() and window.rig.channels != (), timeout=WAIT_MS)
        assert not button.isVisible()
        qtbot.keyClick(window, Qt.Key.Key_Space)
        qtbot.waitUntil(lambda: window.panels.banner.word != "READY", timeout=WAIT_MS)
        qtbot.waitUntil(lambda: button.isVisible() and len(window.bench.session.entries) == 1, timeout=WAIT_MS)
        assert button.text() == "Save 1 shot elsewhere …"
        assert "memory" in window.panels.banner.detail
        window.close()
        assert window.isVisible()  # the first time it only warns
        assert "only in memory" in window.panels.work.notices.words

        monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path / "none"))
        button.click()
        qtbot.waitUntil(lambda: "does not exist" in window.panels.work.notices.words, timeout=WAIT_MS)
        assert button.isVisible()

        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(elsewhere))
        qtbot.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
        qtbot.waitUntil(lambda: not button.isVisible(), timeout=WAIT_MS)
        (meta,) = elsewhere.glob("*.sigmf-meta")
        qtbot.waitUntil(lambda: "1 shot saved to" in window.panels.work.notices.words, timeout=WAIT_MS)
        assert window.bench.session.entries[0].path == str(meta)
        assert open_recording(meta).samples > 0
    finally:
        window._warned = True
        window.close()
    assert not window.isVisible()

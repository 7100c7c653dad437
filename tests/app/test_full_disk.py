"""A disk that fills up while the window captures: recordings, session and settings all lie on it."""

import json
import math
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.session import workbench
from app.window.main_window import MainWindow, open_window
from instrument.capture.acquisition import State
from instrument.files.recording_file import data_hash, open_recording
from tests.app import rigs
from tests.app.on_screen import read_entries
from tests.small_disk import PAGE_BYTES, fill, free_bytes, make_room, small_disk

WAIT_MS = 60_000


def _opened(qtbot: QtBot, disk: Path) -> MainWindow:
    (disk / "data").mkdir()
    (disk / "home").mkdir()
    chosen = {"levimass_settings": 1, "folder": str(disk / "data"), "duration_s": 0.06}
    (disk / "home" / "settings.json").write_text(json.dumps(chosen))
    window = open_window(disk / "home", rigs.still_bench, apart=False)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: window.panels.controls.arm.isEnabled() and window.rig.channels != (), timeout=WAIT_MS)
    return window


def _take(qtbot: QtBot, window: MainWindow, number: int) -> None:
    """Take a shot that the operator triggers: whether anything moved is not the matter here."""
    window.rig.arm()
    qtbot.waitUntil(lambda: window.rig.latest().state is State.ARMED, timeout=WAIT_MS)
    window.rig.trigger_now()
    qtbot.waitUntil(lambda: len(read_entries(window.workbench.session)) == number, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: window.rig.latest().state in (State.IDLE, State.FAULT), timeout=WAIT_MS)


def _said(window: MainWindow) -> list[str]:
    return [notice.words for _, notice in window.panels.work.notices.history]


def _on_disk(disk: Path) -> list[tuple[str, str, str]]:
    """Return name, recording and note of each shot in the session's file."""
    document = json.loads((disk / "home" / "session.json").read_text())
    return [(shot["name"], Path(shot["path"]).name, shot["note"]) for shot in document["shots"]]


_LEFT = [
    pytest.param("nothing", marks=pytest.mark.slow),
    pytest.param("some samples", marks=pytest.mark.slow),
    pytest.param("all but the last samples", marks=pytest.mark.slow),
    "no metadata",
]


@pytest.mark.parametrize("left", _LEFT)
def test_a_disk_that_fills_up_during_a_shot_loses_nothing(
    qtbot: QtBot, tmp_path: Path, left: str, warm_kernels: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workbench, "SAVE_AGAIN_S", 0.2)
    with small_disk(tmp_path / "disk", 100) as disk:
        window = _opened(qtbot, disk)
        data, banner = disk / "data", window.panels.banner
        try:
            _take(qtbot, window, 1)
            pages = math.ceil((data / "shot-0001.sigmf-data").stat().st_size / PAGE_BYTES)
            room = {"nothing": 0, "some samples": 9, "all but the last samples": pages, "no metadata": pages + 1}
            window.rig.arm()
            qtbot.waitUntil(lambda: window.rig.latest().state is State.ARMED, timeout=WAIT_MS)
            fill(disk, room[left] * PAGE_BYTES)  # the first metadata take a page
            window.rig.trigger_now()
            qtbot.waitUntil(lambda: window.rig.latest().unsaved == ("shot-0002",), timeout=WAIT_MS)
            qtbot.waitUntil(lambda: banner.word.text() == "FAULT", timeout=WAIT_MS)
            assert free_bytes(disk) < 3 * PAGE_BYTES
            said = banner.detail.text()
            assert str(data) in said and "No space left on device. In memory only: shot-0002" in said
            # whatever came to disk of it is not taken for a whole recording, and the one before is untouched
            assert data_hash(data / "shot-0001").agrees and open_recording(data / "shot-0001.sigmf-meta").flags == ()
            part = data / "shot-0002.sigmf-meta"
            if part.exists() and part.with_suffix(".sigmf-data").stat().st_size:
                assert "interrupted" in open_recording(part).flags
            assert part.exists() == (left != "nothing")
            entry = window.workbench.session.entries[0]
            window.workbench.set_note(entry.number, "the disk is full")
            where = f"the session could not be saved: {disk / 'home' / 'session.json'}"
            qtbot.waitUntil(lambda: any(words.startswith(where) for words in _said(window)), timeout=WAIT_MS)
            assert [note for *_, note in _on_disk(disk)] == [""]
            window.close()
            warned = [words for words in _said(window) if words.endswith("Close again to quit anyway")]
            assert window.isVisible() and "only in memory" in warned[0] and "would be lost" in warned[0]

            make_room(disk)  # and without another change of anything
            qtbot.waitUntil(lambda: "The session is saved again" in _said(window), timeout=WAIT_MS)
            assert _on_disk(disk) == [("shot-0001", "shot-0001.sigmf-meta", "the disk is full")]
            _take(qtbot, window, 3)
            window.rig_presenter.save_elsewhere_wanted.emit(data)
            qtbot.waitUntil(lambda: window.rig.latest().unsaved == (), timeout=WAIT_MS)
            qtbot.waitUntil(lambda: window.workbench.session.entries[1].path is not None, timeout=WAIT_MS)
        finally:
            window.close()
            window.close()
        found = sorted(data.glob("*.sigmf-meta"))
        assert len(found) == 3 == len(list(data.glob("*.sigmf-data")))
        samples = {
            open_recording(meta).samples
            for meta in found
            if open_recording(meta).flags == () and data_hash(meta).agrees
        }
        assert len(samples) == 1
        assert {recording for _, recording, _ in _on_disk(disk)} == {meta.name for meta in found}
        assert not list(disk.rglob("*.new"))


def test_a_session_that_could_not_be_saved_is_saved_as_the_window_closes(qtbot: QtBot, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 100) as disk:
        window = _opened(qtbot, disk)
        try:
            _take(qtbot, window, 1)
            fill(disk)
            window.workbench.set_note(window.workbench.session.entries[0].number, "a note")
            qtbot.waitUntil(lambda: bool(window.workbench.session.problem), timeout=WAIT_MS)
            window.close()
            assert window.isVisible()
            make_room(disk)
        finally:
            window.close()
        assert not window.isVisible()
        assert [note for *_, note in _on_disk(disk)] == ["a note"]

"""What an operator did or took is kept: typed numbers, notes, unanalysed shots, the keyboard's place."""

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QLocale
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from analysis.recording import Channel, Recording, Role, Setup
from analysis.shot import AnalysisSettings
from app.session.session import Session
from app.session.settings import FIELDS, Settings
from app.session.workbench import Workbench
from app.window.layout import Layout
from app.window.panels.settings_sheet import SettingsSheet
from app.window.panels.side_sheet import SideSheet
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter
from app.window.theme import LIGHT, Theme
from app.words.typed_number import typed_number
from instrument.digitizer import CaptureSettings
from instrument.open_recording import open_recording
from instrument.recording_file import write_recording
from instrument.snapshot import FinishedShot

WAIT_MS = 30_000


@pytest.mark.parametrize("locale", ["de_DE", "en_US", "fr_FR", "C"])
@pytest.mark.parametrize("typed", ["17.85", "17,85"])
def test_a_typed_mass_is_the_same_in_every_country(qtbot: QtBot, locale: str, typed: str) -> None:
    before = QLocale()
    QLocale.setDefault(QLocale(locale))
    try:
        sheet = SettingsSheet(LIGHT)
        qtbot.addWidget(sheet)
        sheet.offer(FIELDS)
        sheet.show_values(Settings().values())
        taken: list[dict[str, object]] = []
        sheet.applied.connect(taken.append)
        editor = sheet._editors["moving_mass_kg"]
        assert isinstance(editor, QLineEdit)
        editor.clear()
        qtbot.keyClicks(editor, typed)
        sheet.apply()
        assert taken and taken[0]["moving_mass_kg"] == pytest.approx(17.85e-3, rel=1e-12)
    finally:
        QLocale.setDefault(before)


@pytest.mark.parametrize("typed", ["1.785,3", "1,785.3", "1.785.3", "1_785", "nan", "inf", "", "17.85 g"])
def test_what_may_mean_two_things_is_refused(typed: str) -> None:
    with pytest.raises(ValueError, match=r"two ways|not a number"):
        typed_number(typed)


def test_a_sheet_forgets_a_button_that_was_deleted(qtbot: QtBot) -> None:
    main = QWidget()
    qtbot.addWidget(main)
    button, field = QPushButton("Add", main), QLineEdit()
    sheet = SideSheet("sheet", main)
    field.setParent(sheet)
    main.show()
    main.activateWindow()
    qtbot.waitUntil(main.isActiveWindow, timeout=WAIT_MS)
    button.setFocus()
    sheet.open_at(field)
    button.deleteLater()
    QApplication.sendPostedEvents(None, 0)
    QApplication.processEvents()
    sheet.hide()
    assert sheet.isHidden()


def _recording(folder: Path) -> Path:
    counts = np.zeros((64, 1), np.int16)
    channel = Channel(Role.MEASUREMENT, 1e-3)
    return write_recording(Recording("shot-0001", counts, 1e6, (channel,), Setup(17.85e-3)), folder / "shot-0001")


def test_a_note_reaches_the_recording(qtbot: QtBot, tmp_path: Path) -> None:
    meta = _recording(tmp_path)
    workbench = Workbench(Session(), AnalysisSettings)
    try:
        entry = workbench.add_unanalysed(meta, "stopped", "shot-0001")
        workbench.set_note(entry.number, "the block wobbled")
        qtbot.waitUntil(lambda: open_recording(meta).note == "the block wobbled", timeout=WAIT_MS)
        assert workbench.poll() == []
    finally:
        workbench.close()


def test_a_shot_whose_analysis_was_stopped_is_listed_and_analysed_in_its_place(qtbot: QtBot, tmp_path: Path) -> None:
    theme = Theme("light")
    panels = Layout(theme)
    qtbot.addWidget(panels)
    workbench = Workbench(Session(tmp_path / "session.json"), AnalysisSettings)
    try:
        selection = SelectionPresenter(workbench, panels, panels)
        presenter = SessionPresenter(workbench, panels, selection, panels)
        meta = _recording(tmp_path)
        stopped = FinishedShot(1, "shot-0001", meta, CaptureSettings(1e6, 64, 0), None, "the analysis was stopped")
        presenter.take(stopped, stay=False)
        (entry,) = workbench.session.entries
        assert entry.path == str(meta) and entry.shot is not None and "Ctrl+R" in (entry.shot.problem or "")
        assert Session.reopen(tmp_path / "session.json").entries[0].path == str(meta)
        before = entry.shot
        presenter.reanalyse_selected()
        qtbot.waitUntil(lambda: bool(workbench.poll()), timeout=WAIT_MS)
        (entry,) = workbench.session.entries
        assert entry.shot is not before
    finally:
        workbench.close()

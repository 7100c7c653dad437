"""A file of another program is asked about once, then opened like any other."""

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtGui import QTextDocumentFragment
from pytestqt.qtbot import QtBot

from analysis.shot.recording import Role
from app.session.session import Session
from app.session.settings_store import SettingsStore
from app.session.workbench import Workbench
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.presenters.mapping import MappingPresenter
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter, is_unmapped
from instrument.files.motion_file import read_motion


def test_channels_are_asked_for_once_and_the_file_is_opened(qtbot: QtBot, tmp_path: Path) -> None:
    path = tmp_path / "beats &amp; light.csv"  # which is no markup
    time_s = np.arange(400) / 10e6
    rows = [f"{np.sin(17e6 * t):.5f},{np.cos(17e6 * t):.5f}" for t in time_s]
    path.write_text("one,two\n" + "\n".join(rows) + "\n")
    assert is_unmapped(path)
    store = SettingsStore(tmp_path / "settings.json")
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    panels.resize(1200, 800)
    panels.show()
    workbench = Workbench(Session(), store.analysis)
    opened: list[Path] = []
    workbench.open_paths = lambda paths: opened.extend(paths) or len(paths)  # type: ignore[method-assign,func-returns-value]
    try:
        presenter = MappingPresenter(workbench, store, panels, panels)
        session = SessionPresenter(workbench, store, panels, SelectionPresenter(workbench, panels, panels), panels)
        session.mapping_wanted.connect(presenter.ask)
        sheet = panels.mapping
        session.open_paths([path])
        assert opened == []

        def pulled(ready) -> bool:  # type: ignore[no-untyped-def]
            workbench.poll()
            presenter.refresh()
            return bool(ready())

        qtbot.waitUntil(lambda: pulled(sheet.isVisible), timeout=20_000)
        said = QTextDocumentFragment.fromHtml(sheet._file.text()).toPlainText()
        assert said.startswith("beats &amp; light.csv (") and "saved with the file" in said
        assert [sheet.boxes[role].currentData() for role in sheet.boxes] == ["one", "two", None]
        sheet.boxes[Role.REFERENCE].setCurrentIndex(sheet.boxes[Role.REFERENCE].findData("one"))
        sheet.apply()
        assert "two roles" in sheet.problem.text()
        sheet.boxes[Role.REFERENCE].setCurrentIndex(sheet.boxes[Role.REFERENCE].findData("two"))
        sheet.apply()
        qtbot.waitUntil(lambda: pulled(lambda: "rate" in sheet.problem.text()), timeout=20_000)
        assert is_unmapped(path)  # a mapping that does not work is not remembered
        sheet.edits["rate_hz"].setText("10")
        sheet.apply()
        qtbot.waitUntil(lambda: pulled(lambda: opened == [path]), timeout=20_000)
        assert not sheet.isVisible() and not is_unmapped(path)
    finally:
        workbench.close()


@pytest.mark.parametrize("header", ["x (mm)", "x"])
def test_a_displacement_is_opened_in_the_unit_of_its_header_or_the_one_chosen(
    header: str, qtbot: QtBot, tmp_path: Path
) -> None:
    path = tmp_path / "logger.csv"
    path.write_text(f"time (ms),{header}\n" + "\n".join(f"{0.1 * n:.1f},{0.5 * n:.1f}" for n in range(400)) + "\n")
    store = SettingsStore(tmp_path / "settings.json")
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    panels.resize(1200, 800)
    panels.show()
    workbench = Workbench(Session(), store.analysis)
    opened: list[Path] = []
    workbench.open_paths = lambda paths: opened.extend(paths) or len(paths)  # type: ignore[method-assign,func-returns-value]
    try:
        presenter = MappingPresenter(workbench, store, panels, panels)
        sheet = panels.mapping
        presenter.ask([path])

        def pulled(ready) -> bool:  # type: ignore[no-untyped-def]
            workbench.poll()
            presenter.refresh()
            return bool(ready())

        qtbot.waitUntil(lambda: pulled(sheet.isVisible), timeout=20_000)
        if header == "x":
            assert sheet.displacement.currentData() is None and sheet.boxes[Role.MEASUREMENT].isEnabled()
            sheet.displacement.setCurrentIndex(sheet.displacement.findData("x"))
            sheet.apply()
            assert "unit of the displacement is missing" in sheet.problem.text()
            sheet.unit.setCurrentIndex(sheet.unit.findData("mm"))
        assert (sheet.displacement.currentData(), sheet.unit.currentData()) == ("x", "mm")
        assert not sheet.boxes[Role.MEASUREMENT].isEnabled()
        sheet.apply()
        qtbot.waitUntil(lambda: pulled(lambda: opened == [path]), timeout=20_000)
        record = read_motion(path)
        assert record.displacement_m is not None
        np.testing.assert_allclose(record.displacement_m, 0.5e-3 * np.arange(400), rtol=1e-12)
        assert record.moving_mass_kg == store.settings.moving_mass_kg and not is_unmapped(path)
    finally:
        workbench.close()

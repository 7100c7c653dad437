"""A file of another program is asked about once, then opened like any other."""

from pathlib import Path

import numpy as np
from pytestqt.qtbot import QtBot

from analysis.shot.recording import Role
from app.session.choices import Choices
from app.session.session import Session
from app.session.workbench import Workbench
from app.window.layout import Layout
from app.window.presenters.mapping import MappingPresenter
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter, is_unmapped
from app.window.theme import Theme


def test_channels_are_asked_for_once_and_the_file_is_opened(qtbot: QtBot, tmp_path: Path) -> None:
    path = tmp_path / "beats.csv"
    time_s = np.arange(400) / 10e6
    rows = [f"{np.sin(17e6 * t):.5f},{np.cos(17e6 * t):.5f}" for t in time_s]
    path.write_text("one,two\n" + "\n".join(rows) + "\n")
    assert is_unmapped(path)
    choices = Choices(tmp_path / "settings.json")
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    panels.resize(1200, 800)
    panels.show()
    workbench = Workbench(Session(), choices.analysis)
    opened: list[Path] = []
    workbench.open_paths = lambda paths: opened.extend(paths) or len(paths)  # type: ignore[method-assign,func-returns-value]
    try:
        presenter = MappingPresenter(workbench, choices, panels)
        session = SessionPresenter(workbench, choices, panels, SelectionPresenter(workbench, panels, panels), panels)
        session.mapping_wanted.connect(presenter.ask)
        sheet = panels.mapping
        session.open_paths([path])
        assert opened == []

        def pulled(ready) -> bool:  # type: ignore[no-untyped-def]
            presenter.refresh()
            return bool(ready())

        qtbot.waitUntil(lambda: pulled(sheet.isVisible), timeout=20_000)
        assert [sheet.boxes[role].currentData() for role in sheet.boxes] == ["one", "two", None]
        sheet.boxes[Role.REFERENCE].setCurrentIndex(sheet.boxes[Role.REFERENCE].findData("one"))
        sheet.apply()
        assert "two things" in sheet.problem
        sheet.boxes[Role.REFERENCE].setCurrentIndex(sheet.boxes[Role.REFERENCE].findData("two"))
        sheet.apply()
        qtbot.waitUntil(lambda: pulled(lambda: "rate" in sheet.problem), timeout=20_000)
        assert is_unmapped(path)  # a mapping that does not work is not remembered
        sheet.edits["rate_hz"].setText("10")
        sheet.apply()
        qtbot.waitUntil(lambda: pulled(lambda: opened == [path]), timeout=20_000)
        assert not sheet.isVisible() and not is_unmapped(path)
    finally:
        workbench.close()

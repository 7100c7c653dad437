"""A file of another program is asked about once, then opened like any other."""

from pathlib import Path

import numpy as np
from pytestqt.qtbot import QtBot

from analysis.recording import Role
from app.choices import Choices
from app.layout import Layout
from app.mapping_desk import MappingDesk
from app.selection_desk import SelectionDesk
from app.session import Session
from app.session_desk import SessionDesk, is_unmapped
from app.theme import Theme
from app.workbench import Workbench


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
    bench = Workbench(Session(), choices.analysis)
    opened: list[Path] = []
    bench.open_paths = lambda paths: opened.extend(paths) or len(paths)  # type: ignore[method-assign,func-returns-value]
    try:
        desk = MappingDesk(bench, choices, panels)
        session = SessionDesk(bench, panels, SelectionDesk(bench, panels, panels), panels)
        session.mapping_wanted.connect(desk.ask)
        sheet = panels.mapping
        session.open_paths([path])
        assert opened == []

        def pulled(ready) -> bool:  # type: ignore[no-untyped-def]
            desk.show()
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
        bench.close()

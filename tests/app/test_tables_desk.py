"""Budget and paper follow the shot in front, and only while they are in front."""

import time

from pytestqt.qtbot import QtBot

from app.layout import Layout
from app.session import Session
from app.tables_desk import TablesDesk
from app.theme import Theme
from app.workbench import Workbench
from tests.analysis.shots import at_speed, shot_of


def test_budget_and_paper_pages_follow_the_shot_in_front(qtbot: QtBot) -> None:
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    bench = Workbench(Session(), lambda: shot_of().settings)
    try:
        first = bench.session.add(shot_of())
        second = bench.session.add(at_speed("b", 0.4, 0.97, 1e-4))
        shown = [first]
        desk = TablesDesk(bench, panels, lambda: shown[0])
        desk.show()
        assert panels.budget.table.topLevelItemCount() == 0
        panels.tabs.setCurrentIndex(Layout.BUDGET)
        desk.show()
        before = panels.budget.table.topLevelItem(0)
        value = before.text(1)
        desk.show()
        assert panels.budget.table.topLevelItem(0) is before  # nothing is built again while nothing changed
        shown[0] = second
        desk.show()
        assert panels.budget.table.topLevelItem(0).text(1) != value
        panels.tabs.setCurrentIndex(Layout.PAPER)
        begun = time.perf_counter()
        desk.show()
        assert time.perf_counter() - begun < 0.5
        assert "computing" in panels.paper.words

        def there() -> bool:
            desk.show()
            return panels.paper.table.topLevelItemCount() > 0

        qtbot.waitUntil(there, timeout=60_000)
        assert "remain open" in panels.paper.words and "Recording: b" in panels.paper.words
    finally:
        bench.close()

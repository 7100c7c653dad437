"""Budget and paper follow the shot in front, and only while they are in front."""

import time

from pytestqt.qtbot import QtBot

from app.session.session import Session
from app.session.workbench import Workbench
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.presenters.selection import TablesPresenter
from tests.analysis.shots import at_speed, shot_of


def test_budget_and_paper_pages_follow_the_shot_in_front(qtbot: QtBot) -> None:
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    workbench = Workbench(Session(), lambda: shot_of().settings)
    try:
        first = workbench.session.add(shot_of())
        second = workbench.session.add(at_speed("b", 0.4, 0.97, 1e-4))
        shown = [first]
        presenter = TablesPresenter(workbench, panels, lambda: shown[0], panels)
        presenter.refresh()
        assert panels.budget.table.topLevelItemCount() == 0
        panels.tabs.setCurrentIndex(Layout.BUDGET)
        presenter.refresh()
        before = panels.budget.table.topLevelItem(0)
        value = before.text(1)
        presenter.refresh()
        assert panels.budget.table.topLevelItem(0) is before  # nothing is built again while nothing changed
        shown[0] = second
        presenter.refresh()
        assert panels.budget.table.topLevelItem(0).text(1) != value
        panels.tabs.setCurrentIndex(Layout.PAPER)
        begun = time.perf_counter()
        presenter.refresh()
        assert time.perf_counter() - begun < 0.5
        assert "computing" in panels.paper.said.text()

        def there() -> bool:
            assert workbench.poll() == []
            presenter.refresh()
            return panels.paper.table.topLevelItemCount() > 0

        qtbot.waitUntil(there, timeout=60_000)
        assert "are unresolved" in panels.paper.said.text() and "Recording: b" in panels.paper.said.text()
    finally:
        workbench.close()

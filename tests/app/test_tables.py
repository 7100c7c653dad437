"""The budget and the paper as tables of the window."""

import csv
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from analysis.paper.paper import reproduce
from analysis.uncertainty.gum_budget import budget
from app.report.exports import export
from app.window.controls.theme import DARK
from app.window.panels.tables import BudgetPanel, PaperPanel
from tests.analysis.shots import at_speed, shot_of


def test_budget_panel_shows_every_result_with_its_sources(qtbot: QtBot) -> None:
    panel = BudgetPanel()
    qtbot.addWidget(panel)
    assert panel.table.topLevelItemCount() == 0
    shot = shot_of()
    panel.show_shot(shot)
    found = budget(shot)
    assert panel.table.topLevelItemCount() == len(found.quantities)
    for index, quantity in enumerate(found.quantities):
        item = panel.table.topLevelItem(index)
        assert item.text(0) == quantity.words and item.childCount() == len(quantity.rows)
        assert item.child(0).text(0) == quantity.rows[0].source
        assert item.child(0).toolTip(0) == (quantity.rows[0].how or quantity.rows[0].source)
    panel.table.topLevelItem(2).setExpanded(True)
    panel.show_shot(shot)
    assert panel.table.topLevelItem(2).isExpanded() and not panel.table.topLevelItem(1).isExpanded()
    panel.show_shot(shot_of(impact=None, fit=None, setup=None, problem="no impact in it"))
    assert panel.table.topLevelItemCount() == 0


def test_the_first_column_takes_what_is_left_but_is_never_cut(qtbot: QtBot) -> None:
    panel = BudgetPanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_shot(shot_of())
    table = panel.table
    for width in (1600, 300, 1600):
        panel.resize(width, 500)
        others = sum(table.columnWidth(column) for column in range(1, table.columnCount()))
        assert table.columnWidth(0) == max(table.viewport().width() - others, table.sizeHintForColumn(0)) > 0


def test_paper_panel_shows_every_row(qtbot: QtBot) -> None:
    result = reproduce(shot_of())
    panel = PaperPanel()
    qtbot.addWidget(panel)
    panel.show_reproduction(result)
    head = panel.table.header()
    order = [panel.table.headerItem().text(head.logicalIndex(place)) for place in range(head.count())]
    assert order[:3] == ["number", "difference", "paper"]  # in view also on a narrow page
    sections = [panel.table.topLevelItem(i) for i in range(panel.table.topLevelItemCount())]
    shown = [section.child(i) for section in sections for i in range(section.childCount())]
    assert len(shown) == len(result.rows)
    by_what = {item.text(0): item for item in shown}
    opened = next(item for what, item in by_what.items() if what.startswith("velocity after release (m/s)"))
    assert "open" in opened.text(6) and opened.foreground(6).color().name() != shown[0].foreground(6).color().name()
    assert opened.childCount() == 1 and "cause not found" in opened.child(0).text(0)
    panel.apply_colours(DARK)
    assert panel.table.topLevelItemCount() == len(sections)


def test_selected_lines_are_copied_as_text(qtbot: QtBot) -> None:
    panel = BudgetPanel()
    qtbot.addWidget(panel)
    panel.show_shot(shot_of())
    item = panel.table.topLevelItem(0)
    item.setExpanded(True)
    item.setSelected(True)
    item.child(0).setSelected(True)
    copied = panel.table.selected_text().split("\n")
    assert len(copied) == 2 and copied[0].startswith("velocity before touch\t") and copied[1].count("\t") == 6


def test_several_shots_are_exported_as_a_series(tmp_path: Path) -> None:
    written = export([at_speed("a", 0.2, 0.98, 1e-4), at_speed("b", 0.4, 0.97, 1e-4)], tmp_path)
    assert tmp_path / "series.csv" in written
    with open(tmp_path / "series.csv", newline="", encoding="utf-8") as file:
        rows = {row["quantity"]: row for row in csv.DictReader(file)}
    assert rows["cor_quasi_static"]["shots"] == "2"
    assert float(rows["cor_quasi_static"]["slope_per_m_per_s"]) == pytest.approx(-0.05, rel=1e-6)
    assert {path.name for path in export([shot_of()], tmp_path / "one")} == {"shots.csv", "budget.csv"}

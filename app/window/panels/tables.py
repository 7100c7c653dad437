"""BUDGET and PAPER pages: tables whose rows expand into sources of uncertainty or causes of a difference."""

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QAction, QBrush, QColor, QGuiApplication, QKeySequence, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QTreeWidget,
    QTreeWidgetItem,
    QTreeWidgetItemIterator,
    QWidget,
)

from analysis.paper import Reproduction, Status
from analysis.shot import Quantity, Shot, display_unit
from analysis.uncertainty import COVERAGE_FACTOR, BudgetRow, QuantityBudget, budget
from app.report import PAPER_SECTIONS, paper_cells, readable_unit
from app.window.controls.theme import Colours, Themed, Tone, sized
from app.window.controls.widgets import text_label, vertical
from app.words import DASH, cell, concise_text, localised_number, number, value_text


@dataclass(frozen=True, slots=True)
class Line:
    """A table row: cells, tooltip, child rows, colour of the last cell.  A single cell spans all columns."""

    cells: tuple[str, ...]
    hover: str = ""
    parts: tuple["Line", ...] = ()
    strong: bool = False
    colour: str | None = None


class TreeTable(QTreeWidget):
    """A table with expandable rows; the columns in ``right`` contain numbers and are aligned right."""

    def __init__(self, name: str, columns: Sequence[str], right: Sequence[int], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self.setColumnCount(len(columns))
        self.setHeaderLabels(list(columns))
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setAlternatingRowColors(True)
        self.setUniformRowHeights(True)
        self._right = tuple(right)
        header = self.header()  # the first column takes the remaining width, so that no column is out of view
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(4 * self.fontMetrics().horizontalAdvance("M"))
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        for column in self._right:
            self.headerItem().setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        copy = QAction("Copy", self)
        copy.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        copy.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        copy.triggered.connect(self.copy_selected)
        self.addAction(copy)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)

    def show_lines(self, lines: Sequence[Line]) -> None:
        """Show these rows; rows expanded before stay expanded."""
        open_before = {item.text(0) for item in self._top_items() if item.isExpanded()}
        self.clear()
        self.addTopLevelItems([self._item(line) for line in lines])
        for item in self._top_items():
            item.setExpanded(item.text(0) in open_before)
        walk = QTreeWidgetItemIterator(self)
        while (item := walk.value()) is not None:
            item.setFirstColumnSpanned(item.columnCount() == 1)
            walk += 1
        self.fit_columns()

    def fit_columns(self) -> None:
        for column in range(1, self.columnCount()):
            self.resizeColumnToContents(column)
        self._fit_first()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_first()

    def _fit_first(self) -> None:
        """Give the first column the remaining width, at least the width of its text."""
        others = sum(self.columnWidth(column) for column in range(1, self.columnCount()))
        needed = max(self.sizeHintForColumn(0), self.header().sectionSizeHint(0))
        mode = QHeaderView.ResizeMode
        self.header().setSectionResizeMode(
            0, mode.Stretch if others + needed <= self.viewport().width() else mode.ResizeToContents
        )

    @Slot()
    def copy_selected(self) -> None:
        QGuiApplication.clipboard().setText(self.selected_text())

    def selected_text(self) -> str:
        """Return the selected rows as tab-separated text, safe for spreadsheets."""
        lines = []
        walk = QTreeWidgetItemIterator(self, QTreeWidgetItemIterator.IteratorFlag.Selected)
        while (item := walk.value()) is not None:
            lines.append("\t".join(cell(item.text(column)) for column in range(self.columnCount())))
            walk += 1
        return "\n".join(lines)

    def _top_items(self) -> list[QTreeWidgetItem]:
        items = (self.topLevelItem(index) for index in range(self.topLevelItemCount()))
        return [item for item in items if item is not None]

    def _item(self, line: Line) -> QTreeWidgetItem:
        item = QTreeWidgetItem(list(line.cells))
        for column in range(len(line.cells)):
            item.setToolTip(column, line.hover or line.cells[column])
            if column in self._right:
                item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            if line.strong:
                item.setFont(column, sized(self.font(), 1.0, bold=True))
        if line.colour is not None:
            item.setForeground(len(line.cells) - 1, QBrush(QColor(line.colour)))
        item.addChildren([self._item(part) for part in line.parts])
        return item


BUDGET_COLUMNS = (
    "result / source",
    "value / u(x)",
    "unit",
    "A / type",
    "B / sensitivity",
    "combined / part",
    "expanded / share",
)
STATED = "combined standard uncertainty"


class BudgetPanel(QWidget):
    """The BUDGET page: uncertainty budget of one shot; other selected shots give the repeatability."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = vertical(self, (6, 6, 6, 6))
        self._say = text_label("", self, faint=True, wrap=True)
        self.table = TreeTable("Uncertainty budget", BUDGET_COLUMNS, (1, 3, 4, 5, 6), self)
        column.addWidget(self._say)
        column.addWidget(self.table, 1)
        self.show_shot(None)

    def show_shot(self, shot: Shot | None, others: Sequence[Shot] = ()) -> None:
        """Show a shot's budget, or say why there is none."""
        found = None if shot is None else budget(shot, others=others)
        if found is None or not found.quantities:
            self._say.setText("No shot yet." if shot is None else f"No budget: {shot.problem or 'no impact was read'}.")
            self.table.show_lines([])
            return
        self._say.setText(
            f"Standard uncertainties; expanded with k = {number(COVERAGE_FACTOR)} (about 95 %). Type A from this "
            "measurement's own scatter, type B stated. Expand a result to see its sources."
            + (" Repeatability is that of the selected shots." if others else "")
        )
        self.table.show_lines([_quantity_line(quantity) for quantity in found.quantities])


def _quantity_line(q: QuantityBudget) -> Line:
    factor, unit = display_unit(q.unit)
    parts = (number(factor * part, 2) for part in (q.std_a, q.std_b, q.std, q.expanded))
    below = tuple(_source_line(row, q, factor) for row in q.rows)
    return Line((q.words, value_text(q.quantity, factor), unit, *parts), f"{q.words}: {STATED}", below, True)


def _source_line(row: BudgetRow, q: QuantityBudget, factor: float) -> Line:
    share = (row.contribution / q.std) ** 2 if q.std > 0.0 else 0.0
    known = row.std is not None
    cells = (
        row.source,
        number(row.std, 3),
        "" if row.unit == "1" else row.unit,
        row.kind,
        number(factor * row.sensitivity, 3),
        number(factor * row.contribution, 2) if known else DASH,
        f"{number(100.0 * share, 2)} %" if known and share >= 1e-4 else "0 %" if known else DASH,
    )
    return Line(cells, row.how)


PAPER_COLUMNS = ("number", "paper", "as printed", "simulated", "recomputed", "recording", "difference")
RECORDED = PAPER_COLUMNS.index("recording") - 1
_TONES = {Status.AGREES: Tone.GOOD, Status.TRACED: Tone.GOOD, Status.OPEN: Tone.BAD}


class PaperPanel(Themed, QWidget):
    """The PAPER page: the comparison with the paper's numbers."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._result: Reproduction | None = None
        column = vertical(self, (6, 6, 6, 6))
        self.said = text_label("", self, wrap=True)
        self.table = TreeTable("The paper, reproduced and audited", PAPER_COLUMNS, (1, 2, 3, 4, 5), self)
        self.table.header().moveSection(PAPER_COLUMNS.index("difference"), 1)  # visible even on a narrow page
        column.addWidget(self.said)
        column.addWidget(self.table, 1)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        if self._result is not None:
            self.show_reproduction(self._result)

    def show_reproduction(self, result: Reproduction) -> None:
        """Show the comparison, with an expanded row for each section."""
        self._result = result
        count = {status: sum(row.status is status for row in result.rows) for status in Status}
        recording = f" Recording: {result.recording}." if result.recording else ""
        self.said.setText(
            f"{result.authors}: {result.title}. {count[Status.AGREES]} numbers agree as printed, "
            f"{count[Status.TRACED]} differences are explained, {count[Status.OPEN]} are unresolved.{recording}"
        )
        lines = []
        for section, words in PAPER_SECTIONS.items():
            parts = []
            for row in (row for row in result.rows if row.section == section):
                texts = paper_cells(row)
                shown = [localised_number(text) if "." in text and not text.isalpha() else text for text in texts[1:]]
                if isinstance(row.recorded, Quantity):
                    shown[RECORDED] = concise_text(row.recorded, readable_unit(row)[0])
                trace = (Line((row.traced_to,)),) if row.traced_to else ()
                tone = _TONES.get(row.status)
                colour = self.colours.signs[tone] if tone is not None else None
                parts.append(Line((texts[0], *shown), row.traced_to, trace, colour=colour))
            lines.append(Line((words,), "", tuple(parts), True))
        self.table.show_lines(lines)
        self.table.expandToDepth(0)
        self.table.fit_columns()

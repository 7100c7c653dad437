"""A table whose rows unfold into parts; selected rows can be copied as text."""

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

from app.window.theme import sized
from app.words import cell


@dataclass(frozen=True, slots=True)
class Line:
    """A row: cells, hover, parts; ``colour`` is that of the last cell."""

    cells: tuple[str, ...]
    hover: str = ""
    parts: tuple["Line", ...] = ()
    strong: bool = False
    colour: str | None = None


class TreeTable(QTreeWidget):
    """The table; columns in ``right`` hold numbers and are aligned right."""

    def __init__(self, name: str, columns: Sequence[str], right: Sequence[int], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self.setColumnCount(len(columns))
        self.setHeaderLabels(list(columns))
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setAlternatingRowColors(True)
        self.setUniformRowHeights(True)
        self._right = tuple(right)
        header = self.header()  # the first column takes what the others leave, so that nothing lies beyond the edge
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
        """Show these rows; one that was unfolded stays so."""
        open_before = {item.text(0) for item in self._top_items() if item.isExpanded()}
        self.clear()
        self.addTopLevelItems([self._item(line) for line in lines])
        for item in self._top_items():
            item.setExpanded(item.text(0) in open_before)
        self.fit_columns()

    def fit_columns(self) -> None:
        """Fit the columns except the first to their widest text."""
        for column in range(1, self.columnCount()):
            self.resizeColumnToContents(column)
        self._fit_first()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_first()

    def _fit_first(self) -> None:
        """Give the first column the remaining width, at least that of its text."""
        others = sum(self.columnWidth(column) for column in range(1, self.columnCount()))
        needed = max(self.sizeHintForColumn(0), self.header().sectionSizeHint(0))
        mode = QHeaderView.ResizeMode
        self.header().setSectionResizeMode(
            0, mode.Stretch if others + needed <= self.viewport().width() else mode.ResizeToContents
        )

    @Slot()
    def copy_selected(self) -> None:
        """Copy the selected rows to the clipboard."""
        QGuiApplication.clipboard().setText(self.selected_text())

    def selected_text(self) -> str:
        """Return the selected rows as text for a spreadsheet, cells separated by tabs."""
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

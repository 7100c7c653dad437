"""The table of shots with its buttons, filter, grouping and choice of columns."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QItemSelection, QItemSelectionModel, QModelIndex, QPersistentModelIndex, Qt, Signal, Slot
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QMenu,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from app.session import Entry, Session
from app.window.controls.commands import with_keys
from app.window.controls.widgets import added, combo_box, heading_label, line_edit, push_button, vertical
from app.window.panels.session_model import FLAGS, GROUPS, NOTE, VERDICT, SessionModel, TableOrder


class _ElideRight(QStyledItemDelegate):
    """Shortens the text of cells at its end; the table itself shortens in the middle, for names."""

    def initStyleOption(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> None:
        super().initStyleOption(option, index)
        option.textElideMode = Qt.TextElideMode.ElideRight  # type: ignore[attr-defined]


BUTTONS = {  # action of the command -> (label, tooltip)
    "open_recordings": ("Open …", "Open recordings; or drop them on the window"),
    "export:export": ("Export …", "CSV of the selected shots, or of all: a motion file each, and shots.csv"),
    "export:report": ("Report …", "A printable HTML report on the selected shots, or on all"),
    "reanalyse_selected": ("Re-analyse", "Analyse the selected shots again, as copies, with the present settings"),
    "remove_selected": ("Remove", "Remove the selected shots from the list; recordings stay on disk"),
    "undo": ("Undo", "Undo the last note, removal or change of the model"),
}


class SessionTable(QFrame):
    """The table of shots with its buttons."""

    selected = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        column = vertical(self, (6, 2, 6, 2), 2)
        bar = QHBoxLayout()
        self._count = added(bar, heading_label("SHOTS", self))
        bar.addStretch(1)
        self._can_undo = False
        self._numbers: list[int] = []
        self.hidden: list[int] = []  # selected shots hidden by the filter
        self.buttons = {
            action: push_button(words, hover, self, command=action) for action, (words, hover) in BUTTONS.items()
        }
        for button in self.buttons.values():
            bar.addWidget(button)
        self._add_order(bar)
        column.addLayout(bar)
        self._make_table()
        column.addWidget(self.table, 1)
        self.filter.returnPressed.connect(self.table.setFocus)  # so that the space key arms again
        self.table.selectionModel().selectionChanged.connect(self._changed)
        self._enable()

    def _make_table(self) -> None:
        """Make the table, with columns as wide as their usual content."""
        self.model = SessionModel(self)
        self.table = QTableView(self)
        self.table.setModel(self.model)
        self.table.setAccessibleName("Shots of the session")
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.table.setAlternatingRowColors(True)
        self.table.setShowGrid(False)
        self.table.setWordWrap(False)
        self.table.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        for text in (VERDICT, FLAGS, NOTE):
            self.table.setItemDelegateForColumn(text, _ElideRight(self.table))
        self.table.setMinimumHeight(int(4.2 * self.fontMetrics().height()))
        self.table.setTabKeyNavigation(False)
        self.table.verticalHeader().hide()
        self.table.verticalHeader().setDefaultSectionSize(int(1.9 * self.fontMetrics().height()))
        self.table.setEditTriggers(
            QAbstractItemView.EditTrigger.DoubleClicked | QAbstractItemView.EditTrigger.EditKeyPressed
        )
        header = self.table.horizontalHeader()
        header.setHighlightSections(False)
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        letter = self.fontMetrics().horizontalAdvance("0")
        for index, made in enumerate(self.model.columns):
            head = header.fontMetrics().horizontalAdvance(f"{made.head}00")
            self.table.setColumnWidth(index, max(int(letter * made.letters), head))
            self.table.setColumnHidden(index, made.hidden)
        header.setStretchLastSection(True)
        header.setSectionsClickable(True)
        header.setSortIndicatorClearable(True)
        header.setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        header.sortIndicatorChanged.connect(self._sort_by)
        header.setToolTip(
            "In brackets: the combined standard uncertainty of the last digits.\n"
            "Click to sort by this column, click again to reverse, a third time for the order taken"
        )

    def _add_order(self, bar: QHBoxLayout) -> None:
        """Add the filter, the grouping and the choice of columns."""
        hover = "Show only shots with these words in name, time, verdict, flags or note"
        self.filter = line_edit("Filter words", with_keys(hover, "filter_shots"), self, "filter")
        self.filter.setMaximumWidth(14 * self.fontMetrics().horizontalAdvance("n"))
        hover = "Group the shots by this; series: names that differ only in their number"
        groups = [("no groups", ""), *((f"by {words}", name) for name, (words, _) in GROUPS.items())]
        self.group = combo_box("How the shots are grouped", hover, self, groups)
        self.group.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.group.setMinimumContentsLength(8)
        self.columns = push_button("Columns …", "Choose which columns are shown", self, command="choose_columns")
        self.filter.textChanged.connect(self._arrange)
        self.group.currentIndexChanged.connect(self._arrange)
        for place, widget in enumerate((self.filter, self.group, self.columns), 1):
            bar.insertWidget(place, widget)

    @property
    def shown(self) -> list[int]:
        """Get the numbers of the shots shown, in the order of the rows."""
        return [row.number for row in self.model.rows if isinstance(row, Entry)]

    @Slot()
    def _arrange(self) -> None:
        order = replace(self.model.order, words=self.filter.text(), group=str(self.group.currentData()))
        self._reorder(order)

    @Slot(int, Qt.SortOrder)
    def _sort_by(self, column: int, way: Qt.SortOrder) -> None:
        """Sort by a column; -1: in the order taken."""
        self.table.horizontalHeader().setSortIndicatorShown(column >= 0)
        falling = way is Qt.SortOrder.DescendingOrder
        self._reorder(replace(self.model.order, column=column if column >= 0 else None, falling=falling))

    def _reorder(self, order: TableOrder) -> None:
        self._keeping_selection(lambda: self.model.arrange(order))
        self._changed()

    def _keeping_selection(self, change: Callable[[], None]) -> None:
        """Change the rows but keep the selection; let group headings span all columns."""
        before, rows = self._numbers, self.model.identities
        change()
        if len(rows) and rows != self.model.identities[: len(rows)] and not self._selected_numbers():
            self.select([number for number in before if number in self.shown])
        self._selected_again(before)
        self.table.clearSpans()
        for row, entry in enumerate(self.model.rows):
            if not isinstance(entry, Entry):
                self.table.setSpan(row, 0, 1, len(self.model.columns))

    def _selected_again(self, before: list[int]) -> None:
        """Store a selection that the filter hides, and restore it once its shots are visible again."""
        now, there = self._selected_numbers(), {entry.number for entry in self.model.entries}
        if before and not now:
            self.hidden = [number for number in before if number in there]
        elif now:
            self.hidden = []
        seen = [number for number in self.hidden if number in self.shown]
        if seen and not now:
            self.hidden = []
            self.select(seen)

    @Slot()
    def choose_columns(self) -> None:
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for place, column in enumerate(self.model.columns[1:], 1):  # the column with the number is always shown
            action = menu.addAction(column.head)
            action.setCheckable(True)
            action.setChecked(not self.table.isColumnHidden(place))
            action.toggled.connect(partial(self.show_column, place))
        menu.popup(self.columns.mapToGlobal(self.columns.rect().bottomLeft()))

    def show_column(self, column: int, shown: bool) -> None:
        self.table.setColumnHidden(column, not shown)

    @property
    def numbers(self) -> list[int]:
        """Get the numbers of the selected shots, ascending."""
        return list(self._numbers)

    def _selected_numbers(self) -> list[int]:
        rows = sorted({index.row() for index in self.table.selectionModel().selectedRows()})
        found = (self.model.entry_at(row) for row in rows)
        return sorted(entry.number for entry in found if entry is not None)

    def show_session(self, session: Session) -> None:
        struck = {entry.number for entry in session.entries if not session.verdict_is_valid(entry)}
        self._keeping_selection(lambda: self.model.show_entries(session.entries, struck))
        self._numbers = self._selected_numbers()
        self._can_undo = session.can_undo
        count = len(session.entries)
        self._count.setText("SHOTS" if count == 0 else f"SHOTS  {count}")
        self._enable()

    def select(self, numbers: list[int]) -> None:
        """Select these shots and scroll to the last of them."""
        flag = QItemSelectionModel.SelectionFlag
        chosen, last = QItemSelection(), None
        if numbers and self.filter.text() and not set(numbers) & set(self.shown):
            self.filter.clear()  # the filter hides these shots
        for row, entry in enumerate(self.model.rows):
            if isinstance(entry, Entry) and entry.number in numbers:
                last = self.model.index(row, 0)
                chosen.select(last, last)
        model = self.table.selectionModel()
        if last is not None:
            model.setCurrentIndex(last, flag.NoUpdate)
            self.table.scrollTo(last)
        model.select(chosen, flag.ClearAndSelect | flag.Rows)  # in one step, because every change is drawn

    def as_text(self) -> str:
        """Return the selected rows, or all, as tab-separated text with headings."""
        shown = [n for n in range(len(self.model.columns)) if not self.table.isColumnHidden(n)]
        chosen = set(self._numbers) or set(self.shown)
        rows = [row for row, e in enumerate(self.model.rows) if isinstance(e, Entry) and e.number in chosen]
        lines = [[self.model.columns[n].head for n in shown]]
        whole = Qt.ItemDataRole.EditRole  # gives all flags, not only the most serious
        lines += [[str(self.model.index(row, n).data(whole)) for n in shown] for row in rows]
        return "".join("\t".join(" ".join(cell.split()) for cell in line) + "\n" for line in lines)

    @Slot()
    def filter_shots(self) -> None:
        self.filter.setFocus()
        self.filter.selectAll()

    @Slot()
    def edit_note(self) -> None:
        rows = self.table.selectionModel().selectedRows()
        if rows:
            self.table.edit(self.model.index(rows[-1].row(), NOTE))

    def _enable(self) -> None:
        some, any_selected = bool(self.model.entries), bool(self.numbers)
        can = {"export:export": some, "export:report": some, "undo": self._can_undo}
        can |= dict.fromkeys(("reanalyse_selected", "remove_selected"), any_selected)
        for action, on in can.items():
            self.buttons[action].setEnabled(on)

    @Slot()
    def _changed(self) -> None:
        self._numbers = self._selected_numbers()
        self._enable()
        self.selected.emit()

"""The shots of the session: select one to see it, several to compare; notes are edited in place."""

from PySide6.QtCore import (
    QItemSelection,
    QItemSelectionModel,
    Qt,
    Signal,
    Slot,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from app.session.session import Session
from app.window.panels.session_model import COLUMNS, NOTE, SessionModel


class SessionTable(QFrame):
    """The table with its buttons."""

    selected = Signal(list)
    export_wanted = Signal(list)
    report_wanted = Signal(list)
    remove_wanted = Signal(list)
    reanalyse_wanted = Signal(list)
    note_edited = Signal(int, str)
    undo_wanted = Signal()
    open_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 2, 6, 2)
        column.setSpacing(2)
        bar = QHBoxLayout()
        self._count = QLabel("SHOTS", self)
        self._count.setProperty("heading", True)
        bar.addWidget(self._count)
        bar.addStretch(1)
        self._buttons: list[QPushButton] = []
        self._can_undo = False
        self._numbers: list[int] = []
        for words, tip, slot in (
            ("Open …", "Open recordings; or drop them on the window  (Ctrl+O)", self._open),
            (
                "Export …",
                "CSV of the selected shots, or of all: a motion file each, and shots.csv  (Ctrl+E)",
                self._export,
            ),
            ("Report …", "One printable HTML file of the selected shots, or of all  (Ctrl+T)", self._report),
            (
                "Re-analyse",
                "Analyse the selected shots again, as copies, with the present settings  (Ctrl+R)",
                self._again,
            ),
            ("Remove", "Take the selected shots off the list; the recordings stay on disk  (Del)", self._remove),
            ("Undo", "Take back the last note or removal  (Ctrl+Z)", self._undo),
        ):
            button = QPushButton(words, self)
            button.setToolTip(tip)
            button.clicked.connect(slot)
            bar.addWidget(button)
            self._buttons.append(button)
        column.addLayout(bar)
        self.model = SessionModel(self)
        self.model.note_edited.connect(self._note)
        self.table = QTableView(self)
        self.table.setModel(self.model)
        self.table.setAccessibleName("Shots of the session")
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.table.setAlternatingRowColors(True)
        self.table.setShowGrid(False)
        self.table.setWordWrap(False)
        self.table.setTextElideMode(Qt.TextElideMode.ElideMiddle)
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
        for index, (_, letters) in enumerate(COLUMNS):
            self.table.setColumnWidth(index, int(letter * letters))
        header.setStretchLastSection(True)
        column.addWidget(self.table, 1)
        self.table.selectionModel().selectionChanged.connect(self._changed)
        self._enable()

    @property
    def numbers(self) -> list[int]:
        """Get the numbers of the selected shots, in order."""
        return list(self._numbers)

    def _selected_numbers(self) -> list[int]:
        rows = sorted({index.row() for index in self.table.selectionModel().selectedRows()})
        return [self.model.entries[row].number for row in rows if row < len(self.model.entries)]

    def show_session(self, session: Session) -> None:
        """Show the session's entries."""
        self.model.show_entries(session.entries)
        self._numbers = self._selected_numbers()
        self._can_undo = session.can_undo
        count = len(session.entries)
        self._count.setText("SHOTS" if count == 0 else f"SHOTS  {count}")
        self._enable()

    def select(self, numbers: list[int]) -> None:
        """Select these shots and show the last of them."""
        flag = QItemSelectionModel.SelectionFlag
        chosen, last = QItemSelection(), None
        for row, entry in enumerate(self.model.entries):
            if entry.number in numbers:
                last = self.model.index(row, 0)
                chosen.select(last, last)
        model = self.table.selectionModel()
        if last is not None:
            model.setCurrentIndex(last, flag.NoUpdate)
            self.table.scrollTo(last)
        model.select(chosen, flag.ClearAndSelect | flag.Rows)  # at once: every change of the selection is drawn

    def as_text(self) -> str:
        """Return the selected lines, or all, as the table shows them: a line of heads, cells parted by tabs."""
        rows = [row for row, e in enumerate(self.model.entries) if not self._numbers or e.number in self._numbers]
        lines = [[name for name, _ in COLUMNS]]
        lines += [[str(self.model.index(row, n).data()) for n in range(len(COLUMNS))] for row in rows]
        return "".join("\t".join(" ".join(cell.split()) for cell in line) + "\n" for line in lines)

    def edit_note(self) -> None:
        """Start editing the note of the shot in front."""
        rows = self.table.selectionModel().selectedRows()
        if rows:
            self.table.edit(self.model.index(rows[-1].row(), NOTE))

    def _enable(self) -> None:
        some, any_selected = bool(self.model.entries), bool(self.numbers)
        self._buttons[1].setEnabled(some)
        self._buttons[2].setEnabled(some)
        self._buttons[3].setEnabled(any_selected)
        self._buttons[4].setEnabled(any_selected)
        self._buttons[5].setEnabled(self._can_undo)

    @Slot()
    def _changed(self) -> None:
        self._numbers = self._selected_numbers()
        self._enable()
        self.selected.emit(self.numbers)

    @Slot(int, str)
    def _note(self, number: int, note: str) -> None:
        self.note_edited.emit(number, note)

    @Slot()
    def _open(self) -> None:
        self.open_wanted.emit()

    @Slot()
    def _export(self) -> None:
        self.export_wanted.emit(self.numbers)

    @Slot()
    def _report(self) -> None:
        self.report_wanted.emit(self.numbers)

    @Slot()
    def _again(self) -> None:
        self.reanalyse_wanted.emit(self.numbers)

    @Slot()
    def _remove(self) -> None:
        self.remove_wanted.emit(self.numbers)

    @Slot()
    def _undo(self) -> None:
        self.undo_wanted.emit()

"""The shots of the session: select one to see it, several to compare; notes are edited in place."""

from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QItemSelection,
    QItemSelectionModel,
    QModelIndex,
    QObject,
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

from analysis.quantity import NotSeen, Reading
from app.session import Entry, Session
from app.wording import DASH, concise_text, flag_words, how_text, value_text

COLUMNS = (
    ("#", 5),
    ("time", 9),
    ("name", 13),
    ("v in (m/s)", 18),
    ("v out (m/s)", 18),
    ("COR quasi-static", 19),
    ("COR kinetic", 14),
    ("F max (N)", 13),
    ("k_p (N/m)", 16),
    ("verdict", 24),
    ("flags", 12),
    ("note", 16),
)
NOTE = len(COLUMNS) - 1


def _reading(entry: Entry, column: int) -> Reading | None:
    shot = entry.shot
    if shot is None:
        return None
    if column == 8:
        if shot.fit is None or not shot.fit.converged:
            return NotSeen("no converged fit")
        return shot.fit.parameters.get("plate_stiffness_n_per_m")
    if shot.impact is None:
        return NotSeen(shot.problem or "no impact")
    impact = shot.impact
    return {
        3: impact.velocity_in_m_per_s,
        4: impact.velocity_out_m_per_s,
        5: impact.cor_quasi_static,
        6: impact.cor_kinetic.force_peaks,
        7: impact.force_peak_n,
    }[column]


class SessionModel(QAbstractTableModel):
    """The session as Qt's views want it; editing a note goes through ``note_edited``."""

    note_edited = Signal(int, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.entries: tuple[Entry, ...] = ()

    def show_entries(self, entries: tuple[Entry, ...]) -> None:
        """Show these; rows that only changed keep their place and selection."""
        if [e.number for e in entries] == [e.number for e in self.entries]:
            self.entries = entries
            if entries:
                self.dataChanged.emit(self.index(0, 0), self.index(len(entries) - 1, NOTE))
            return
        same = [e.number for e in entries[: len(self.entries)]] == [e.number for e in self.entries]
        if same:
            self.beginInsertRows(QModelIndex(), len(self.entries), len(entries) - 1)
            self.entries = entries
            self.endInsertRows()
            return
        self.beginResetModel()
        self.entries = entries
        self.endResetModel()

    def rowCount(self, parent: QModelIndex | None = None) -> int:
        """Return the number of shots."""
        return 0 if parent is not None and parent.isValid() else len(self.entries)

    def columnCount(self, parent: QModelIndex | None = None) -> int:
        """Return the number of columns."""
        return 0 if parent is not None and parent.isValid() else len(COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return a column's name."""
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return COLUMNS[section][0]
        if role == Qt.ItemDataRole.TextAlignmentRole:
            side = Qt.AlignmentFlag.AlignRight if 3 <= section <= 8 else Qt.AlignmentFlag.AlignLeft
            return side | Qt.AlignmentFlag.AlignVCenter
        return None

    def flags(self, index: QModelIndex) -> Qt.ItemFlag:
        """Let notes be edited."""
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsEditable if index.column() == NOTE else flags

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return what a cell says."""
        entry = self.entries[index.row()]
        column = index.column()
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole):
            return self._text(entry, column)
        if role == Qt.ItemDataRole.ToolTipRole:
            return self._hover(entry, column)
        if role == Qt.ItemDataRole.TextAlignmentRole and 3 <= column <= 8:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None

    def _text(self, entry: Entry, column: int) -> str:
        shot = entry.shot
        if column == 0:
            return f"{entry.number}" + (f" ({entry.copy_of})" if entry.copy_of is not None else "")
        if column == 1:
            return (shot.started_at or "")[11:19] if shot is not None and shot.started_at else DASH
        if column == 2:
            return entry.name
        if column == 9:
            if shot is None:
                return "reading …"
            return shot.problem or entry.verdict or DASH
        if column == 10:
            return ", ".join(shot.flags) if shot is not None and shot.flags else ""
        if column == NOTE:
            return entry.note
        return concise_text(_reading(entry, column))

    def _hover(self, entry: Entry, column: int) -> str | None:
        if 3 <= column <= 8:
            reading = _reading(entry, column)
            return how_text(COLUMNS[column][0], reading, value_text(reading))
        if column == 10 and entry.shot is not None:
            return "\n".join(flag_words(flag) for flag in entry.shot.flags) or None
        if column == 2:
            s = entry.settings
            copy = f"Shot {entry.copy_of} with other settings.\n" if entry.copy_of is not None else ""
            return f"{copy}{entry.path or 'not saved'}\nbandwidth {s.bandwidth_hz:g} Hz, model {s.model}"
        return self._text(entry, column) or None

    def setData(self, index: QModelIndex, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Pass an edited note on."""
        if role != Qt.ItemDataRole.EditRole or index.column() != NOTE:
            return False
        entry = self.entries[index.row()]
        if str(value) != entry.note:
            self.note_edited.emit(entry.number, str(value))
        return True


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
        column.setContentsMargins(8, 6, 8, 4)
        column.setSpacing(4)
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

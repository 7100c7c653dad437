"""The session as Qt's tables want it: a line a shot, a hover for every number, the note editable."""

from collections.abc import Collection
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, Qt, Signal
from PySide6.QtGui import QFont

from analysis.fitted.awaited_fit import awaits_fit
from analysis.shot.quantity import NotSeen, Quantity, Reading
from analysis.uncertainty.combined import stated
from app.session.session import Entry
from app.window.combined import COMBINED, NOISE_ONLY, CombinedOnce
from app.window.flag_tone import flag_line
from app.window.panels.number_rows import DRIVE, GROUPS, Row, chi2_of, mass_of
from app.window.panels.session_order import Order, ordered
from app.words.flag_words import by_weight, flag_name, flag_words, flags_in_short
from app.words.verdict import OUTDATED, verdict_in_short
from app.words.wording import DASH, concise_text, how_text, value_text

COLUMNS: tuple[tuple[str, int], ...] = (
    ("#", 9),
    ("time", 9),
    ("name", 16),
    ("v in (m/s)", 15),
    ("v out (m/s)", 15),
    ("COR quasi-static", 15),
    ("COR kinetic", 12),
    ("F max (N)", 13),
    ("k_p (N/m)", 13),
    ("verdict", 25),
    ("flags", 26),
    ("note", 9),
)
KEYS = {  # of the numbers in the budget, by column
    3: "velocity_in_m_per_s",
    4: "velocity_out_m_per_s",
    5: "cor_quasi_static",
    6: "cor_kinetic.force_peaks",
    7: "force_peak_n",
    8: "plate_stiffness_n_per_m",
}
VERDICT, FLAGS, NOTE = range(len(COLUMNS) - 3, len(COLUMNS))
FIRST_EXTRA = len(COLUMNS)  # columns that are hidden until they are chosen
_OF_PANEL = tuple(row for heading, rows in GROUPS if heading != DRIVE for row in rows)
EXTRA = (
    *(row for row in _OF_PANEL if row.key not in KEYS.values()),
    Row("χ²/ν", chi2_of, meaning="Of this shot's own fit."),
    Row("moving mass", mass_of, 1e3, "g", "As stated for the shot."),
)
COLUMNS = (*COLUMNS, *((f"{row.name} ({row.unit})" if row.unit else row.name, 14) for row in EXTRA))


def is_number(column: int) -> bool:
    """Return whether a column holds a number."""
    return 3 <= column <= 8 or column >= FIRST_EXTRA


def key_of(column: int) -> str:
    """Return a number's key in the budget, "" where it has none."""
    return EXTRA[column - FIRST_EXTRA].key if column >= FIRST_EXTRA else KEYS[column]


def scale_of(column: int) -> float:
    """Return by how much a number is scaled for its column."""
    return EXTRA[column - FIRST_EXTRA].scale if column >= FIRST_EXTRA else 1.0


def _reading(entry: Entry, column: int) -> Reading | None:
    shot = entry.shot
    if shot is None:
        return None
    if column >= FIRST_EXTRA:
        return EXTRA[column - FIRST_EXTRA].find(shot)
    if column == 8:
        if awaits_fit(shot):
            return NotSeen("the fit is still to come")
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


def _sorted_by(entry: Entry, column: int) -> float | str | None:
    """Return what a column sorts by: a number's value, a word as it is; None where there is nothing."""
    shot = entry.shot
    if is_number(column):
        reading = _reading(entry, column)
        return reading.value if isinstance(reading, Quantity) else None
    texts = {
        1: (shot.started_at or "") if shot is not None else "",
        2: entry.name,
        VERDICT: entry.verdict,
        FLAGS: ", ".join(by_weight(shot.flags)) if shot is not None else "",
        NOTE: entry.note,
    }
    return float(entry.number) if column == 0 else texts[column]


def _identity(row: Entry | str) -> int | str:
    return row.number if isinstance(row, Entry) else row


def _heading(words: str, column: int, role: int) -> Any:
    if role == Qt.ItemDataRole.DisplayRole:
        return words if column == 0 else ""
    if role == Qt.ItemDataRole.FontRole:
        font = QFont()
        font.setBold(True)
        return font
    return None


class SessionModel(QAbstractTableModel):
    """The session as Qt's views want it; editing a note goes through ``note_edited``."""

    note_edited = Signal(int, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.entries: tuple[Entry, ...] = ()  # all, in the order in which they were taken
        self.rows: tuple[Entry | str, ...] = ()  # as they stand, a heading before each group
        self.order = Order()
        self._struck: frozenset[int] = frozenset()
        self._combined = CombinedOnce()

    @property
    def identities(self) -> list[int | str]:
        """Get what each row is, whatever became of its shot."""
        return [_identity(row) for row in self.rows]

    def show_entries(self, entries: tuple[Entry, ...], struck: Collection[int] = ()) -> None:
        """Show these; rows that only changed keep their place and selection.

        ``struck`` are numbers of entries whose verdict no longer holds.
        """
        self.entries, self._struck = entries, frozenset(struck)
        self._combined.keep(entry.shot for entry in entries if entry.shot is not None)
        self._arrange()

    def arrange(self, order: Order) -> None:
        """Show the entries in another order."""
        self.order = order
        self._arrange()

    def _arrange(self) -> None:
        before, rows = self.identities, ordered(self.entries, self.order, _sorted_by, self._searched)
        after = list(map(_identity, rows))
        if after == before:
            self.rows = rows
            if rows:
                self.dataChanged.emit(self.index(0, 0), self.index(len(rows) - 1, len(COLUMNS) - 1))
        elif after[: len(before)] == before:
            self.beginInsertRows(QModelIndex(), len(before), len(rows) - 1)
            self.rows = rows
            self.endInsertRows()
        else:
            self.beginResetModel()
            self.rows = rows
            self.endResetModel()

    def entry_at(self, row: int) -> Entry | None:
        """Return the entry in a row; a heading is none."""
        found = self.rows[row] if row < len(self.rows) else None
        return found if isinstance(found, Entry) else None

    def _stated(self, entry: Entry, column: int) -> Reading | None:
        """Return a number with its combined standard uncertainty."""
        if entry.shot is None:
            return None
        return stated(_reading(entry, column), key_of(column), self._combined.of(entry.shot))

    def _searched(self, entry: Entry) -> str:
        flags = (
            " ".join(f"{flag_name(flag)} {flag_words(flag)}" for flag in entry.shot.flags)
            if entry.shot is not None
            else ""
        )
        return " ".join((*(self._text(entry, column) for column in (0, 1, 2, VERDICT, FLAGS, NOTE)), flags))

    def rowCount(self, parent: QModelIndex | None = None) -> int:
        """Return the number of rows, headings of groups among them."""
        return 0 if parent is not None and parent.isValid() else len(self.rows)

    def columnCount(self, parent: QModelIndex | None = None) -> int:
        """Return the number of columns."""
        return 0 if parent is not None and parent.isValid() else len(COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return a column's name."""
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return COLUMNS[section][0]
        if role == Qt.ItemDataRole.TextAlignmentRole:
            side = Qt.AlignmentFlag.AlignRight if is_number(section) else Qt.AlignmentFlag.AlignLeft
            return side | Qt.AlignmentFlag.AlignVCenter
        return None

    def flags(self, index: QModelIndex) -> Qt.ItemFlag:
        """Let notes be edited; a heading is only read."""
        if self.entry_at(index.row()) is None:
            return Qt.ItemFlag.ItemIsEnabled
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsEditable if index.column() == NOTE else flags

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return what a cell says."""
        entry, column = self.rows[index.row()], index.column()
        if isinstance(entry, str):
            return _heading(entry, column, role)
        if role == Qt.ItemDataRole.DisplayRole and column == FLAGS:
            return flags_in_short(entry.shot.flags) if entry.shot is not None else ""
        if role == Qt.ItemDataRole.DisplayRole and column == VERDICT:
            words = self._text(entry, column)  # or why there is none
            return verdict_in_short(words) if words == entry.verdict else words
        if role == Qt.ItemDataRole.EditRole and column == VERDICT and entry.number in self._struck:
            return f"{self._text(entry, column)} (of another model)"
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole):
            return self._text(entry, column)
        if role == Qt.ItemDataRole.FontRole and column == VERDICT and entry.number in self._struck:
            font = QFont()
            font.setStrikeOut(True)
            return font
        if role == Qt.ItemDataRole.ToolTipRole:
            return self._hover(entry, column)
        if role == Qt.ItemDataRole.TextAlignmentRole and is_number(column):
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
        if column == VERDICT:
            if shot is None:
                return "waiting for analysis"
            return shot.problem or entry.verdict or DASH
        if column == FLAGS:
            return ", ".join(by_weight(shot.flags)) if shot is not None else ""
        if column == NOTE:
            return entry.note
        return concise_text(self._stated(entry, column), scale_of(column))

    def _hover(self, entry: Entry, column: int) -> str | None:
        if is_number(column):
            reading, shot = self._stated(entry, column), entry.shot
            which = COMBINED if shot is not None and key_of(column) in self._combined.of(shot) else NOISE_ONLY
            return how_text(COLUMNS[column][0], reading, value_text(reading, scale_of(column)), which)
        if column == FLAGS and entry.shot is not None:
            return "\n".join(map(flag_line, by_weight(entry.shot.flags))) or None
        if column == VERDICT and entry.number in self._struck:
            return f"{self._text(entry, column)}\n{OUTDATED}"
        if column == 2:
            s = entry.settings
            copy = f"Shot {entry.copy_of} with other settings.\n" if entry.copy_of is not None else ""
            return f"{copy}{entry.path or 'not saved'}\nbandwidth {s.bandwidth_hz:g} Hz, model {s.model}"
        return self._text(entry, column) or None

    def setData(self, index: QModelIndex, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Pass an edited note on."""
        if role != Qt.ItemDataRole.EditRole or index.column() != NOTE:
            return False
        entry = self.entry_at(index.row())
        if entry is not None and str(value) != entry.note:
            self.note_edited.emit(entry.number, str(value))
        return True

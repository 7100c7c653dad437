"""The Qt model of the table of shots: sorted, filtered and grouped rows, tooltips, editable notes."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, Qt, Signal
from PySide6.QtGui import QFont

from analysis.shot import Quantity, Reading, Shot
from analysis.uncertainty import (
    Origin,
    ResultNumber,
    collision_numbers,
    combined_uncertainties,
    with_combined_uncertainty,
)
from app.session import Entry
from app.window.controls.widgets import hover_text
from app.window.panels.state_words import flag_line
from app.words import (
    COMBINED,
    DASH,
    NOISE_ONLY,
    OUTDATED,
    by_severity,
    concise_text,
    flag_name,
    flag_words,
    flags_in_short,
    reading_tooltip,
    value_text,
    verdict_words,
)


@dataclass(frozen=True, slots=True)
class TableOrder:
    """Sort column (None: in the order taken), filter ``words`` that must all occur, and a key of ``GROUPS`` or ""."""

    column: int | None = None
    falling: bool = False
    words: str = ""
    group: str = ""


def _started_at(entry: Entry) -> str:
    return (entry.shot.started_at or "") if entry.shot is not None else ""


def _day(entry: Entry) -> str:
    return _started_at(entry)[:10] or "no date"


def _series(entry: Entry) -> str:
    return entry.name.rstrip("0123456789").rstrip("-_ .") or entry.name


GROUPS: dict[str, tuple[str, Callable[[Entry], str]]] = {
    "day": ("day", _day),
    "series": ("series", _series),
    "verdict": ("verdict", lambda entry: entry.verdict or "not diagnosed"),
    "model": ("base model", lambda entry: entry.settings.model),
}


def ordered(
    entries: Sequence[Entry],
    order: TableOrder,
    value: Callable[[Entry], float | str | None] | None,
    searched: Callable[[Entry], str],
) -> tuple[Entry | str, ...]:
    """Return the filtered entries in this order, with a heading before each group.

    ``value`` returns the sort key (a number, a text, or None), ``searched`` the text to search.
    """
    words = order.words.lower().split()
    seen = [entry for entry in entries if all(word in searched(entry).lower() for word in words)]
    if value is not None:
        there = [entry for entry in seen if not _missing(value(entry))]
        missing = [entry for entry in seen if _missing(value(entry))]
        there.sort(key=lambda entry: _key(value(entry)), reverse=order.falling)
        seen = [*there, *missing]
    if order.group not in GROUPS:
        return tuple(seen)
    _, of = GROUPS[order.group]
    groups: dict[str, list[Entry]] = {}
    for entry in seen:
        groups.setdefault(of(entry), []).append(entry)
    rows: list[Entry | str] = []
    for name, members in groups.items():
        rows += [f"{name}   ({len(members)})", *members]
    return tuple(rows)


def _missing(value: float | str | None) -> bool:
    return value is None or value == "" or (isinstance(value, float) and math.isnan(value))


def _key(value: float | str | None) -> tuple[float, str]:
    return (0.0, value.lower()) if isinstance(value, str) else (float(value or 0.0), "")


NUMBER_COLUMN_DIGITS = 15  # width of a number's column in digits, for 0.98729985(50)


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the table: heading, width in digits, and the text of its cells or the number shown in it."""

    head: str
    letters: int
    text: Callable[[Entry], str] = lambda entry: ""
    sorted_by: Callable[[Entry], float | str] | None = None  # sort key; None: the text
    number: ResultNumber | None = None

    @property
    def hidden(self) -> bool:
        return self.number is not None and not self.number.listed

    def order(self, entry: Entry) -> float | str | None:
        """Return the sort key, a value or a text; None sorts last."""
        if self.number is not None:
            reading = self.number.find(entry.shot) if entry.shot is not None else None
            return reading.value if isinstance(reading, Quantity) else None
        return self.sorted_by(entry) if self.sorted_by is not None else self.text(entry)


def _place(entry: Entry) -> str:
    return f"{entry.number}" + (f" ({entry.copy_of})" if entry.copy_of is not None else "")


def _verdict(entry: Entry) -> str:
    if entry.shot is None:
        return "waiting for analysis"
    return entry.shot.problem or entry.verdict or DASH


def _flags(entry: Entry) -> str:
    return ", ".join(by_severity(entry.shot.flags)) if entry.shot is not None else ""


def columns() -> list[Column]:
    """Return the columns in order; columns hidden at first are last."""
    numbers = [
        Column(n.head, NUMBER_COLUMN_DIGITS, number=n)
        for n in collision_numbers(Origin.READ, Origin.FITTED, Origin.STATED)
    ]
    return [
        Column("#", 9, _place, lambda entry: float(entry.number)),
        Column("time", 9, lambda entry: _started_at(entry)[11:19] or DASH, _started_at),
        Column("name", 13, lambda entry: entry.name),
        *(column for column in numbers if not column.hidden),
        Column("verdict", 25, _verdict, lambda entry: entry.verdict),
        Column("flags", 26, _flags),
        Column("note", 9, lambda entry: entry.note),
        *(column for column in numbers if column.hidden),
    ]


def place_of(head: str) -> int:
    return [column.head for column in columns()].index(head)


NAME, VERDICT, FLAGS, NOTE = map(place_of, ("name", "verdict", "flags", "note"))


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
    """The Qt table model; emits ``note_edited`` when a note is edited."""

    note_edited = Signal(int, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.columns = columns()
        self.entries: tuple[Entry, ...] = ()  # all entries, in the order taken
        self.rows: tuple[Entry | str, ...] = ()  # the rows shown, with a heading before each group
        self.order = TableOrder()
        self._struck: frozenset[int] = frozenset()
        self._made: dict[int, tuple[Shot, Mapping[str, float]]] = {}  # by id(shot); keeps the shot, so its id

    @property
    def identities(self) -> list[int | str]:
        """Get the entry's number, or the heading, of each row."""
        return [_identity(row) for row in self.rows]

    def show_entries(self, entries: tuple[Entry, ...], struck: Collection[int] = ()) -> None:
        """Show these entries; changed rows keep their position and selection.

        ``struck`` are numbers of entries whose verdict is outdated.
        """
        self.entries, self._struck = entries, frozenset(struck)
        listed = {id(entry.shot) for entry in entries}
        self._made = {key: made for key, made in self._made.items() if key in listed}
        self._arrange()

    def arrange(self, order: TableOrder) -> None:
        self.order = order
        self._arrange()

    def _arrange(self) -> None:
        column = self.order.column
        value = self.columns[column].order if column is not None else None
        before, rows = self.identities, ordered(self.entries, self.order, value, self._searched)
        after = list(map(_identity, rows))
        if after == before:
            self.rows = rows
            if rows:
                self.dataChanged.emit(self.index(0, 0), self.index(len(rows) - 1, len(self.columns) - 1))
        elif after[: len(before)] == before:
            self.beginInsertRows(QModelIndex(), len(before), len(rows) - 1)
            self.rows = rows
            self.endInsertRows()
        else:
            self.beginResetModel()
            self.rows = rows
            self.endResetModel()

    def entry_at(self, row: int) -> Entry | None:
        """Return the entry in a row, or None for a heading."""
        found = self.rows[row] if row < len(self.rows) else None
        return found if isinstance(found, Entry) else None

    def _combined(self, shot: Shot) -> Mapping[str, float]:
        """Return the combined standard uncertainties of a shot, computed once."""
        if id(shot) not in self._made:
            self._made[id(shot)] = (shot, combined_uncertainties(shot))
        return self._made[id(shot)][1]

    def _stated(self, entry: Entry, number: ResultNumber) -> Reading | None:
        """Return a number with its combined standard uncertainty."""
        if entry.shot is None:
            return None
        return with_combined_uncertainty(number.find(entry.shot), number.key, self._combined(entry.shot))

    def _searched(self, entry: Entry) -> str:
        flags = (
            " ".join(f"{flag_name(flag)} {flag_words(flag)}" for flag in entry.shot.flags)
            if entry.shot is not None
            else ""
        )
        return " ".join((*(column.text(entry) for column in self.columns if column.number is None), flags))

    def rowCount(self, parent: QModelIndex | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.rows)

    def columnCount(self, parent: QModelIndex | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.columns)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return self.columns[section].head
        if role == Qt.ItemDataRole.TextAlignmentRole:
            side = (
                Qt.AlignmentFlag.AlignRight if self.columns[section].number is not None else Qt.AlignmentFlag.AlignLeft
            )
            return side | Qt.AlignmentFlag.AlignVCenter
        return None

    def flags(self, index: QModelIndex) -> Qt.ItemFlag:
        """Return the Qt item flags of a cell; only notes are editable."""
        if self.entry_at(index.row()) is None:
            return Qt.ItemFlag.ItemIsEnabled
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsEditable if index.column() == NOTE else flags

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        entry, column = self.rows[index.row()], index.column()
        if isinstance(entry, str):
            return _heading(entry, column, role)
        if role == Qt.ItemDataRole.DisplayRole:
            return self._short_text(entry, column)
        if role == Qt.ItemDataRole.EditRole:
            return self._text(entry, column) + (" (of another model)" if self._outdated(entry, column) else "")
        if role == Qt.ItemDataRole.FontRole and self._outdated(entry, column):
            font = QFont()
            font.setStrikeOut(True)
            return font
        if role == Qt.ItemDataRole.ToolTipRole:
            return hover_text(self._hover(entry, column))
        if role == Qt.ItemDataRole.TextAlignmentRole and self.columns[column].number is not None:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None

    def _outdated(self, entry: Entry, column: int) -> bool:
        """Return whether a cell holds a verdict that is not of the shot's present model."""
        return column == VERDICT and entry.number in self._struck

    def _short_text(self, entry: Entry, column: int) -> str:
        """Return the text shown in a cell: flags and a verdict in short."""
        shot, of = entry.shot, entry.verdict_of
        if column == FLAGS:
            return flags_in_short(shot.flags) if shot is not None else ""
        if column != VERDICT or of is None or shot is None or shot.problem:
            return self._text(entry, column)
        return verdict_words(of.conclusion, of.found, short=True)

    def _text(self, entry: Entry, column: int) -> str:
        number = self.columns[column].number
        if number is None:
            return self.columns[column].text(entry)
        return concise_text(self._stated(entry, number), number.scale)

    def _hover(self, entry: Entry, column: int) -> str:
        number = self.columns[column].number
        if number is not None:
            reading, shot = self._stated(entry, number), entry.shot
            value = value_text(reading, number.scale)
            if number.origin is Origin.STATED:  # its ± was stated with the value
                return reading_tooltip(number.head, reading, value)
            which = COMBINED if shot is not None and number.key in self._combined(shot) else NOISE_ONLY
            return reading_tooltip(number.head, reading, value, which)
        if column == FLAGS and entry.shot is not None:
            return "\n".join(map(flag_line, by_severity(entry.shot.flags)))
        if self._outdated(entry, column):
            return f"{self._text(entry, column)}\n{OUTDATED}"
        if column == NAME:
            s = entry.settings
            copy = f"Shot {entry.copy_of} with other settings.\n" if entry.copy_of is not None else ""
            return f"{copy}{entry.path or 'not saved'}\nbandwidth {s.bandwidth_hz:g} Hz, model {s.model}"
        return self._text(entry, column)

    def setData(self, index: QModelIndex, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        if role != Qt.ItemDataRole.EditRole or index.column() != NOTE:
            return False
        entry = self.entry_at(index.row())
        if entry is not None and str(value) != entry.note:
            self.note_edited.emit(entry.number, str(value))
        return True

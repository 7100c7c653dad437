"""LARGE page: the main numbers of a shot in the largest font that fits."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QFont, QFontMetricsF, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from analysis.shot import NUMBERS_AFFECTED, Quantity, Reading, Shot
from analysis.uncertainty import Group, ResultNumber, combined_uncertainties, shown_numbers, with_combined_uncertainty
from app.window.controls.theme import MARKS, Tone
from app.window.controls.widgets import set_tone, text_label
from app.words import DASH, MILD_FLAGS, localised_number, number

MAX_DIGITS = 7  # most digits readable from a distance
_SHOWN = [number for group in Group for number in shown_numbers(group) if number.large]
COLLISION = tuple(number for number in _SHOWN if number.group is not Group.DRIVE)
DRIVEN = tuple(number for number in _SHOWN if number.group is Group.DRIVE)
MIN_PX, SPARE = 12, 0.92


class LargePanel(QWidget):
    """The LARGE page: a title, and a line for each number."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._rows: tuple[ResultNumber, ...] = COLLISION
        grid = QGridLayout(self)
        grid.setContentsMargins(16, 6, 16, 6)
        self._title = text_label("", self)
        grid.addWidget(self._title, 0, 0, 1, 3)
        self._cells: list[tuple[QLabel, QLabel, QLabel]] = []
        for line in range(1, 1 + max(len(COLLISION), len(DRIVEN))):
            cells = QLabel(self), text_label(DASH, self, selectable=True), text_label("", self, faint=True)
            cells[1].setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            for place, cell in enumerate(cells):
                cell.setMinimumSize(1, 1)  # lets the page shrink; the font is then fitted to it
                grid.addWidget(cell, line, place)
            self._cells.append(cells)
        self._title.setMinimumSize(1, 1)
        grid.setColumnStretch(1, 1)
        self.show_shot(None, "")

    def show_shot(self, shot: Shot | None, title: str) -> None:
        """Show a shot's numbers, rounded to their combined uncertainty; a flag in doubt puts a mark at the title."""
        self._rows = COLLISION if shot is None or shot.settings.collides else DRIVEN
        doubtful = shot is not None and any(self._casts_doubt(flag) for flag in shot.flags)
        self._title.setText((f"{MARKS[Tone.WARNING]} " if doubtful else "") + (title or "No shot yet"))
        set_tone(self._title, Tone.WARNING if doubtful else None)
        combined = combined_uncertainties(shot) if shot is not None else {}
        for line, (name, value, unit) in enumerate(self._cells):
            there = line < len(self._rows)
            for cell in (name, value, unit):
                cell.setVisible(there)
            if there:
                row = self._rows[line]
                name.setText(row.symbol or row.name)
                unit.setText(row.shown_unit)
                value.setAccessibleName(f"{name.text()} {row.shown_unit}".strip())
                reading = with_combined_uncertainty(row.find(shot), row.key, combined) if shot is not None else None
                value.setText(plain_digits(reading, row.scale))
        self._fit()

    def _casts_doubt(self, flag: str) -> bool:
        """Return whether a flag casts doubt on the numbers shown here."""
        about = NUMBERS_AFFECTED.get(flag)
        return flag not in MILD_FLAGS and (about is None or any(row.key in about for row in self._rows))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Set the largest font in which every line fits."""
        margins = self.layout().contentsMargins()
        width = self.width() - margins.left() - margins.right() - 2 * self.layout().spacing()
        height = self.height() - margins.top() - margins.bottom()
        font = QFont(self.font())
        font.setBold(True)
        font.setPixelSize(100)
        metrics = QFontMetricsF(font)
        shown = self._cells[: len(self._rows)]
        columns = [max(metrics.horizontalAdvance(cells[place].text()) for cells in shown) for place in range(3)]
        lines = len(self._rows) + 1.4
        size = SPARE * min(100.0 * width / (sum(columns) + 1.0), 100.0 * height / (lines * metrics.height()))
        font.setPixelSize(max(MIN_PX, int(size)))
        for cells in self._cells:
            for cell in cells:
                cell.setFont(font)
        title = QFont(self.font())
        title.setPixelSize(max(MIN_PX, int(0.5 * size)))
        room = QFontMetricsF(title).horizontalAdvance(self._title.text())
        title.setPixelSize(max(MIN_PX, int(title.pixelSize() * min(1.0, width / (room + 1.0)))))
        self._title.setFont(title)


def plain_digits(reading: Reading | None, scale: float = 1.0) -> str:
    """Return a number rounded to its first uncertain digit, at most ``MAX_DIGITS`` digits; a dash if not measured."""
    if not isinstance(reading, Quantity):
        return DASH
    text = str(reading.scaled(scale)).partition(" ±")[0]
    if text.startswith("("):  # a very large or small number, with an exponent
        return number(reading.value * scale, 3)
    if "." in text:
        digits = sum(letter.isdigit() for letter in text)
        decimals = len(text.partition(".")[2])
        text = f"{reading.value * scale:.{max(0, decimals - max(1, digits - MAX_DIGITS))}f}"
    return localised_number(text)

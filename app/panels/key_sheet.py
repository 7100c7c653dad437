"""F1: every key on one sheet, made from the table the window binds them from."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QVBoxLayout, QWidget

from app.keys import KEYS, MOUSE, ON_PLOT
from app.theme import sized


class KeySheet(QFrame):
    """A sheet over the window; nothing in it takes input."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        self.setAccessibleName("Keys")
        column = QVBoxLayout(self)
        column.setContentsMargins(28, 20, 28, 20)
        title = QLabel("Keys", self)
        title.setFont(sized(self.font(), 1.6, bold=True))
        column.addWidget(title)
        grid = QGridLayout()
        grid.setHorizontalSpacing(18)
        grid.setVerticalSpacing(4)
        column.addLayout(grid)
        groups: dict[str, list[tuple[str, str]]] = {}
        for key in KEYS:
            groups.setdefault(key.group, []).append((key.sequence, key.words))
        groups["A plot in focus (Tab)"] = list(ON_PLOT)
        groups["Mouse on a plot"] = list(MOUSE)
        lines = [0, 0]
        for name, rows in groups.items():
            side = 0 if lines[0] <= lines[1] else 1
            heading = QLabel(name.upper(), self)
            heading.setProperty("heading", True)
            grid.addWidget(heading, lines[side], 3 * side, 1, 2)
            lines[side] += 1
            for sequence, words in rows:
                key_label = QLabel(sequence, self)
                bold = key_label.font()
                bold.setBold(True)
                key_label.setFont(bold)
                grid.addWidget(key_label, lines[side], 3 * side)
                grid.addWidget(QLabel(words, self), lines[side], 3 * side + 1)
                lines[side] += 1
            grid.setRowMinimumHeight(lines[side], 10)
            lines[side] += 1
        grid.setColumnMinimumWidth(2, 30)
        hint = QLabel("F1 or Esc closes this sheet.  Tab moves between controls, Enter presses the one in focus.", self)
        hint.setProperty("faint", True)
        column.addWidget(hint, 0, Qt.AlignmentFlag.AlignLeft)
        self.hide()

    def place(self) -> None:
        """Centre the sheet in its window."""
        parent = self.parentWidget()
        if parent is not None:
            self.adjustSize()
            self.move((parent.width() - self.width()) // 2, max(10, (parent.height() - self.height()) // 2))
            self.raise_()

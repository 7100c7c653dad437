"""F1: every key on one sheet, made from the table of commands."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QScrollArea, QVBoxLayout, QWidget

from app.window.commands import COMMANDS, MOUSE, ON_PLOT
from app.window.theme import sized


class KeySheet(QFrame):
    """A sheet over the window; nothing in it takes input."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        self.setAccessibleName("Keys")
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 14, 18, 14)
        title = QLabel("Keys", self)
        title.setFont(sized(self.font(), 1.6, bold=True))
        column.addWidget(title)
        inside = QWidget(self)
        grid = QGridLayout(inside)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(18)
        grid.setVerticalSpacing(4)
        self._scroll = QScrollArea(self)  # a small screen at 200 % is lower than the list
        self._scroll.setWidget(inside)
        self._scroll.setWidgetResizable(True)
        self._scroll.setFrameShape(QFrame.Shape.NoFrame)
        self._scroll.setStyleSheet("QScrollArea, QScrollArea > QWidget > QWidget { background: transparent; }")
        self._scroll.setAccessibleName("List of keys")
        column.addWidget(self._scroll)
        groups: dict[str, list[tuple[str, str]]] = {}
        for command in COMMANDS:
            if command.keys:
                groups.setdefault(command.menu, []).append((", ".join(command.keys), command.words))
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
        grid.setColumnMinimumWidth(2, 12)
        hint = QLabel("F1 or Esc closes this sheet.  Tab moves between controls, Enter presses the one in focus.", self)
        hint.setProperty("faint", True)
        column.addWidget(hint, 0, Qt.AlignmentFlag.AlignLeft)
        self.hide()

    def place(self) -> None:
        """Centre the sheet in its window, no larger than it."""
        parent, inside = self.parentWidget(), self._scroll.widget()
        if parent is not None and inside is not None:
            wanted = inside.sizeHint()
            around = self.sizeHint() - self._scroll.sizeHint()
            bar = self._scroll.verticalScrollBar().sizeHint().width()
            width = min(parent.width() - 20, wanted.width() + bar + around.width())
            height = min(parent.height() - 20, wanted.height() + around.height())
            self.setGeometry((parent.width() - width) // 2, (parent.height() - height) // 2, width, height)
            self.raise_()

"""F1: the sheet of all keys, made from the table of commands."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QScrollArea, QVBoxLayout, QWidget

from app.window.commands import COMMANDS, MOUSE, ON_PLOT
from app.window.theme import sized
from app.window.widgets import text_label


class KeySheet(QFrame):
    """A sheet over the window, without input."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        self.setAccessibleName("Keys")
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 14, 18, 14)
        title = QLabel("Keys", self)
        title.setFont(sized(self.font(), 1.6, bold=True))
        column.addWidget(title)
        self._scroll = QScrollArea(self)  # a small screen at 200 % is lower than the list
        self._scroll.setWidgetResizable(True)
        self._scroll.setFrameShape(QFrame.Shape.NoFrame)
        self._scroll.setStyleSheet("QScrollArea, QScrollArea > QWidget > QWidget { background: transparent; }")
        self._scroll.setAccessibleName("List of keys")
        column.addWidget(self._scroll)
        self._lists: dict[int, QWidget] = {}  # side by side; on a narrow screen one below the other
        hint = QLabel("F1 or Esc closes this sheet.  Tab moves between controls, Enter presses the one in focus.", self)
        hint.setProperty("faint", True)
        column.addWidget(hint, 0, Qt.AlignmentFlag.AlignLeft)
        self.hide()

    def place(self) -> None:
        """Centre the sheet in its window."""
        parent = self.parentWidget()
        if parent is None:
            return
        if not self._lists:  # made when first shown, as two hundred labels take long
            self._lists = {sides: _list(sides) for sides in (1, 2)}
            self._scroll.setWidget(self._lists[2])
            self._scroll.updateGeometry()  # the sheet's layout knows it without a list
        around = self.sizeHint() - self._scroll.sizeHint()
        spare = self._scroll.verticalScrollBar().sizeHint().width() + around.width()
        room = parent.width() - 20
        chosen = self._lists[2 if self._lists[2].sizeHint().width() + spare <= room else 1]
        wanted = chosen.sizeHint()
        if self._scroll.widget() is not chosen:
            self._scroll.takeWidget()
            self._scroll.setWidget(chosen)
            chosen.show()
        width = min(room, wanted.width() + spare)
        height = min(parent.height() - 20, wanted.height() + around.height())
        self.setGeometry((parent.width() - width) // 2, (parent.height() - height) // 2, width, height)
        self.raise_()


def _list(sides: int) -> QWidget:
    """Return all keys by group, in ``sides`` columns."""
    inside = QWidget()
    grid = QGridLayout(inside)
    grid.setContentsMargins(0, 0, 0, 0)
    grid.setHorizontalSpacing(18)
    grid.setVerticalSpacing(4)
    groups: dict[str, list[tuple[str, str]]] = {}
    for command in COMMANDS:
        if command.keys:
            groups.setdefault(command.menu, []).append((", ".join(command.keys), command.words))
    groups["A plot in focus (Tab)"] = list(ON_PLOT)
    groups["Mouse on a plot"] = list(MOUSE)
    lines = [0] * sides
    for name, rows in groups.items():
        side = lines.index(min(lines))
        heading = text_label(name.upper(), inside, heading=True)
        grid.addWidget(heading, lines[side], 3 * side, 1, 2)
        lines[side] += 1
        for sequence, words in rows:
            key_label = QLabel(sequence, inside)
            bold = key_label.font()
            bold.setBold(True)
            key_label.setFont(bold)
            grid.addWidget(key_label, lines[side], 3 * side)
            grid.addWidget(QLabel(words, inside), lines[side], 3 * side + 1)
            lines[side] += 1
        grid.setRowMinimumHeight(lines[side], 10)
        lines[side] += 1
    grid.setColumnMinimumWidth(2, 12)
    return inside

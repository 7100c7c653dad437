"""Help sheets: all keys (F1), versions and licences, and the short tour (F4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from email.message import Message
from importlib.metadata import PackageNotFoundError, metadata
from typing import cast

from PySide6.QtCore import QPoint, QRect, Qt, Signal, Slot
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QPlainTextEdit, QScrollArea, QWidget

from app.report import program_words
from app.window.controls.commands import COMMANDS, MOUSE, ON_PLOT
from app.window.controls.widgets import Sheet, add_row, added, heading_label, push_button, text_label, vertical


class KeySheet(Sheet):
    """The list of all keys, centred in the window."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Keys", parent)
        column = vertical(self, (18, 14, 18, 14))
        column.addWidget(text_label("Keys", self, bold=True, size=1.6))
        self._scroll = QScrollArea(self)  # the list is higher than a small screen at 200 %
        self._scroll.setWidgetResizable(True)
        self._scroll.setFrameShape(QFrame.Shape.NoFrame)
        self._scroll.setStyleSheet("QScrollArea, QScrollArea > QWidget > QWidget { background: transparent; }")
        self._scroll.setAccessibleName("List of keys")
        column.addWidget(self._scroll)
        self._lists: dict[int, QWidget] = {}  # number of columns -> list; one column on a narrow screen
        hint = "F1 or Esc closes this sheet.  Tab moves between controls, Enter presses the one in focus."
        column.addWidget(text_label(hint, self, faint=True), 0, Qt.AlignmentFlag.AlignLeft)

    def place(self) -> None:
        """Centre the sheet in its window."""
        parent = self.parentWidget()
        if parent is None:
            return
        if not self._lists:  # made when first shown, because two hundred labels take long to make
            self._lists = {sides: _key_list(sides) for sides in (1, 2)}
            self._scroll.setWidget(self._lists[2])
            self._scroll.updateGeometry()  # the layout has cached the size without a list
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


def _key_list(sides: int) -> QWidget:
    """Return a widget that lists all keys by group, in ``sides`` columns."""
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
        grid.addWidget(heading_label(name.upper(), inside), lines[side], 3 * side, 1, 2)
        lines[side] += 1
        for sequence, words in rows:
            grid.addWidget(text_label(sequence, inside, bold=True), lines[side], 3 * side)
            grid.addWidget(QLabel(words, inside), lines[side], 3 * side + 1)
            lines[side] += 1
        grid.setRowMinimumHeight(lines[side], 10)
        lines[side] += 1
    grid.setColumnMinimumWidth(2, 12)
    return inside


PARTS = (
    "numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "shiboken6", "pyqtgraph", "pyusb", "platformdirs",
    "uncertainties", "threadpoolctl", "lazy_loader", "h5py", "npTDMS", "niscope", "distributed",
)  # fmt: skip


def licence_words() -> str:
    """Return the program and its installed packages with version and licence, one per line."""
    lines = [program_words(), "Licence: MIT", "", "It uses:"]
    for name in PARTS:
        try:
            known = cast(Message, metadata(name))  # importlib's type lacks most of its methods
        except PackageNotFoundError:
            continue
        licence = known.get("License-Expression") or known.get("License") or ""
        if not licence or len(licence) > 80:  # some packages put the whole licence text there
            classifiers = [line for line in known.get_all("Classifier") or [] if line.startswith("License")]
            licence = ", ".join(line.split(" :: ")[-1] for line in classifiers) or "see the package"
        lines.append(f"{name} {known['Version']}: {licence}")
    return "\n".join(lines)


class AboutSheet(Sheet):
    """Versions and licences; the text is made when the sheet first opens."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("About", parent)
        column, self._close = self.head("About Levimass", "Close this sheet  (Esc)")
        self.words = QPlainTextEdit(self)
        self.words.setReadOnly(True)
        self.words.setTabChangesFocus(True)
        self.words.setTextInteractionFlags(
            Qt.TextInteractionFlag.TextSelectableByMouse | Qt.TextInteractionFlag.TextSelectableByKeyboard
        )
        self.words.setAccessibleName("Versions and licences")
        column.addWidget(self.words, 1)

    def open(self) -> None:
        if not self.words.toPlainText():
            self.words.setPlainText(licence_words())
        self.open_at(self._close)


GAP = 10


@dataclass(frozen=True, slots=True)
class Step:
    """A callout of the tour: the widget that it describes, and its text."""

    target: QWidget
    title: str
    words: str


class Tour(Sheet):
    """The short tour: one callout at a time, next to its widget; emits ``ended`` when finished or skipped."""

    ended = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        self.steps: Sequence[Step] = ()
        self._place = -1  # index of the step shown; -1: none
        self._ring = QFrame(parent)
        super().__init__("Short tour", parent)  # hides the sheet, and so the ring, which must exist before
        self.setObjectName("tour")
        self.setProperty("card", None)  # the tour has its own style
        self._ring.setObjectName("ring")
        self._ring.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        column = vertical(self, (16, 12, 16, 12))
        self.title = added(column, text_label("", self, bold=True, size=1.2))
        self._words = added(column, text_label("", self, wrap=True))
        self._count = QLabel(self)
        hover = "Do not show it again  (Esc); F4 brings it back"
        skip = push_button("Skip the tour", hover, self, self.close)
        self.onward = push_button("Next", "Next callout  (Enter)", self, self.next)
        add_row(column, self._count, skip, self.onward)
        self.setFixedWidth(self.fontMetrics().horizontalAdvance("M") * 32)

    def open(self) -> None:
        """Show the first callout; Enter shows the next, Esc ends the tour, all other keys work as usual."""
        self._place = 0
        self.open_at(self.onward)
        self._show()

    @Slot()
    def next(self) -> None:
        """Show the next callout, or end the tour after the last."""
        self._place += 1
        if self._place >= len(self.steps):
            self.close()
        else:
            self._show()

    def hideEvent(self, event: QHideEvent) -> None:
        """Hide the ring too, and emit ``ended`` once."""
        super().hideEvent(event)
        self._ring.hide()
        if self._place >= 0 and not event.spontaneous():
            self._place = -1
            self.ended.emit()

    def _show(self) -> None:
        step = self.steps[self._place]
        self.title.setText(step.title)
        self._words.setText(step.words)
        self._count.setText(f"{self._place + 1} of {len(self.steps)}")
        self.onward.setText("Done" if self._place + 1 == len(self.steps) else "Next")
        self._ring.show()
        self.place()

    def place(self) -> None:
        """Place the callout below or above its widget, inside the window."""
        parent = self.parentWidget()
        if parent is None or self._place < 0:
            return
        target = self.steps[self._place].target
        around = QRect(target.mapTo(parent, QPoint(0, 0)), target.size()).adjusted(-4, -4, 4, 4)
        self._ring.setGeometry(around.intersected(parent.rect()))
        self._ring.raise_()
        self.setFixedHeight(self.layout().heightForWidth(self.width()) + self.fontMetrics().lineSpacing() // 2)
        below = around.bottom() + GAP
        above = around.top() - GAP - self.height()
        y = below if below + self.height() < parent.height() else above
        if y < 0:  # neither below nor above the widget is room
            y = max(GAP, (parent.height() - self.height()) // 2)
        x = min(max(GAP, around.left()), parent.width() - self.width() - GAP)
        self.move(x, y)
        self.raise_()

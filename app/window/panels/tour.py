"""The short tour: callouts beside the main parts of the window."""

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QPoint, QRect, Qt, Signal, Slot
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app.window.theme import Colours, sized
from app.window.widgets import push_button, text_label

GAP = 10


@dataclass(frozen=True, slots=True)
class Step:
    """A callout: the widget it points at, and its words."""

    target: QWidget
    title: str
    words: str


class Tour(QFrame):
    """Shows one callout at a time; emits ``ended`` when it is finished or skipped."""

    ended = Signal()

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("tour")
        self.setAccessibleName("Short tour")
        self._steps: tuple[Step, ...] = ()
        self._place = 0
        self._before: QWidget | None = None  # what had the focus
        self._ring = QFrame(parent)
        self._ring.setObjectName("ring")
        self._ring.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 12, 16, 12)
        self._title = QLabel(self)
        self._title.setFont(sized(self.font(), 1.2, bold=True))
        self._words = text_label("", self, wrap=True)
        column.addWidget(self._title)
        column.addWidget(self._words)
        row = QHBoxLayout()
        self._count = QLabel(self)
        self._skip = push_button("Skip the tour", "Do not show it again  (Esc); F4 brings it back", self)
        self.onward = push_button("Next", "Next callout  (Enter)", self)
        row.addWidget(self._count, 1)
        row.addWidget(self._skip)
        row.addWidget(self.onward)
        column.addLayout(row)
        self.setFixedWidth(self.fontMetrics().horizontalAdvance("M") * 32)
        self._skip.clicked.connect(self.finish)
        self.onward.clicked.connect(self.next)
        self.dress(colours)
        self._ring.hide()
        self.hide()

    @property
    def title(self) -> str:
        """Get the heading of the callout shown."""
        return self._title.text()

    def dress(self, colours: Colours) -> None:
        self.setStyleSheet(
            f"#tour {{ background: {colours.panel}; border: 2px solid {colours.accent}; border-radius: 8px; }}"
        )
        self._ring.setStyleSheet(f"#ring {{ border: 3px solid {colours.accent}; border-radius: 8px; }}")

    def begin(self, steps: Sequence[Step]) -> None:
        """Show the first callout; Enter continues, Esc ends, all other keys work as usual."""
        self._steps, self._place = tuple(steps), 0
        self._before = self.window().focusWidget()
        self._show()
        self.onward.setFocus()

    @Slot()
    def next(self) -> None:
        """Show the next callout, or end after the last."""
        self._place += 1
        if self._place >= len(self._steps):
            self.finish()
        else:
            self._show()

    @Slot()
    def finish(self) -> None:
        """End the tour."""
        self.close()

    def hideEvent(self, event: QHideEvent) -> None:
        """Hide the ring, and emit ``ended`` once."""
        super().hideEvent(event)
        self._ring.hide()
        if self.window().focusWidget() in (self.onward, self._skip) and self._before is not None:
            self._before.setFocus()
        if self._steps and not event.spontaneous():
            self._steps = ()
            self.ended.emit()

    def _show(self) -> None:
        step = self._steps[self._place]
        self._title.setText(step.title)
        self._words.setText(step.words)
        self._count.setText(f"{self._place + 1} of {len(self._steps)}")
        self.onward.setText("Done" if self._place + 1 == len(self._steps) else "Next")
        self.show()
        self._ring.show()
        self.place()

    def place(self) -> None:
        """Place the callout below or above its widget, inside the window."""
        parent = self.parentWidget()
        if parent is None or not self._steps:
            return
        target = self._steps[self._place].target
        around = QRect(target.mapTo(parent, QPoint(0, 0)), target.size()).adjusted(-4, -4, 4, 4)
        self._ring.setGeometry(around.intersected(parent.rect()))
        self._ring.raise_()
        self.setFixedHeight(self.layout().heightForWidth(self.width()) + self.fontMetrics().lineSpacing() // 2)
        below = around.bottom() + GAP
        above = around.top() - GAP - self.height()
        y = below if below + self.height() < parent.height() else above
        if y < 0:  # the widget fills the height
            y = max(GAP, (parent.height() - self.height()) // 2)
        x = min(max(GAP, around.left()), parent.width() - self.width() - GAP)
        self.move(x, y)
        self.raise_()

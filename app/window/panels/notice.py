"""A line under the banner for what went wrong or was done; it stays until it is dismissed, and never blocks."""

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QWidget

from app.window.theme import MARKS, Colours, Tone

KEPT = 20


@dataclass(frozen=True, slots=True)
class Notice:
    """What is said, how bad it is, and, where something can be done at once, the button's word and what it does."""

    words: str
    tone: Tone
    label: str = ""
    do: Callable[[], object] | None = None
    declined: Callable[[], object] | None = None  # what follows where it is dismissed


class NoticeLine(QFrame):
    """Shows the newest notice and how many came before it; its height is always there, so nothing moves."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._notices: list[Notice] = []
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 0, 4, 0)
        self._words = QLabel(self)
        self._words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._words.setAccessibleName("Newest message")
        self._words.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)  # a path must not widen it
        self._whole = ""
        self._do = QPushButton("Do it", self)
        self._do.setToolTip("Do what the message offers")
        self._do.clicked.connect(self._done)
        self._close = QPushButton("Dismiss", self)
        self._close.setToolTip("Take this message away")
        self._close.clicked.connect(self.next)
        row.addWidget(self._words, 1)
        row.addWidget(self._do)
        row.addWidget(self._close)
        self.setFixedHeight(self._close.sizeHint().height() + 2)
        self._refresh()

    @property
    def words(self) -> str:
        """Get the newest notice, or nothing."""
        return self._notices[-1].words if self._notices else ""

    def say(self, words: str, tone: Tone) -> None:
        """Show a notice; the same words twice in a row are shown once."""
        self._add(Notice(words, tone))

    def offer(
        self, words: str, label: str, do: Callable[[], object], declined: Callable[[], object] | None = None
    ) -> None:
        """Show a notice with a button that does something about it; ``declined`` is called where it is dismissed."""
        self._add(Notice(words, Tone.WARNING, label, do, declined))

    def _add(self, notice: Notice) -> None:
        newest = self._notices[-1] if self._notices else None
        if newest is None or (newest.words, newest.tone) != (notice.words, notice.tone):
            self._notices.append(notice)
            del self._notices[:-KEPT]
        self._refresh()

    @Slot()
    def _done(self) -> None:
        notice = self._notices.pop()
        self._refresh()
        if notice.do is not None:
            notice.do()

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self._refresh()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Shorten the message to the room that there is; hovering shows the whole."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        self.layout().activate()
        shown = self._words.fontMetrics().elidedText(self._whole, Qt.TextElideMode.ElideMiddle, self._words.width())
        self._words.setText(shown)

    @Slot()
    def next(self) -> None:
        """Take the newest notice away."""
        if self._notices:
            notice = self._notices.pop()
            if notice.declined is not None:
                notice.declined()
        self._refresh()

    def _refresh(self) -> None:
        self._close.setVisible(bool(self._notices))
        self._do.setVisible(bool(self._notices and self._notices[-1].label))
        if not self._notices:
            self._whole = ""
            self._words.setText("")
            self._words.setToolTip("")
            self._words.setAccessibleDescription("")
            return
        newest = self._notices[-1]
        self._do.setText(newest.label)
        self._do.setAccessibleName(newest.label or "Do what the message offers")
        more = f"   ({len(self._notices) - 1} more)" if len(self._notices) > 1 else ""
        self._whole = f"{MARKS[newest.tone]} {newest.words}{more}"
        self._words.setToolTip("\n".join(notice.words for notice in reversed(self._notices)))
        self._words.setAccessibleDescription(self._whole)
        self._words.setStyleSheet(f"color: {self._colours.signs[newest.tone]}; font-weight: bold")
        self._fit()

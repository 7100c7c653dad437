"""A sheet over the right side of the window; it blocks nothing, and returns the keyboard focus when it closes."""

from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget
from shiboken6 import isValid

from app.window.theme import sized


class SideSheet(QFrame):
    """Hidden until it is opened."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._before: QWidget | None = None  # what had the focus
        self.setProperty("card", True)
        self.setAccessibleName(name)
        self.hide()

    def head(self, title: str, hover: str) -> tuple[QVBoxLayout, QPushButton]:
        """Add title and Close button; return the sheet's layout and the button."""
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 14, 18, 14)
        top = QHBoxLayout()
        words = QLabel(title, self)
        words.setFont(sized(self.font(), 1.5, bold=True))
        close = QPushButton("Close", self)
        close.setToolTip(hover)
        close.clicked.connect(self.hide)
        top.addWidget(words, 1)
        top.addWidget(close)
        column.addLayout(top)
        return column, close

    def place(self) -> None:
        """Fill the right side of the window."""
        parent = self.parentWidget()
        if parent is not None:
            width = min(parent.width() - 40, self.fontMetrics().horizontalAdvance("M") * 42)
            self.setGeometry(parent.width() - width - 4, 4, width, parent.height() - 8)

    def open(self) -> None:
        """Show the sheet."""
        self.open_at(None)

    def toggle(self) -> None:
        """Show the sheet, or hide it."""
        if self.isVisible():
            self.hide()
        else:
            self.open()

    def open_at(self, first: QWidget | None) -> None:
        """Show the sheet with the focus in a field."""
        if self.isHidden():
            self._before = self.window().focusWidget()
        self.place()
        self.show()
        self.raise_()
        if first is not None:
            first.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:
        """Return the keyboard focus."""
        super().hideEvent(event)
        focused, before = self.window().focusWidget(), self._before
        self._before = None
        if focused is None or not self.isAncestorOf(focused) or before is None:
            return
        if isValid(before) and before.isVisible():  # a row's button may have been deleted
            before.setFocus()

"""A sheet over the right side of the window; it blocks nothing, and gives the keyboard back when it goes."""

from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QFrame, QWidget
from shiboken6 import isValid


class SideSheet(QFrame):
    """Hidden until it is opened."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._before: QWidget | None = None  # what had the keyboard
        self.setProperty("card", True)
        self.setAccessibleName(name)
        self.hide()

    def place(self) -> None:
        """Stand at the right edge of the window, over its full height."""
        parent = self.parentWidget()
        if parent is not None:
            width = min(parent.width() - 40, self.fontMetrics().horizontalAdvance("M") * 42)
            self.setGeometry(parent.width() - width - 4, 4, width, parent.height() - 8)

    def open_at(self, first: QWidget | None) -> None:
        """Show the sheet with the keyboard in its first field."""
        if self.isHidden():
            self._before = self.window().focusWidget()
        self.place()
        self.show()
        self.raise_()
        if first is not None:
            first.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:
        """Give the keyboard back to what had it."""
        super().hideEvent(event)
        focused, before = self.window().focusWidget(), self._before
        self._before = None
        if focused is None or not self.isAncestorOf(focused) or before is None:
            return
        if isValid(before) and before.isVisible():  # meanwhile it may have been deleted, as a row's button is
            before.setFocus()

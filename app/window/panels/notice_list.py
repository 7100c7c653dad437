"""The messages of this run, newest first, each with the time at which it came."""

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QColor, QGuiApplication
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QPushButton, QWidget

from app.window.panels.notice import NoticeLine
from app.window.panels.side_sheet import SideSheet
from app.window.theme import MARKS, Colours


class NoticeList(SideSheet):
    """A sheet over the right side of the window."""

    def __init__(self, notices: NoticeLine, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__("Messages", parent)
        self._notices, self._colours = notices, colours
        column, _ = self.head("Messages", "Close the list  (F6 or Esc)")
        self.list = QListWidget(self)
        self.list.setAccessibleName("Messages, newest first")
        self.list.setWordWrap(True)
        self.list.setSelectionMode(QListWidget.SelectionMode.ExtendedSelection)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        column.addWidget(self.list, 1)
        self.copy = QPushButton("Copy", self)
        self.copy.setToolTip("Copy the selected messages, or all")
        self.copy.clicked.connect(self._copy)
        column.addWidget(self.copy)
        notices.changed.connect(self._refresh)

    def open(self) -> None:
        """Show the sheet."""
        self._refresh(True)
        self.open_at(self.list)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self._refresh()

    @Slot()
    def _refresh(self, opening: bool = False) -> None:
        if self.isHidden() and not opening:
            return
        self.list.clear()
        for at, notice in reversed(self._notices.history):
            item = QListWidgetItem(f"{at:%H:%M:%S}  {MARKS[notice.tone]} {notice.words}")
            item.setForeground(QColor(self._colours.signs[notice.tone]))
            self.list.addItem(item)
        if not self._notices.history:
            self.list.addItem("No message yet.")

    @Slot()
    def _copy(self) -> None:
        items = self.list.selectedItems() or [self.list.item(row) for row in range(self.list.count())]
        QGuiApplication.clipboard().setText("\n".join(item.text() for item in items))

"""Tabs that the wheel does not turn: a hand that scrolls a plot and slips off it stays on its page."""

from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QTabBar, QTabWidget, QWidget


class _Bar(QTabBar):
    def wheelEvent(self, event: QWheelEvent) -> None:
        """Do nothing."""
        event.accept()


class SteadyTabs(QTabWidget):
    """Pages with tabs that a click or a key changes."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTabBar(_Bar(self))

"""Binds the table of keys, and lets Enter press the button in focus (space is ARM, everywhere)."""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import QAbstractButton, QWidget

from app.keys import KEYS


class EnterPresses(QObject):
    """Turns Enter on a focused button into a click."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Take Enter on buttons, leave everything else."""
        if (
            event.type() == QEvent.Type.KeyPress
            and isinstance(event, QKeyEvent)
            and event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
            and isinstance(watched, QAbstractButton)
            and watched.isEnabled()
        ):
            watched.click()
            return True
        return False


def bind(window: QWidget, desks: tuple[QObject, ...]) -> None:
    """Make a shortcut of every key; its action is the method of that name of the first desk that has it."""
    for key in KEYS:
        shortcut = QShortcut(QKeySequence(key.sequence), window)
        shortcut.setContext(Qt.ShortcutContext.WindowShortcut)
        shortcut.setAutoRepeat(False)
        desk = next(desk for desk in desks if hasattr(desk, key.action))
        shortcut.activated.connect(getattr(desk, key.action))
    presses = EnterPresses(window)
    for button in window.findChildren(QAbstractButton):
        button.installEventFilter(presses)

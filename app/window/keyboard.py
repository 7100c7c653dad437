"""Binds the table of keys, and lets Enter press the button in focus (space is ARM, everywhere)."""

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QKeyEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import QAbstractButton, QWidget

from app.window.keys import KEYS


def bind(window: QWidget, presenters: tuple[QObject, ...]) -> None:
    """Make a shortcut of every key; its action is the method of that name of the first presenter that has it."""
    for key in KEYS:
        shortcut = QShortcut(QKeySequence(key.sequence), window)
        shortcut.setContext(Qt.ShortcutContext.WindowShortcut)
        shortcut.setAutoRepeat(False)
        presenter = next(presenter for presenter in presenters if hasattr(presenter, key.action))
        shortcut.activated.connect(getattr(presenter, key.action))


def pressed_by_enter(focused: QWidget | None, event: QKeyEvent) -> bool:
    """Click the focused button where this is Enter; return whether it was.

    A button passes Enter on to its window, so that one place there serves every button, later ones too.
    """
    enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat()
    if enter and isinstance(focused, QAbstractButton) and focused.isEnabled():
        focused.click()
        return True
    return False

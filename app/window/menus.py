"""Make menus and shortcuts from the table of commands; Enter presses the focused button, as space is ARM."""

from collections.abc import Mapping

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QMainWindow, QMenu, QToolButton, QWidget

from app.window.commands import COMMANDS, MENUS


def bind(
    window: QMainWindow, presenters: tuple[QObject, ...], below: Mapping[str, QMenu] | None = None
) -> dict[str, QAction]:
    """Make the menus; return the actions by name, each connected to the first presenter with a method of that name.

    ``below`` are submenus by their name in the table.
    """
    bar = window.menuBar()
    more = bar.findChild(QToolButton, "qt_menubar_ext_button")  # Qt's own, where the bar is too narrow
    if more is not None:
        more.setAccessibleName("More menus")
        more.setToolTip("More menus")
    menus = {name: bar.addMenu(f"&{name}") for name in MENUS}
    actions: dict[str, QAction] = {}
    again: list[tuple[str, QAction]] = []
    for command in COMMANDS:
        if command.action in (below or {}):
            menus[command.menu].addMenu((below or {})[command.action])
            continue
        action = QAction(command.words, window)
        action.setShortcuts([QKeySequence(key) for key in command.keys])
        action.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
        action.setAutoRepeat(False)
        presenter = next(presenter for presenter in presenters if hasattr(presenter, command.action))
        action.triggered.connect(getattr(presenter, command.action))
        if command.line_before:
            menus[command.menu].addSeparator()
        menus[command.menu].addAction(action)
        if command.also is not None:
            again.append((command.also, action))
        actions[command.action] = action
    for name, action in again:
        menus[name].addSeparator()
        menus[name].addAction(action)
    return actions


def pressed_by_enter(focused: QWidget | None, event: QKeyEvent) -> bool:
    """Click the focused button where the key is Enter; return whether it was.

    Buttons pass Enter on to their window, so that this serves all of them.
    """
    enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat()
    if enter and isinstance(focused, QAbstractButton) and focused.isEnabled():
        focused.click()
        return True
    return False

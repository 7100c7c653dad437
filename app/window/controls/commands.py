"""The table of all commands with their menus and keys; menus, shortcuts and the key list (F1) are made from it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QMainWindow, QMenu, QPushButton, QToolButton, QWidget

from app.window.controls.widgets import call_with


@dataclass(frozen=True, slots=True)
class Command:
    """A command: its menu, its label, its keys, and the method of a presenter or panel that it calls.

    ``action`` is the method's name, or "method:argument" for a method with an argument.
    """

    menu: str
    words: str
    action: str
    keys: tuple[str, ...] = ()
    line_before: bool = False  # a separator precedes it in its menu
    also: str | None = None  # a second menu, at whose end it appears too


MENUS = ("File", "Rig", "Shots", "View", "Model", "Help")
COMMANDS: tuple[Command, ...] = (
    Command("File", "Open recordings …", "open_recordings", ("Ctrl+O",)),
    Command("File", "Open a folder of recordings …", "open_folder", ("Ctrl+Shift+D",)),
    Command("File", "Open recent", "recent"),
    Command("File", "Open a session …", "open_session", ("Ctrl+Alt+O",), True),
    Command("File", "Save the session as …", "save_session", ("Ctrl+Alt+S",)),
    Command("File", "Return to the unnamed session", "usual_session"),
    Command("File", "Export CSV of the selected shots, or of all …", "export:export", ("Ctrl+E",), True),
    Command("File", "Export HDF5 of the selected shots, or of all …", "export:export_hdf5", ("Ctrl+Shift+E",)),
    Command("File", "Report of the selected shots, or of all (HTML, PDF) …", "export:report", ("Ctrl+T",)),
    Command("File", "Print the report …", "print_report", ("Ctrl+Shift+P",)),
    Command("File", "Save the plot (PNG, SVG, CSV) …", "on_plot:open_menu", ("Ctrl+P",)),
    Command("File", "Save shots held only in memory to another folder …", "save_elsewhere", ("Ctrl+S",), True),
    Command("File", "Quit", "close", ("Ctrl+Q",), True),
    Command("Rig", "ARM: wait for the light switch and record", "arm", ("Space",)),
    Command("Rig", "Abort (closes an open sheet first)", "abort", ("Esc",)),
    Command("Rig", "Trigger by hand while armed", "trigger_now", ("T",)),
    Command("Rig", "Re-arm automatically, on or off", "toggle:controls.rearm", ("R",)),
    Command("Rig", "Choose the source", "focus_source", ("S",), True),
    Command("Rig", "Set-up: devices, permission, signal check", "toggle_setup", ("F3",)),
    Command("Rig", "Settings", "toggle_settings", ("F2",)),
    Command("Shots", "Previous shot", "step_shot:-1", ("Ctrl+Up",)),
    Command("Shots", "Next shot", "step_shot:1", ("Ctrl+Down",)),
    Command("Shots", "Write a note on the shot", "edit_note", ("N",), True),
    Command("Shots", "Write a note on the plot", "note_on_plot", ("Shift+N",)),
    Command("Shots", "Re-analyse as copies with the present settings", "reanalyse_selected", ("Ctrl+R",)),
    Command("Shots", "Copy the selected lines as a table", "copy_shots", ("Ctrl+C",)),
    Command("Shots", "Filter the shots", "filter_shots", ("Ctrl+F",)),
    Command("Shots", "Choose the columns …", "choose_columns", ("Ctrl+Shift+F",)),
    Command("Shots", "Remove the selected shots from the list", "remove_selected", ("Del",), True),
    Command("Shots", "Undo the last note, removal or change of the model", "undo", ("Ctrl+Z",), also="Model"),
    Command("Shots", "Redo what was undone", "redo", ("Ctrl+Shift+Z", "Ctrl+Y"), also="Model"),
    Command("View", "LIVE", "show_page:LIVE", ("Ctrl+1",)),
    Command("View", "SHOT", "show_page:SHOT", ("Ctrl+2",)),
    Command("View", "COMPARE", "show_page:COMPARE", ("Ctrl+3",)),
    Command("View", "SPECTRUM", "show_page:SPECTRUM", ("Ctrl+4",)),
    Command("View", "DIAGNOSIS", "show_page:DIAGNOSIS", ("Ctrl+5",)),
    Command("View", "BUDGET: sources of each uncertainty", "show_page:BUDGET", ("Ctrl+6", "B")),
    Command("View", "PAPER", "show_page:PAPER", ("Ctrl+7",)),
    Command("View", "LARGE: numbers readable from a distance", "show_page:LARGE", ("Ctrl+8", "L")),
    Command("View", "Uncertainties: combined or noise only", "toggle:numbers.noise_only", ("U",)),
    Command("View", "Whole shot", "show_view:whole", ("1",), True),
    Command("View", "First contact (Fig. 5)", "show_view:contact", ("2",)),
    Command("View", "Force vs deflection (Fig. 6)", "show_view:deflection", ("3",)),
    Command("View", "Gap between the bodies (Fig. 7)", "show_view:gap", ("4",)),
    Command("View", "Raw signals", "show_view:raw", ("5",)),
    Command("View", "Reset the view", "on_plot:reset", ("0",), True),
    Command("View", "Previous view", "step_view:-1", ("Alt+Left",)),
    Command("View", "Next view", "step_view:1", ("Alt+Right",)),
    Command("View", "Two cursors", "on_plot:toggle_cursors", ("C",)),
    Command("View", "Copy the cursor readings", "copy_cursors", ("Ctrl+Shift+C",)),
    Command("View", "Copy the plot as a picture", "copy_plot", ("Ctrl+Shift+X",)),
    Command("View", "Freeze or resume the LIVE curves", "toggle:live.hold", ("H",)),
    Command("Model", "Diagnose the selected shots", "diagnose", ("D",)),
    Command("Model", "Propose a force law …", "toggle:law", ("Ctrl+L",)),
    Command("Model", "Open a model file …", "load_model", ("Ctrl+Shift+O",), True),
    Command("Model", "Save the model of the selected shots, or of all …", "export:save_model", ("Ctrl+Shift+S",)),
    Command(
        "Model", "Test a model's predictions on the selected shots, or on all …", "export:test_model", ("Ctrl+Shift+T",)
    ),
    Command("Help", "Keys", "toggle:keys", ("F1",)),
    Command("Help", "The short tour", "toggle:tour", ("F4",)),
    Command("Help", "Tutorial and manual", "show_manual"),
    Command("Help", "Messages of this run", "toggle:messages", ("F6",)),
    Command("Help", "Log folder", "show_log", (), True),
    Command("Help", "About, versions, licences", "toggle:about"),
)


def with_keys(hover: str, action: str) -> str:
    """Return a tooltip followed by the keys of a command, like "Undo the last note  (Ctrl+Z)"."""
    keys = next(command.keys for command in COMMANDS if command.action == action)
    return f"{hover}  ({' or '.join(keys)})"


ON_PLOT = (
    ("Left, Right", "move along the axis"),
    ("Up, Down", "zoom in, out"),
    ("Home", "show the whole range"),
    ("Shift+Left, Right", "move cursor A"),
    ("Ctrl+Left, Right", "move cursor B"),
)

MOUSE = (
    ("wheel", "zoom along the time axis; over the left axis, or with Ctrl, zoom the value"),
    ("drag", "move along the axis"),
    ("Shift and drag", "draw the box to zoom to"),
    ("click on a bounce", "zoom to it"),
    ("right click", "the plot's own menu; on a plot of a shot a note can be written there"),
    ("double click on a note", "edit it; an empty text removes it"),
)


def bind(
    window: QMainWindow, doing: tuple[QObject, ...], below: Mapping[str, QMenu] | None = None
) -> dict[str, QAction]:
    """Make the menus; return their actions, each connected to the first object in ``doing`` with a method of its name.

    The buttons of commands in the window are connected too, and get the keys into their tooltips.
    ``below`` are submenus by the ``action`` of their command.
    """
    bar = window.menuBar()
    more = bar.findChild(QToolButton, "qt_menubar_ext_button")  # Qt shows it if the bar is too narrow
    if more is not None:
        more.setAccessibleName("More menus")
        more.setToolTip("More menus")
    menus = {name: bar.addMenu(f"&{name}") for name in MENUS}
    actions: dict[str, QAction] = {}
    for command in COMMANDS:
        if command.action in (below or {}):
            menus[command.menu].addMenu((below or {})[command.action])
            continue
        action = _action(command, window, doing)
        if command.line_before:
            menus[command.menu].addSeparator()
        menus[command.menu].addAction(action)
        actions[command.action] = action
    for name, menu in menus.items():
        if again := [actions[command.action] for command in COMMANDS if command.also == name]:
            menu.addSeparator()
            menu.addActions(again)
    for button in window.findChildren(QPushButton):
        if name := button.property("command"):
            button.setToolTip(with_keys(button.toolTip(), name))
            button.clicked.connect(actions[name].trigger)
    return actions


def _action(command: Command, window: QMainWindow, doing: tuple[QObject, ...]) -> QAction:
    action = QAction(command.words, window)
    action.setShortcuts([QKeySequence(key) for key in command.keys])
    action.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
    action.setAutoRepeat(False)
    name, _, argument = command.action.partition(":")
    method = next(getattr(one, name) for one in doing if hasattr(one, name))
    action.triggered.connect(partial(call_with, method, argument) if argument else method)
    return action


def pressed_by_enter(focused: QWidget | None, event: QKeyEvent) -> bool:
    """Click the focused button if the key is Enter; return whether it was clicked.

    Buttons pass Enter on to their window, so that this one handler serves all buttons.
    """
    enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat()
    if enter and isinstance(focused, QAbstractButton) and focused.isEnabled():
        focused.click()
        return True
    return False

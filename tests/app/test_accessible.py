"""The window without a mouse and without eyes: names, tooltips, the order of Tab, keys wherever the focus is."""

import re

import pytest
import shiboken6
from PySide6.QtCore import Qt
from PySide6.QtGui import QAccessible, QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QApplication,
    QCheckBox,
    QComboBox,
    QHeaderView,
    QLineEdit,
    QMainWindow,
    QProgressBar,
    QScrollArea,
    QTabBar,
    QWidget,
)

from analysis.collision.effects import CATALOGUE
from app.session.session import Session
from app.window.controls import commands
from app.window.controls.commands import COMMANDS, MENUS
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.panels.tables import TreeTable
from app.window.plots.plot_view import PlotView
from tests.app import synthetic
from tests.app.on_screen import effect_button

INTERACTIVE = (QAbstractButton, QAbstractItemView, QComboBox, QLineEdit, QProgressBar, QScrollArea, PlotView)


class Pressed:
    """A presenter that does nothing but count."""

    def __init__(self):
        self.actions = []

    def __getattr__(self, name):
        return lambda *of: self.actions.append(":".join((name, *(word for word in of if isinstance(word, str)))))


@pytest.fixture(scope="module")
def whole(qapp):
    """Return one window for all tests here, each of which finds it in front on its first page, no sheet open."""
    main = QMainWindow()
    main.panels = Layout(Theme("light"), main)
    main.setCentralWidget(main.panels)
    main.pressed = Pressed()
    commands.bind(main, (main.pressed,))
    session = Session()
    for index, speed in enumerate((0.2, 0.25), 1):
        session.add(synthetic.shot(f"shot-{index}", speed, index))
    entries = list(session.entries)
    main.panels.table.show_session(session)
    main.panels.shot.show_shot(entries[0].shot)
    main.panels.compare.show_entries(entries)
    main.panels.diagnosis.show_diagnosis(synthetic.diagnosis(entries[0].shot), [entries[0].shot])
    main.panels.budget.show_shot(entries[0].shot)
    main.resize(1480, 920)
    main.show()
    yield main
    main.close()
    shiboken6.delete(main)  # at once: the garbage collector would take its plots apart in any order


@pytest.fixture
def window(whole, qtbot):
    """Return the window, in front, nothing open over it."""
    panels = whole.panels
    for sheet in (panels.settings, panels.setup, panels.keys, panels.about, panels.tour, panels.mapping):
        sheet.hide()
    panels.tabs.setCurrentIndex(0)
    panels.controls.arm.setFocus()
    whole.pressed.actions.clear()
    whole.activateWindow()
    qtbot.waitUntil(whole.isActiveWindow)
    return whole


def _used(window):
    """Return what a person uses: not Qt's own parts inside of a table, a box or a scroll area."""
    for widget in window.findChildren(QWidget):
        inside = isinstance(widget.parent(), QAbstractItemView | QComboBox) or isinstance(widget, QHeaderView)
        listed = any(isinstance(parent, QComboBox) for parent in _parents(widget))
        if isinstance(widget, INTERACTIVE) and not inside and not listed and not isinstance(widget.parent(), QTabBar):
            yield widget


def _parents(widget):
    while (widget := widget.parentWidget()) is not None:
        yield widget


def _reachable(window):
    return [w for w in _used(window) if w.isVisible() and w.isEnabled() and w.focusPolicy() & Qt.FocusPolicy.TabFocus]


def test_everything_that_is_used_has_a_name_for_a_screen_reader(window):
    nameless = []
    for widget in _used(window):
        told = QAccessible.queryAccessibleInterface(widget)
        if not told.text(QAccessible.Text.Name).strip(" …"):
            nameless.append(widget)
    assert nameless == []


def test_every_button_and_field_says_in_a_line_what_it_is_for(window):
    kinds = QAbstractButton | QComboBox | QLineEdit
    silent = [w for w in _used(window) if isinstance(w, kinds) and not w.toolTip()]
    assert [w.accessibleName() or getattr(w, "text", str)() for w in silent] == []


@pytest.mark.parametrize("page", range(8))
def test_tab_reaches_everything_on_a_page_and_comes_round(window, qtbot, page):
    window.panels.tabs.setCurrentIndex(page)
    qtbot.wait(20)
    wanted = set(_reachable(window))
    window.panels.controls.source.setFocus()
    seen = []
    for _ in range(200):
        here = QApplication.focusWidget()
        if here in seen:
            break
        seen.append(here)
        qtbot.keyClick(here, Qt.Key.Key_Tab)
    # of several of which one is chosen Tab stops at that one, and arrows go to the others
    wanted -= {w for w in wanted if isinstance(w, QAbstractButton) and w.group() is not None and not w.isChecked()}
    missed = [w.accessibleName() or getattr(w, "text", str)() or type(w).__name__ for w in wanted - set(seen)]
    assert missed == []


@pytest.mark.parametrize("page", range(8))
def test_keys_work_wherever_the_focus_is_but_never_steal_what_is_typed(window, qtbot, page):
    window.panels.tabs.setCurrentIndex(page)
    qtbot.wait(20)
    tab_bar = window.panels.tabs.tabBar()
    fields = [w for w in _reachable(window) if isinstance(w, QLineEdit)]
    for field in fields:  # what is typed there stays there; Enter gives the keyboard back
        field.setFocus()
        window.pressed.actions.clear()
        qtbot.keyClicks(field, "tr 2")
        assert field.text() == "tr 2" and window.pressed.actions == []
        qtbot.keyClick(field, Qt.Key.Key_Return)
        assert not field.hasFocus()
        field.clear()
    for widget in [*(w for w in _reachable(window) if w not in fields), tab_bar]:
        for command in COMMANDS:
            for key in command.keys:
                (stroke,) = QKeySequence(key)
                widget.setFocus()
                window.pressed.actions.clear()
                qtbot.keyClick(widget, stroke.key(), stroke.keyboardModifiers())
                own = isinstance(widget, TreeTable) and key == "Ctrl+C"  # a table copies its own lines
                assert window.pressed.actions == ([] if own else [command.action]), f"{key} in {widget}"


def test_letters_and_space_typed_into_a_field_stay_there(window, qtbot):
    sheet = window.panels.settings
    sheet.open()
    for field in sheet.findChildren(QLineEdit):
        if field.validator() is None:
            field.clear()
            field.setFocus()
            qtbot.keyClicks(field, "T 1 rd")
            assert field.text() == "T 1 rd"
    assert window.pressed.actions == []


def test_enter_presses_buttons_made_later_too(window, qtbot):
    main = window
    main.keyPressEvent = lambda event: commands.pressed_by_enter(main.focusWidget(), event)
    main.panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)
    qtbot.wait(20)
    button = effect_button(main.panels.diagnosis.effects, "quadratic_drag")
    button.setFocus()
    with qtbot.waitSignal(main.panels.diagnosis.effects.add_wanted):
        qtbot.keyClick(button, Qt.Key.Key_Return)
    box = main.panels.controls.rearm
    assert isinstance(box, QCheckBox)
    box.setFocus()
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert box.isChecked()


def test_a_sheet_gives_the_keyboard_back_when_it_goes(window, qtbot):
    table = window.panels.table.table
    for sheet in (window.panels.settings, window.panels.setup):
        table.setFocus()
        sheet.open()
        assert sheet.isAncestorOf(QApplication.focusWidget())
        sheet.close()
        assert QApplication.focusWidget() is table


def test_nothing_but_the_window_ever_comes_up_and_the_keyboard_stays(window, qtbot, appeared):
    panels = window.panels
    shot = synthetic.shot("shot-3")
    found = synthetic.diagnosis(shot)
    panels.table.table.setFocus()

    def shown_on_every_page():
        for page in range(8):
            panels.tabs.setCurrentIndex(page)
            panels.diagnosis.show_diagnosis(found, [shot])
            panels.diagnosis.show_diagnosis(found, [shot], (CATALOGUE["quadratic_drag"],))
            panels.diagnosis.show_diagnosis(None, [])
            panels.shot.show_shot(shot)
            panels.compare.show_entries([])
            panels.budget.show_shot(shot)
            panels.setup.show_devices((), (), "bench")
            panels.apply_colours()
            qtbot.wait(10)

    assert appeared(shown_on_every_page) == []
    assert QApplication.focusWidget() is panels.table.table


def test_menu_and_key_carry_out_one_action_and_what_a_tooltip_names_is_a_key(window):
    known = {key for command in COMMANDS for key in command.keys}
    by_menu = [action for menu in window.menuBar().actions() for action in menu.menu().actions() if action.text()]
    expected = [c for name in MENUS for of in ("menu", "also") for c in COMMANDS if getattr(c, of) == name]
    assert [action.text() for action in by_menu] == [command.words for command in expected]
    for action, command in zip(by_menu, expected, strict=True):
        assert [key.toString() for key in action.shortcuts()] == [QKeySequence(key).toString() for key in command.keys]
        window.pressed.actions.clear()
        action.trigger()
        assert window.pressed.actions == [command.action]
    named = {found[1] for w in _used(window) if (found := re.search(r"  \(([^()]+)\)$", w.toolTip()))}
    of_qt = {"Esc", "space", "Enter", "Enter in a field", "Enter in the field"}
    wrong = {key for text in named for key in re.split(", | or ", text)} - known - of_qt
    assert not wrong
